//! Owns textures and the parameters that may be textures.

use std::path::Path;

use glam::{DAffine2, DVec2};
use serde_json::{Value as Json, json};

use super::color::{Color, Role};
use super::object::{Object, Property, Value};
use super::output::Output;
use super::transform::affine_uv;
use crate::ConvertError;
use crate::parts::{FLIP_V, Fields, fields, transform_uv};

/// Endings of the images that documents may name.
const IMAGES: [&str; 5] = ["png", "jpg", "jpeg", "exr", "hdr"];
/// Those of images whose numbers are proportional to light.
const LINEAR: [&str; 2] = ["exr", "hdr"];

/// Linear Rec.709 of a property that does not vary; `None` for what does.
pub(super) fn constant(
    out: &mut Output<'_>,
    property: &Property,
    role: Role,
) -> Result<Option<[f64; 3]>, ConvertError> {
    match &property.value {
        Value::Number(number) => Ok(Some([*number; 3])),
        Value::Integer(integer) => Ok(Some([*integer as f64; 3])),
        Value::Color(color) => {
            if role == Role::Light && matches!(color, Color::Uniform(_)) && !out.scene.legacy {
                let text = "a spectrum of one value is grey; since 3.7 Mitsuba gives it the colour of equal energy, \
                            (1.205, 0.948, 0.909) times the value";
                out.differs(&property.place, text);
            }
            Ok(Some(color.linear(role)))
        }
        Value::Object(index) => constant_object(out, *index, role),
        Value::Flag(_) | Value::Text(_) | Value::Vector(_) | Value::Transform(_) | Value::Reference(_) => {
            let message =
                format!("found a {} as {:?}, expected a colour", property.value.kind(), property.name);
            Err(property.place.error(message))
        }
    }
}

/// The colour of a plugin that is only a colour.
fn constant_object(out: &mut Output<'_>, index: usize, role: Role) -> Result<Option<[f64; 3]>, ConvertError> {
    let object = &out.scene.objects[index];
    let list = |name: &str| -> Result<Vec<f64>, ConvertError> {
        let text = object.text(name)?.unwrap_or_default();
        super::value::numbers(text).map_err(|message| object.place.error(message))
    };
    let color = match object.plugin.as_str() {
        "uniform" => Color::Uniform(object.number_or("value", 1.0)?),
        "d65" => {
            let scale = object.number_or("scale", 1.0)?;
            let tint =
                object.get("color").map(|property| constant(out, property, role)).transpose()?.flatten();
            Color::Rgb(tint.unwrap_or([1.0; 3]).map(|channel| channel * scale))
        }
        "rgb" | "srgb" => {
            let property = object.get("color").or_else(|| object.get("value"));
            let missing = || object.place.error(format!("found a {} without a colour", object.title()));
            let Some(rgb) = constant(out, property.ok_or_else(missing)?, role)? else { return Ok(None) };
            Color::Rgb(rgb)
        }
        "regular" => {
            let values = list("values")?;
            let first = object.number_or("wavelength_min", object.number_or("lambda_min", 360.0)?)?;
            let last = object.number_or("wavelength_max", object.number_or("lambda_max", 830.0)?)?;
            let steps = values.len().saturating_sub(1).max(1) as f64;
            let at = |index: usize| first + (last - first) * index as f64 / steps;
            let pairs = values.iter().enumerate().map(|(index, value)| [at(index), *value]).collect();
            Color::table(pairs).map_err(|message| object.place.error(message))?
        }
        "irregular" => {
            let (wavelengths, values) = (list("wavelengths")?, list("values")?);
            if wavelengths.len() != values.len() {
                let message = format!("found {} wavelengths and {} values", wavelengths.len(), values.len());
                return Err(object.place.error(message));
            }
            let pairs =
                wavelengths.into_iter().zip(values).map(|(wavelength, value)| [wavelength, value]).collect();
            Color::table(pairs).map_err(|message| object.place.error(message))?
        }
        "blackbody" => {
            // Its temperature may be a texture.
            if object.get("temperature").is_none_or(|found| matches!(found.value, Value::Object(_))) {
                return Ok(None);
            }
            let temperature = object.number_or("temperature", 0.0)?;
            Color::blackbody(temperature, 1.0).map_err(|message| object.place.error(message))?
        }
        _ => return Ok(None),
    };
    object.converted.set(true);
    Ok(Some(color.linear(role)))
}

