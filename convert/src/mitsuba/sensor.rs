//! Owns the camera: sensor, film, filter and sampler.

use glam::{DAffine3, DMat3, DVec3};
use serde_json::{Map, Value as Json, json};

use super::medium::medium;
use super::object::Object;
use super::output::Output;
use super::transform::affine;
use super::value;
use crate::ConvertError;
use crate::parts::transform;

/// Most samples per pixel of a document.
const MAX_SPP: u32 = 1 << 24;
/// Most pixels along one side of a film.
const MAX_SIDE: u32 = 1 << 16;

/// Puts camera, film and sampling into the document.
pub(super) fn sensor(out: &mut Output<'_>, index: usize) -> Result<(), ConvertError> {
    let object = out.object(index);
    let (mut film, mut spp, mut seed) = (None, 4, None);
    for (property, inner) in object.nested() {
        match out.scene.objects[inner].tag.as_str() {
            "film" => film = Some(out.object(inner)),
            "sampler" => (spp, seed) = sampler(out.object(inner))?,
            "medium" => {
                if let Some(name) = medium(out, inner)? {
                    out.head.insert("medium".to_owned(), json!(name));
                }
            }
            // Whatever it is, it stays unused and is noted.
            _ => continue,
        }
        property.used.set(true);
    }
    let (size, film) = match film {
        Some(film) => film_of(out, film)?,
        None => (
            [768, 576],
            json!({"width": 768, "height": 576, "filter": gaussian(out, object, 0.5), "view": "standard"}),
        ),
    };
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let camera = camera(out, object, aspect)?;
    out.head.insert("camera".to_owned(), camera);
    out.head.insert("film".to_owned(), film);
    let mut sampling = Map::from_iter([("spp".to_owned(), json!(spp))]);
    if let Some(seed) = seed {
        sampling.insert("seed".to_owned(), json!(seed));
    }
    out.head.insert("sampling".to_owned(), Json::Object(sampling));
    Ok(())
}

fn sampler(object: &Object) -> Result<(u32, Option<u32>), ConvertError> {
    object.ignore(&["dimension", "jitter", "scramble", "wavefront_size"]);
    let spp = object.count("sample_count", 4, [1, MAX_SPP])?;
    let seed = if object.has("seed") { Some(object.count("seed", 0, [0, u32::MAX])?) } else { None };
    Ok((spp, seed))
}

fn camera(out: &mut Output<'_>, object: &Object, aspect: f64) -> Result<Json, ConvertError> {
    let thin = object.plugin == "thinlens";
    if !thin && object.plugin != "perspective" {
        let text = format!("a {}: a perspective camera stands in for it", object.title());
        out.untranslated(&object.place, text);
        object.properties.iter().for_each(|property| property.used.set(true));
    }
    let vfov = vfov(object, aspect)?;
    let map = upright(object)?;
    let mut fields = Map::new();
    fields.insert("type".to_owned(), json!("perspective"));
    fields.insert("vfov".to_owned(), json!(vfov));
    fields.insert("transform".to_owned(), transform(&map));
    let far = object.number_or("far_clip", 1.0e4)?;
    let focus = object.number_or("focus_distance", far)?;
    let radius = if thin { object.number_or("aperture_radius", 0.0)? } else { 0.0 };
    if radius > 0.0 {
        if focus <= 0.0 {
            return Err(object
                .place
                .error(format!("found a focus_distance of {focus}, expected one above 0")));
        }
        fields.insert("lens_radius".to_owned(), json!(radius));
        fields.insert("focus_distance".to_owned(), json!(focus));
    }
    if object.has("near_clip") || object.has("far_clip") {
        object.ignore(&["near_clip", "far_clip"]);
        out.differs(&object.place, "near_clip and far_clip: karst shows what is nearer and farther too");
    }
    for name in ["principal_point_offset_x", "principal_point_offset_y"] {
        if object.number_or(name, 0.0)? != 0.0 {
            out.untranslated(&object.place, format!("{name:?} of a {}", object.title()));
        }
    }
    if object.number_or("shutter_close", 0.0)? > object.number_or("shutter_open", 0.0)? {
        out.untranslated(&object.place, "an open shutter: karst has no motion blur");
    }
    Ok(Json::Object(fields))
}

/// The full vertical angle of view, in degrees.
fn vfov(object: &Object, aspect: f64) -> Result<f64, ConvertError> {
    let place = object.get("fov").map_or(&object.place, |property| &property.place);
    let half = |degrees: f64| libm::tan((degrees / 2.0).to_radians());
    let whole = |tangent: f64| 2.0 * libm::atan(tangent).to_degrees();
    let angle = object.number("fov")?;
    let axis = object.text("fov_axis")?.unwrap_or("x").to_ascii_lowercase();
    let (angle, axis) = match angle {
        Some(angle) => (angle, axis.as_str()),
        None => (
            2.0 * libm::atan(libm::hypot(36.0, 24.0) / (2.0 * focal_length(object)?)).to_degrees(),
            "diagonal",
        ),
    };
    let axis = match axis {
        "smaller" if aspect > 1.0 => "y",
        "larger" if aspect <= 1.0 => "y",
        "smaller" | "larger" => "x",
        other => other,
    };
    let vertical = match axis {
        "x" => whole(half(angle) / aspect),
        "y" => angle,
        "diagonal" => whole(half(angle) / libm::hypot(aspect, 1.0)),
        other => {
            let message = format!("found the fov_axis {other:?}, expected x, y, diagonal, smaller or larger");
            return Err(place.error(message));
        }
    };
    if angle > 0.0 && angle < 180.0 {
        return Ok(vertical);
    }
    Err(place.error(format!("found a fov of {angle}, expected an angle above 0 and below 180 degrees")))
}

