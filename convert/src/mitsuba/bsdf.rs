//! Owns materials: plugins that scatter light, and the plugins around them.

use serde_json::{Value as Json, json};

use super::color::Role;
use super::object::{Object, Value};
use super::output::{Output, Table};
use super::substance;
use super::texture::{color, constant, number, texture};
use crate::ConvertError;
use crate::parts::{Fields, fields};

/// Range of indices of refraction, inside to outside.
const ETA: [f64; 2] = [0.1, 10.0];
const UNIT: [f64; 2] = [0.0, 1.0];

/// What the plugins around a material say about it.
#[derive(Debug, Default)]
struct Around {
    two_sided: bool,
    relief: Fields,
}

/// The name of the material of an object; one without an id is called `wanted`.
pub(super) fn material(out: &mut Output<'_>, index: usize, wanted: &str) -> Result<String, ConvertError> {
    if let Some(name) = out.materials.get(&index) {
        return Ok(name.clone());
    }
    let object = out.object(index);
    let name = out.name(Table::Materials, object.id.as_deref().unwrap_or(wanted));
    let material = model(out, object, Around::default())?;
    out.add(Table::Materials, name.clone(), material);
    out.materials.insert(index, name.clone());
    Ok(name)
}

/// The name of the material of shapes without one. Lights are black; in old scenes the boundary of a medium is nothing;
/// everything else is half grey from the front and black from behind.
pub(super) fn default_material(out: &mut Output<'_>, shines: bool, boundary: bool) -> String {
    // No objects have these numbers.
    let (key, name, material) = if shines {
        (usize::MAX, "black", grey(0.0, false))
    } else if boundary && out.scene.legacy {
        (usize::MAX - 1, "null", fields("null", []))
    } else {
        (usize::MAX - 2, "default", grey(0.5, false))
    };
    if let Some(name) = out.materials.get(&key) {
        return name.clone();
    }
    let name = out.name(Table::Materials, name);
    out.add(Table::Materials, name.clone(), material);
    out.materials.insert(key, name.clone());
    name
}

fn grey(shade: f64, two_sided: bool) -> Fields {
    fields("diffuse", [("reflectance", json!([shade, shade, shade])), ("two_sided", json!(two_sided))])
}

fn model(out: &mut Output<'_>, object: &Object, mut around: Around) -> Result<Json, ConvertError> {
    let inner = match object.plugin.as_str() {
        "twosided" => {
            around.two_sided = true;
            only_inner(out, object, "its first bsdf is on both sides")
        }
        "mask" => {
            let opacity = number(out, object, "opacity", 0.5, UNIT)?;
            relief(out, object, &mut around, [("opacity", opacity)]);
            only_inner(out, object, "its first bsdf is everywhere")
        }
        "bumpmap" | "bump" => {
            bump(out, object, &mut around)?;
            only_inner(out, object, "its first bsdf is everywhere")
        }
        "normalmap" => {
            normal_map(out, object, &mut around)?;
            only_inner(out, object, "its first bsdf is everywhere")
        }
        "blendbsdf" | "mixturebsdf" => {
            out.untranslated(&object.place, format!("a {}: its first bsdf stands in for it", object.title()));
            object.ignore(&["weight", "weights"]);
            first_inner(out, object)
        }
        _ => {
            let mut fields = leaf(out, object, around.two_sided)?;
            if fields.get("type") != Some(&json!("null")) {
                fields.extend(around.relief);
            }
            return Ok(Json::Object(fields));
        }
    };
    match inner {
        Some(inner) => model(out, inner, around),
        None => Err(object.place.error(format!("found a {} without a bsdf in it", object.title()))),
    }
}

/// The bsdf in a plugin around it.
fn first_inner<'a>(out: &Output<'a>, object: &Object) -> Option<&'a Object> {
    let mut first = None;
    for (property, index) in object.nested() {
        if out.scene.objects[index].tag == "bsdf" {
            property.used.set(true);
            first = first.or(Some(index));
        }
    }
    first.map(|index| out.object(index))
}