/// A colour from 0 to 1 that may vary: a list, or a texture.
pub(super) fn color(
    out: &mut Output<'_>,
    object: &Object,
    name: &str,
    default: f64,
) -> Result<Json, ConvertError> {
    let Some(property) = object.get(name) else { return Ok(json!([default, default, default])) };
    if let Some(rgb) = constant(out, property, Role::Share)? {
        return Ok(json!(rgb.map(|channel| out.within(&property.place, name, channel, [0.0, 1.0]))));
    }
    Ok(varying(out, property)?.unwrap_or_else(|| json!([default, default, default])))
}

/// A number within a range that may vary: a number, or a texture.
pub(super) fn number(
    out: &mut Output<'_>,
    object: &Object,
    name: &str,
    default: f64,
    range: [f64; 2],
) -> Result<Json, ConvertError> {
    let Some(property) = object.get(name) else { return Ok(json!(default)) };
    if let Some(rgb) = constant(out, property, Role::Share)? {
        return Ok(json!(out.within(&property.place, name, luminance(rgb), range)));
    }
    Ok(varying(out, property)?.unwrap_or_else(|| json!(default)))
}

/// Luminance of a colour; of a grey exactly its value.
pub(super) fn luminance([r, g, b]: [f64; 3]) -> f64 {
    if r == g && g == b { r } else { 0.212_671 * r + 0.715_160 * g + 0.072_169 * b }
}

/// A property that is a texture, noted where it cannot be kept.
fn varying(out: &mut Output<'_>, property: &Property) -> Result<Option<Json>, ConvertError> {
    let Value::Object(index) = property.value else { return Ok(None) };
    texture(out, index)
}

/// A texture; `None`, with a note, where it cannot be kept.
pub(super) fn texture(out: &mut Output<'_>, index: usize) -> Result<Option<Json>, ConvertError> {
    let object = &out.scene.objects[index];
    match object.plugin.as_str() {
        "bitmap" => bitmap(out, out.object(index)),
        "checkerboard" => checkerboard(out, out.object(index)).map(Some),
        _ => {
            out.untranslated(&object.place, format!("a {}: its parameter keeps its default", object.title()));
            Ok(None)
        }
    }
}

fn bitmap(out: &mut Output<'_>, object: &Object) -> Result<Option<Json>, ConvertError> {
    let Some(name) = object.text("filename")? else {
        out.untranslated(&object.place, format!("a {} without a file", object.title()));
        return Ok(None);
    };
    let place = object.get("filename").map_or(&object.place, |property| &property.place);
    let Some(source) = image(out, name, place)? else { return Ok(None) };
    object.ignore(&["format", "accel", "cache", "max_anisotropy"]);
    let linear = is_linear(out, object, &source)?;
    let mut fields = fields("image", [("file", json!(out.file("textures", &source)))]);
    fields.insert("color_space".to_owned(), json!(if linear { "linear" } else { "srgb" }));
    if let Some(channel) = channel(out, object)? {
        fields.insert("channel".to_owned(), json!(channel));
    }
    let wrap = wrap(out, object)?;
    if wrap != "repeat" {
        fields.insert("wrap".to_owned(), json!(wrap));
    }
    // Filters over areas do not change what many samples converge to.
    if object.text("filter_type")? == Some("nearest") {
        fields.insert("filter".to_owned(), json!("nearest"));
    }
    // Mitsuba's v runs downwards: there and back around its transform.
    put_transform(&mut fields, FLIP_V * to_uv(object)? * FLIP_V);
    Ok(Some(Json::Object(fields)))
}

