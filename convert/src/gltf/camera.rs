//! Owns the camera and the size of the picture.

use glam::{DAffine3, DMat3, DVec3};
use serde_json::{Value, json};

use super::output::Output;
use super::reader::Reader;
use crate::ConvertError;
use crate::parts::transform;

/// Height of the picture, in pixels: glTF says only its proportions.
const HEIGHT: f64 = 720.0;
/// Proportions of the picture where the file says none.
const ASPECT: f64 = 16.0 / 9.0;
/// Vertical angle of view of a scene without a camera, in degrees.
const VFOV: f64 = 40.0;
/// Sine of half that angle.
const HALF_VFOV_SINE: f64 = 0.342;

/// Coordinates beyond which nothing is shown: their squares still fit single precision.
const FAR: f64 = 1.0e18;

/// A view of the scene.
#[derive(Debug)]
pub(super) struct View {
    pub(super) camera: Value,
    pub(super) film: Value,
}

/// The camera with an index, at a node; nothing where it is noted that karst has none of its kind.
pub(super) fn view(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    index: u32,
    world: &DAffine3,
    place: &str,
) -> Result<Option<View>, ConvertError> {
    let camera = reader.get(&reader.root.cameras, index, place, "cameras")?;
    let here = format!("cameras[{index}]");
    let Some(found) = &camera.perspective else {
        output.untranslated(here, "a camera without perspective");
        return Ok(None);
    };
    let vfov = found.yfov.to_degrees();
    if !(0.001..179.9).contains(&vfov) {
        let message =
            format!("found the yfov {:?} ({vfov:?} degrees), expected 0.001 to 179.9 degrees", found.yfov);
        return Err(reader.error(here, message));
    }
    let aspect = found.aspect_ratio.unwrap_or(ASPECT);
    if !(0.01..=64.0).contains(&aspect) {
        return Err(reader.error(here, format!("found the aspectRatio {aspect:?}, expected 0.01 to 64")));
    }
    let Some(placed) = upright(world) else {
        output.untranslated(place, "a camera whose node leaves it no direction");
        return Ok(None);
    };
    let camera = json!({"type": "perspective", "vfov": vfov, "transform": transform(&placed)});
    Ok(Some(View { camera, film: film(aspect) }))
}

/// The placement without scale and shear, which a camera does not take over.
fn upright(world: &DAffine3) -> Option<DAffine3> {
    let z = world.matrix3.z_axis.try_normalize()?;
    let y = world.matrix3.y_axis;
    let y = (y - z * y.dot(z)).try_normalize()?;
    let placed = DAffine3 { matrix3: DMat3::from_cols(y.cross(z), y, z), translation: world.translation };
    placed.is_finite().then_some(placed)
}

/// A view that shows everything between two corners of a box.
pub(super) fn whole(low: DVec3, high: DVec3) -> View {
    let (low, high) = if low.cmple(high).all() { (low, high) } else { (DVec3::NEG_ONE, DVec3::ONE) };
    let reach = DVec3::splat(FAR);
    let (low, high) = (low.clamp(-reach, reach), high.clamp(-reach, reach));
    let center = (low + high) / 2.0;
    // Far from the origin a small scene must not make eye and target one.
    let least = 1.0e-6 * center.length().max(1.0e-6);
    let radius = ((high - low).length() / 2.0).max(least);
    let eye = center + DVec3::new(0.45, 0.35, 0.82).normalize() * (1.05 * radius / HALF_VFOV_SINE);
    let look = json!({"eye": eye.to_array(), "target": center.to_array()});
    let camera = json!({"type": "perspective", "vfov": VFOV, "transform": {"look_at": look}});
    View { camera, film: film(ASPECT) }
}

fn film(aspect: f64) -> Value {
    json!({"width": (HEIGHT * aspect).round().max(1.0) as u32, "height": HEIGHT as u32})
}
