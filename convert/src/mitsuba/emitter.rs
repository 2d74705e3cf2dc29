//! Owns lights.

use glam::{DAffine3, DVec3};
use serde_json::json;

use super::color::Role;
use super::medium::medium;
use super::object::{Object, Value};
use super::output::{Output, Table};
use super::texture::{constant, image};
use super::transform::affine;
use crate::ConvertError;
use crate::parts::{Fields, fields, transform, unsigned};

/// Radiance of the light that a shape is.
pub(super) fn emission(out: &mut Output<'_>, index: usize) -> Result<[f64; 3], ConvertError> {
    let object = out.object(index);
    if object.plugin != "area" {
        out.untranslated(&object.place, format!("a {} on a shape: it does not shine", object.title()));
        object.properties.iter().for_each(|property| property.used.set(true));
        return Ok([0.0; 3]);
    }
    object.ignore(&["sampling_weight", "power_sampling"]);
    strength(out, object, "radiance", "the shape does not shine")
}

/// Adds a light that is not a shape.
pub(super) fn emitter(out: &mut Output<'_>, index: usize) -> Result<(), ConvertError> {
    let object = out.object(index);
    object.ignore(&["sampling_weight"]);
    for (property, inner) in object.nested() {
        if out.scene.objects[inner].tag == "medium" {
            property.used.set(true);
            medium(out, inner)?;
        }
    }
    let fields = match object.plugin.as_str() {
        "point" => point(out, object)?,
        "spot" => spot(out, object)?,
        "directional" => directional(out, object)?,
        "constant" => {
            let radiance = strength(out, object, "radiance", "nothing comes from outside")?;
            Some(fields("environment", [("radiance", json!(radiance))]))
        }
        "envmap" => environment(out, object)?,
        _ => {
            out.untranslated(&object.place, format!("a {}", object.title()));
            object.properties.iter().for_each(|property| property.used.set(true));
            None
        }
    };
    if let Some(fields) = fields {
        let name = out.name(Table::Lights, object.id.as_deref().unwrap_or(&object.plugin));
        out.add(Table::Lights, name, fields);
    }
    Ok(())
}

/// A colour of light, 1 unless given; 0, with a note, where it varies.
fn strength(
    out: &mut Output<'_>,
    object: &Object,
    name: &str,
    otherwise: &str,
) -> Result<[f64; 3], ConvertError> {
    let Some(property) = object.get(name) else { return Ok([1.0; 3]) };
    let Some(rgb) = constant(out, property, Role::Light)? else {
        let what = if let Value::Object(index) = property.value {
            out.scene.objects[index].title()
        } else {
            "texture".to_owned()
        };
        let text = format!("a {what} as the {name} of a {}: {otherwise}", object.title());
        out.untranslated(&property.place, text);
        return Ok([0.0; 3]);
    };
    Ok(rgb.map(|channel| out.within(&property.place, name, channel, [0.0, f64::from(f32::MAX)])))
}

fn vector(vector: DVec3) -> serde_json::Value {
    json!(vector.to_array().map(unsigned))
}

/// Where z of the light's own frame points.
fn forward(object: &Object, map: &DAffine3) -> Result<DVec3, ConvertError> {
    let direction = map.transform_vector3(DVec3::Z);
    if direction.try_normalize().is_some() {
        return Ok(direction);
    }
    Err(object.place.error(format!("found a {} without a direction", object.title())))
}

fn point(out: &mut Output<'_>, object: &Object) -> Result<Option<Fields>, ConvertError> {
    let intensity = strength(out, object, "intensity", "it does not shine")?;
    let position = affine(&object.transform("to_world")?).translation;
    let position = object.vector("position")?.unwrap_or(position);
    Ok(Some(fields("point", [("position", vector(position)), ("intensity", json!(intensity))])))
}

fn spot(out: &mut Output<'_>, object: &Object) -> Result<Option<Fields>, ConvertError> {
    let map = affine(&object.transform("to_world")?);
    let intensity = strength(out, object, "intensity", "it does not shine")?;
    let cutoff = object.number_or("cutoff_angle", 20.0)?;
    let beam = object.number_or("beam_width", cutoff * 0.75)?;
    if !(cutoff > 0.0 && cutoff <= 180.0 && (0.0..=cutoff).contains(&beam)) {
        let message = format!(
            "found a beam_width of {beam} and a cutoff_angle of {cutoff}, expected 0 to 180, growing"
        );
        return Err(object.place.error(message));
    }
    Ok(Some(fields(
        "spotlight",
        [
            ("position", vector(map.translation)),
            ("direction", vector(forward(object, &map)?)),
            ("intensity", json!(intensity)),
            ("beam_width", json!(beam)),
            ("cutoff_angle", json!(cutoff)),
        ],
    )))
}

fn directional(out: &mut Output<'_>, object: &Object) -> Result<Option<Fields>, ConvertError> {
    let irradiance = strength(out, object, "irradiance", "it does not shine")?;
    let map = affine(&object.transform("to_world")?);
    let direction = match object.vector("direction")? {
        Some(direction) if direction != DVec3::ZERO => direction,
        Some(_) => return Err(object.place.error("found the direction 0 0 0, expected another")),
        None => forward(object, &map)?,
    };
    Ok(Some(fields(
        "sun",
        [("direction", vector(direction)), ("irradiance", json!(irradiance)), ("angular_size", json!(0.0))],
    )))
}

fn environment(out: &mut Output<'_>, object: &Object) -> Result<Option<Fields>, ConvertError> {
    let Some(name) = object.text("filename")? else {
        return Err(object.place.error(format!("found a {} without \"filename\"", object.title())));
    };
    let place = object.get("filename").map_or(&object.place, |property| &property.place);
    let Some(source) = image(out, name, place)? else { return Ok(None) };
    object.ignore(&["mis_compensation", "cache"]);
    let scale = object.number_or("scale", 1.0)?;
    let scale = out.within(&object.place, "scale", scale, [0.0, f64::from(f32::MAX)]);
    let path = out.file("textures", &source);
    let mut found =
        fields("environment", [("radiance", json!([scale, scale, scale])), ("image", json!(path))]);
    // Version 0.6 has the centres of its outer texels half a texel from the poles.
    found.insert("rows_at_poles".to_owned(), json!(!out.scene.legacy));
    let turn = DAffine3::from_mat3(affine(&object.transform("to_world")?).matrix3);
    if turn.matrix3.determinant() == 0.0 {
        return Err(object.place.error("found a transform that cannot be inverted, expected a rotation"));
    }
    if turn != DAffine3::IDENTITY {
        found.insert("transform".to_owned(), transform(&turn));
    }
    Ok(Some(found))
}