/// The same where there should be one only.
fn only_inner<'a>(out: &mut Output<'a>, object: &Object, otherwise: &str) -> Option<&'a Object> {
    let count = object.nested().filter(|(_, index)| out.scene.objects[*index].tag == "bsdf").count();
    if count > 1 {
        out.untranslated(&object.place, format!("a {} of {count} bsdfs: {otherwise}", object.title()));
    }
    first_inner(out, object)
}

fn relief<const N: usize>(
    out: &mut Output<'_>,
    object: &Object,
    around: &mut Around,
    entries: [(&str, Json); N],
) {
    for (name, value) in entries {
        if around.relief.contains_key(name) {
            out.untranslated(&object.place, format!("a {} in another one", object.title()));
        } else {
            around.relief.insert(name.to_owned(), value);
        }
    }
}

fn bump(out: &mut Output<'_>, object: &Object, around: &mut Around) -> Result<(), ConvertError> {
    let mut scale = object.number_or("scale", 1.0)?;
    let Some((property, mut index)) =
        object.nested().find(|(_, index)| out.scene.objects[*index].tag == "texture")
    else {
        out.untranslated(&object.place, format!("a {} without a texture", object.title()));
        return Ok(());
    };
    property.used.set(true);
    // Version 0.6 scales the texture.
    while out.scene.objects[index].plugin == "scale" {
        let wrapper = out.object(index);
        scale *= wrapper.number_or("scale", wrapper.number_or("value", 1.0)?)?;
        let Some((property, inner)) = wrapper.nested().next() else { break };
        property.used.set(true);
        index = inner;
    }
    if let Some(heights) = texture(out, index)? {
        relief(out, object, around, [("bump", heights), ("bump_scale", json!(scale))]);
    }
    Ok(())
}

fn normal_map(out: &mut Output<'_>, object: &Object, around: &mut Around) -> Result<(), ConvertError> {
    let named = object
        .get("normalmap")
        .and_then(|property| if let Value::Object(index) = property.value { Some(index) } else { None });
    let other = || object.nested().find(|(_, index)| out.scene.objects[*index].tag == "texture");
    let index = named.or_else(|| {
        let (property, index) = other()?;
        property.used.set(true);
        Some(index)
    });
    object.ignore(&["flip_invalid_normals", "use_shadowing_function"]);
    match index {
        None => out.untranslated(&object.place, format!("a {} without a texture", object.title())),
        Some(index) => {
            if let Some(normals) = texture(out, index)? {
                relief(out, object, around, [("normal_map", normals)]);
            }
        }
    }
    Ok(())
}

/// A plugin that scatters light by itself.
fn leaf(out: &mut Output<'_>, object: &Object, two_sided: bool) -> Result<Fields, ConvertError> {
    let mut fields = match object.plugin.as_str() {
        "diffuse" | "roughdiffuse" => diffuse(out, object)?,
        "dielectric" | "roughdielectric" => return dielectric(out, object),
        "thindielectric" => return thin_dielectric(out, object),
        "conductor" | "roughconductor" => conductor(out, object)?,
        "plastic" | "roughplastic" => plastic(out, object)?,
        "principled" => principled(out, object)?,
        "disneybsdf" => disney(out, object, "principled_bsdf", &DISNEY)?,
        "disneydiffuse" => {
            let parameters = [("base_color", 0.5), ("roughness", 0.5), ("subsurface", 0.0)];
            disney(out, object, "disney_diffuse", &parameters)?
        }
        "disneymetal" => {
            let parameters = [("base_color", 0.5), ("roughness", 0.5), ("anisotropic", 0.0)];
            disney(out, object, "disney_metal", &parameters)?
        }
        "disneyclearcoat" => disney(out, object, "disney_clearcoat", &[("clearcoat_gloss", 1.0)])?,
        "disneyglass" => {
            let parameters = [("base_color", 0.5), ("roughness", 0.5), ("anisotropic", 0.0), ("eta", 1.5)];
            return disney(out, object, "disney_glass", &parameters);
        }
        "disneysheen" => disney(out, object, "disney_sheen", &[("base_color", 0.5), ("sheen_tint", 0.5)])?,
        "null" => return Ok(fields("null", [])),
        _ => {
            let text = format!("a {}: a grey diffuse material stands in for it", object.title());
            out.untranslated(&object.place, text);
            object.properties.iter().for_each(|property| property.used.set(true));
            grey(0.5, two_sided)
        }
    };
    fields.insert("two_sided".to_owned(), json!(two_sided));
    Ok(fields)
}