/// The focal length in mm of a lens for film of 36 by 24 mm.
fn focal_length(object: &Object) -> Result<f64, ConvertError> {
    let Some(text) = object.text("focal_length")? else { return Ok(50.0) };
    let digits = text.trim().trim_end_matches("mm");
    let found = value::number(digits).ok().filter(|length| *length > 0.0);
    found.ok_or_else(|| {
        object.place.error(format!("found the focal_length {text:?}, expected one such as 50mm"))
    })
}

/// Places the camera. Mitsuba's looks along z with x to the left, karst's along −z with x to the right.
fn upright(object: &Object) -> Result<DAffine3, ConvertError> {
    let map = affine(&object.transform("to_world")?);
    let [x, y, z] = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(without_scale);
    let (Some(x), Some(y), Some(z)) = (x, y, z) else {
        return Err(object.place.error("found a camera whose transform cannot be inverted"));
    };
    let map = DAffine3 { matrix3: DMat3::from_cols(-x, y, -z), translation: map.translation };
    if map.matrix3.determinant() == 0.0 {
        return Err(object.place.error("found a camera whose transform cannot be inverted"));
    }
    Ok(map)
}

/// An axis without its scale; one that has none keeps every bit.
fn without_scale(axis: DVec3) -> Option<DVec3> {
    if (axis.length_squared() - 1.0).abs() < 1.0e-4 { Some(axis) } else { axis.try_normalize() }
}

/// The size of a film, and its entry in the document.
fn film_of(out: &mut Output<'_>, object: &Object) -> Result<([u32; 2], Json), ConvertError> {
    object.ignore(&[
        "file_format",
        "pixel_format",
        "component_format",
        "banner",
        "sample_border",
        "high_quality_edges",
        "compensate",
        "attach_log",
        "gamma",
        "exposure",
        "tonemap_method",
        "key",
        "burn",
        "metadata",
        "label",
    ]);
    let side = |name: &str, default: u32| object.count(name, default, [1, MAX_SIDE]);
    let size = [side("width", 768)?, side("height", 576)?];
    let mut fields = Map::new();
    fields.insert("width".to_owned(), json!(size[0]));
    fields.insert("height".to_owned(), json!(size[1]));
    let at = |name: &str| object.count(name, 0, [0, MAX_SIDE]);
    let offset = [at("crop_offset_x")?, at("crop_offset_y")?];
    let crop = [
        side("crop_width", size[0].saturating_sub(offset[0]).max(1))?,
        side("crop_height", size[1].saturating_sub(offset[1]).max(1))?,
    ];
    if offset[0] + crop[0] > size[0] || offset[1] + crop[1] > size[1] {
        let ([x, y], [width, height]) = (offset, crop);
        let message = format!(
            "found a crop of {width} x {height} at ({x}, {y}), the film has {} x {}",
            size[0], size[1]
        );
        return Err(object.place.error(message));
    }
    if offset != [0, 0] || crop != size {
        let crop = json!({"x": offset[0], "y": offset[1], "width": crop[0], "height": crop[1]});
        fields.insert("crop".to_owned(), crop);
    }
    let filter = object.nested().find(|(_, index)| out.scene.objects[*index].tag == "rfilter");
    let filter = match filter {
        Some((property, index)) => {
            property.used.set(true);
            filter_of(out, out.object(index))?
        }
        None => gaussian(out, object, 0.5),
    };
    fields.insert("filter".to_owned(), filter);
    fields.insert("view".to_owned(), json!("standard"));
    Ok((size, Json::Object(fields)))
}

/// A Gaussian of this standard deviation, in pixels.
fn gaussian(out: &mut Output<'_>, object: &Object, deviation: f64) -> Json {
    let text =
        format!("a Gaussian filter of standard deviation {deviation} ends at 3 deviations, Mitsuba's at 4");
    out.differs(&object.place, text);
    json!({"type": "gaussian", "radius": (3.0 * deviation).clamp(0.1, 8.0)})
}

fn filter_of(out: &mut Output<'_>, object: &Object) -> Result<Json, ConvertError> {
    Ok(match object.plugin.as_str() {
        "box" => {
            let radius = object.number_or("radius", 0.5)?;
            json!({"type": "box", "radius": out.within(&object.place, "the radius of a filter", radius, [0.01, 8.0])})
        }
        "gaussian" => {
            object.ignore(&["radius"]);
            let deviation = object.number_or("stddev", 0.5)?;
            gaussian(out, object, deviation)
        }
        "tent" => {
            let radius = object.number_or("radius", 1.0)?;
            out.differs(&object.place, "a tent filter becomes the Gaussian of the same standard deviation");
            // A tent of radius r has the deviation r/√6, karst's Gaussian a third of its radius.
            json!({"type": "gaussian", "radius": (radius * 3.0 / 6.0_f64.sqrt()).clamp(0.1, 8.0)})
        }
        _ => {
            object.properties.iter().for_each(|property| property.used.set(true));
            out.differs(&object.place, format!("a {} becomes a Blackman-Harris filter", object.title()));
            json!({"type": "blackman_harris", "radius": 1.5})
        }
    })
}