/// Whether the numbers of an image are taken as they are, and not along the curve of sRGB.
fn is_linear(out: &mut Output<'_>, object: &Object, source: &Path) -> Result<bool, ConvertError> {
    let proportional = LINEAR.contains(&ending(source).as_str());
    let gamma = object.number("gamma")?;
    let linear = object.flag("raw", false)? || proportional || gamma == Some(1.0);
    // Version 0.6 takes any exponent, and -1 for sRGB.
    if let Some(gamma) = gamma.filter(|gamma| *gamma != 1.0 && (*gamma != -1.0 || linear)) {
        let taken = if linear { "numbers as they are" } else { "sRGB" };
        out.differs(&object.place, format!("a texture with the gamma {gamma}: taken as {taken}"));
    }
    Ok(linear)
}

/// An image file of the scene; `None`, with a note, where documents cannot name it.
pub(super) fn image(
    out: &mut Output<'_>,
    name: &str,
    place: &super::place::Place,
) -> Result<Option<std::path::PathBuf>, ConvertError> {
    let source = out.find(name, place)?;
    if IMAGES.contains(&ending(&source).as_str()) {
        return Ok(Some(source));
    }
    out.untranslated(place, format!("the image {name:?}: karst reads {}", IMAGES.join(", ")));
    Ok(None)
}

/// What a file's name ends in, in lower case.
pub(super) fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

fn channel(out: &mut Output<'_>, object: &Object) -> Result<Option<&'static str>, ConvertError> {
    Ok(match object.text("channel")? {
        None | Some("all" | "rgb") => None,
        Some("r" | "red" | "x") => Some("red"),
        Some("g" | "green" | "y") => Some("green"),
        Some("b" | "blue" | "z") => Some("blue"),
        Some("a" | "alpha") => Some("alpha"),
        Some(other) => {
            out.untranslated(&object.place, format!("the channel {other:?} of a texture"));
            None
        }
    })
}

fn wrap(out: &mut Output<'_>, object: &Object) -> Result<&'static str, ConvertError> {
    let both = object.text("wrap_mode")?;
    let (u, v) = (object.text("wrap_mode_u")?.or(both), object.text("wrap_mode_v")?.or(both));
    if u != v {
        out.differs(&object.place, "a texture that ends differently along u and v: taken as along u");
    }
    Ok(match u {
        None | Some("repeat") => "repeat",
        Some("mirror") => "mirror",
        Some("clamp") => "clamp",
        Some(other) => {
            let text = format!("a texture with the wrap mode {other:?}: its edge goes on instead");
            out.differs(&object.place, text);
            "clamp"
        }
    })
}

fn checkerboard(out: &mut Output<'_>, object: &Object) -> Result<Json, ConvertError> {
    let mut fields = fields("checkerboard", []);
    for (name, default) in [("color0", 0.4), ("color1", 0.2)] {
        let mut shade = [default; 3];
        if let Some(property) = object.get(name) {
            match constant(out, property, Role::Share)? {
                Some(rgb) => shade = rgb.map(|c| out.within(&property.place, name, c, [0.0, 1.0])),
                None => out.untranslated(&property.place, format!("a texture as {name:?} of a checkerboard")),
            }
        }
        fields.insert(name.to_owned(), json!(shade));
    }
    // Only into Mitsuba's coordinates: the board has no up, and which field is first must not change.
    put_transform(&mut fields, to_uv(object)? * FLIP_V);
    Ok(Json::Object(fields))
}

/// What is done to texture coordinates before the look-up, in Mitsuba's own coordinates.
fn to_uv(object: &Object) -> Result<DAffine2, ConvertError> {
    let mut map = affine_uv(&object.transform("to_uv")?);
    // Spelling of version 0.6.
    let scale = DVec2::new(object.number_or("uscale", 1.0)?, object.number_or("vscale", 1.0)?);
    let offset = DVec2::new(object.number_or("uoffset", 0.0)?, object.number_or("voffset", 0.0)?);
    map = DAffine2::from_scale_angle_translation(scale, 0.0, offset) * map;
    if map.is_finite() {
        return Ok(map);
    }
    Err(object.place.error("found a texture transform whose numbers are not finite"))
}

fn put_transform(fields: &mut Fields, map: DAffine2) {
    if map != DAffine2::IDENTITY {
        fields.insert("transform".to_owned(), transform_uv(&map));
    }
}