fn diffuse(out: &mut Output<'_>, object: &Object) -> Result<Fields, ConvertError> {
    if object.plugin == "roughdiffuse" {
        object.ignore(&["alpha", "use_fast_approx"]);
        out.differs(&object.place, "a bsdf of type \"roughdiffuse\" is taken as diffuse");
    }
    // Its name in version 0.6 once.
    let name = if object.has("diffuse_reflectance") { "diffuse_reflectance" } else { "reflectance" };
    Ok(fields("diffuse", [("reflectance", color(out, object, name, 0.5)?)]))
}

/// An index of refraction, by number or by name.
fn index_of(object: &Object, name: &str, default: f64) -> Result<f64, ConvertError> {
    let Some(property) = object.get(name) else { return Ok(default) };
    let found = if let Value::Text(text) = &property.value {
        substance::clear(text).map_err(|message| property.place.error(message))?
    } else {
        object.number_or(name, default)?
    };
    if found > 0.0 {
        return Ok(found);
    }
    Err(property.place.error(format!("found {found} as {name:?}, expected an index of refraction above 0")))
}

/// The index of refraction of the inside, in units of that of the outside.
fn ior(out: &mut Output<'_>, object: &Object, inside: f64) -> Result<f64, ConvertError> {
    let (inside, outside) = (index_of(object, "int_ior", inside)?, index_of(object, "ext_ior", AIR)?);
    let ratio = inside / outside;
    let ratio = if object.has("eta") { index_of(object, "eta", ratio)? } else { ratio };
    Ok(out.within(&object.place, "the index of refraction", ratio, ETA))
}

const AIR: f64 = 1.000_277;
const BK7: f64 = 1.5046;
const POLYPROPYLENE: f64 = 1.49;

/// The distribution of microfacets and its width, where the plugin is rough.
fn rough(out: &mut Output<'_>, object: &Object, into: &mut Fields) -> Result<(), ConvertError> {
    if !object.plugin.starts_with("rough") {
        return Ok(());
    }
    object.ignore(&["sample_visible"]);
    if object.has("alpha_u") || object.has("alpha_v") {
        into.insert("alpha".to_owned(), number(out, object, "alpha_u", 0.1, UNIT)?);
        into.insert("alpha_v".to_owned(), number(out, object, "alpha_v", 0.1, UNIT)?);
    } else {
        into.insert("alpha".to_owned(), number(out, object, "alpha", 0.1, UNIT)?);
    }
    let distribution = match object.text("distribution")?.map(str::to_ascii_lowercase).as_deref() {
        None | Some("beckmann") => "beckmann",
        Some("ggx") => "ggx",
        Some(other) => {
            let text = format!("the distribution {other:?} of a {} is taken as beckmann", object.title());
            out.differs(&object.place, text);
            "beckmann"
        }
    };
    into.insert("distribution".to_owned(), json!(distribution));
    Ok(())
}

/// Puts a colour that is a factor, unless it is 1.
fn factor(
    out: &mut Output<'_>,
    object: &Object,
    name: &str,
    into: &mut Fields,
    field: &str,
) -> Result<(), ConvertError> {
    let found = color(out, object, name, 1.0)?;
    if found != json!([1.0, 1.0, 1.0]) {
        into.insert(field.to_owned(), found);
    }
    Ok(())
}

fn dielectric(out: &mut Output<'_>, object: &Object) -> Result<Fields, ConvertError> {
    let ior = ior(out, object, BK7)?;
    let mut found = fields("dielectric", [("ior", json!(ior))]);
    rough(out, object, &mut found)?;
    for name in ["specular_reflectance", "specular_transmittance"] {
        factor(out, object, name, &mut found, name)?;
    }
    // A boundary between equal indices does nothing.
    Ok(if ior == 1.0 { fields("null", []) } else { found })
}

fn thin_dielectric(out: &mut Output<'_>, object: &Object) -> Result<Fields, ConvertError> {
    let ior = ior(out, object, BK7)?;
    let mut found = fields("thin_dielectric", [("ior", json!(ior))]);
    for name in ["specular_reflectance", "specular_transmittance"] {
        factor(out, object, name, &mut found, name)?;
    }
    Ok(if ior == 1.0 { fields("null", []) } else { found })
}

fn conductor(out: &mut Output<'_>, object: &Object) -> Result<Fields, ConvertError> {
    let mut found = fields("conductor", []);
    if let Some([eta, k]) = complex_index(out, object)? {
        found.insert("eta".to_owned(), json!(eta));
        found.insert("k".to_owned(), json!(k));
    }
    factor(out, object, "specular_reflectance", &mut found, "reflectance")?;
    rough(out, object, &mut found)?;
    Ok(found)
}

/// Refraction and absorption of a metal; `None` is a perfect mirror.
fn complex_index(out: &mut Output<'_>, object: &Object) -> Result<Option<[[f64; 3]; 2]>, ConvertError> {
    let outside = index_of(object, "ext_eta", if out.scene.legacy { AIR } else { 1.0 })?;
    let default = if out.scene.legacy { "Cu" } else { "none" };
    let name = object.text("material")?;
    let found = if object.has("eta") || object.has("k") {
        let mut read = |name: &str, default: f64| -> Result<[f64; 3], ConvertError> {
            let Some(property) = object.get(name) else { return Ok([default; 3]) };
            if let Some(rgb) = constant(out, property, Role::Share)? {
                return Ok(rgb);
            }
            out.untranslated(&property.place, format!("a texture as {name:?} of a {}", object.title()));
            Ok([default; 3])
        };
        Some([read("eta", 0.0)?, read("k", 1.0)?])
    } else {
        let metal = substance::metal(name.unwrap_or(default));
        match metal {
            Ok(metal) => metal.map(|metal| [metal.eta, metal.k]),
            Err(message) => {
                out.untranslated(&object.place, format!("{message}: taken as a perfect mirror"));
                None
            }
        }
    };
    let bounded = |out: &mut Output<'_>, rgb: [f64; 3]| {
        rgb.map(|c| out.within(&object.place, "an index of a metal", c / outside, [0.0, 100.0]))
    };
    Ok(found.map(|[eta, k]| [bounded(out, eta), bounded(out, k)]))
}

fn plastic(out: &mut Output<'_>, object: &Object) -> Result<Fields, ConvertError> {
    let base = color(out, object, "diffuse_reflectance", 0.5)?;
    let mut found = fields("plastic", [("diffuse_reflectance", base)]);
    factor(out, object, "specular_reflectance", &mut found, "specular_reflectance")?;
    let ior = ior(out, object, POLYPROPYLENE)?;
    found.insert("ior".to_owned(), json!(ior));
    rough(out, object, &mut found)?;
    // One width for the whole surface.
    if found.remove("alpha_v").is_some() {
        out.untranslated(
            &object.place,
            format!("different alphas of a {}: taken as along u", object.title()),
        );
    }
    if found.get("alpha").is_some_and(Json::is_object) {
        out.untranslated(
            &object.place,
            format!("a texture as the alpha of a {}: taken as 0.1", object.title()),
        );
        found.insert("alpha".to_owned(), json!(0.1));
    }
    found.insert("nonlinear".to_owned(), json!(object.flag("nonlinear", false)?));
    Ok(found)
}

/// Parameters of `principled_bsdf`, under the names that both sides have, and what the course has where it says nothing.
const DISNEY: [(&str, f64); 13] = [
    ("base_color", 0.5),
    ("specular_transmission", 0.0),
    ("metallic", 0.0),
    ("subsurface", 0.0),
    ("specular", 0.5),
    ("roughness", 0.5),
    ("specular_tint", 0.0),
    ("anisotropic", 0.0),
    ("sheen", 0.0),
    ("sheen_tint", 0.5),
    ("clearcoat", 0.0),
    ("clearcoat_gloss", 1.0),
    ("eta", 1.5),
];

/// The Disney BSDF or a lobe of it, under the names of the course it comes from.
fn disney(
    out: &mut Output<'_>,
    object: &Object,
    model: &str,
    parameters: &[(&str, f64)],
) -> Result<Fields, ConvertError> {
    let mut found = fields(model, []);
    for (name, default) in parameters {
        let value = match *name {
            "base_color" => color(out, object, name, *default)?,
            "eta" => number(out, object, name, *default, ETA)?,
            _ => number(out, object, name, *default, UNIT)?,
        };
        found.insert((*name).to_owned(), value);
    }
    Ok(found)
}

/// Mitsuba's own relative of the Disney BSDF: names there and here, and what it has where it says nothing.
const PRINCIPLED: [(&str, &str, f64); 10] = [
    ("roughness", "roughness", 0.5),
    ("anisotropic", "anisotropic", 0.0),
    ("metallic", "metallic", 0.0),
    ("spec_trans", "specular_transmission", 0.0),
    ("spec_tint", "specular_tint", 0.0),
    ("sheen", "sheen", 0.0),
    ("sheen_tint", "sheen_tint", 0.0),
    ("flatness", "subsurface", 0.0),
    ("clearcoat", "clearcoat", 0.0),
    ("clearcoat_gloss", "clearcoat_gloss", 0.0),
];

fn principled(out: &mut Output<'_>, object: &Object) -> Result<Fields, ConvertError> {
    let text = "a bsdf of type \"principled\" becomes karst's principled_bsdf, which has other highlights, clearcoat and \
                sheen (Schlick's Fresnel term, a clearcoat that is divided by the cosine of the light, sheen on metal)";
    out.differs(&object.place, text);
    object.ignore(&[
        "diffuse_reflectance_sampling_rate",
        "main_specular_sampling_rate",
        "clearcoat_sampling_rate",
    ]);
    let mut found = fields("principled_bsdf", [("base_color", color(out, object, "base_color", 0.5)?)]);
    for (theirs, ours, default) in PRINCIPLED {
        found.insert(ours.to_owned(), number(out, object, theirs, default, UNIT)?);
    }
    // `specular` is another way to give the index of refraction.
    let specular = object.number_or("specular", 0.5)?;
    let eta = 2.0 / (1.0 - (0.08 * specular.max(0.0)).sqrt()) - 1.0;
    let eta = object.number("eta")?.unwrap_or(eta);
    found.insert("specular".to_owned(), json!(1.0));
    found.insert("eta".to_owned(), json!(out.within(&object.place, "the index of refraction", eta, ETA)));
    Ok(found)
}

/// Whether a material looks at texture coordinates: then they must be those of Mitsuba.
pub(super) fn uses_uv(material: &Json) -> bool {
    let Json::Object(fields) = material else { return false };
    let turned = |name: &str| fields.get(name).is_some_and(|value| *value != json!(0.0));
    fields.values().any(Json::is_object) || fields.contains_key("alpha_v") || turned("anisotropic")
}
