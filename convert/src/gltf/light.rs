//! Owns the lights of `KHR_lights_punctual`.
//!
//! glTF counts in candela, lux and (for surfaces) candela per square metre. Numbers are taken over as they are, as
//! intensity, irradiance and radiance: they keep their proportions, and a pixel of 1 is one candela per square metre.

use glam::{DAffine3, DVec3};
use serde_json::{Value, json};

use super::description::Light;
use super::output::{Output, add};
use super::reader::Reader;
use crate::ConvertError;

/// Adds a light to the document, which shines along -z of its node.
pub(super) fn light(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    index: u32,
    world: &DAffine3,
    name: Option<&str>,
    place: &str,
) -> Result<(), ConvertError> {
    let lights = reader.root.extensions.lights.as_ref().map_or(&[][..], |table| &table.lights);
    let light = reader.get(lights, index, place, "lights")?;
    let here = format!("extensions.KHR_lights_punctual.lights[{index}]");
    let mut color = light.color.unwrap_or([1.0; 3]);
    for channel in &mut color {
        let shone = reader.finite(*channel * light.intensity, &here)?;
        if shone < 0.0 {
            return Err(reader.error(here, format!("found the intensity {shone:?}, expected none below 0")));
        }
        *channel = shone;
    }
    let position = world.translation;
    for number in position.to_array() {
        reader.finite(number, place)?;
    }
    let direction = world.matrix3 * DVec3::NEG_Z;
    if light.kind != "point" && direction.try_normalize().is_none() {
        output.untranslated(place, "a light whose node leaves it no direction");
        return Ok(());
    }
    let entry = match light.kind.as_str() {
        "directional" => json!({
            "type": "sun", "direction": direction.to_array(), "irradiance": color, "angular_size": 0,
        }),
        "point" => json!({"type": "point", "position": position.to_array(), "intensity": color}),
        "spot" => spot(reader, output, light, &here, json!(position.to_array()), json!(direction.to_array()))
            .map(|mut spot| {
                spot["intensity"] = json!(color);
                spot
            })?,
        other => {
            let message = format!("found the type {other:.20?}, expected directional, point or spot");
            return Err(reader.error(here, message));
        }
    };
    if let Some(range) = light.range {
        output.untranslated(here, format!("the range {range}: light falls with the squared distance alone"));
    }
    add(&mut output.lights, light.name.as_deref().or(name), &format!("light_{index}"), entry);
    Ok(())
}

fn spot(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    light: &Light,
    place: &str,
    position: Value,
    direction: Value,
) -> Result<Value, ConvertError> {
    let angles = light.spot.as_ref();
    let inner = angles.and_then(|spot| spot.inner_cone_angle).unwrap_or(0.0).to_degrees();
    let outer = angles.and_then(|spot| spot.outer_cone_angle).map_or(45.0, f64::to_degrees);
    let fits = (0.0..=outer).contains(&inner) && outer > 1.0e-6 && outer <= 90.0 + 1.0e-3;
    if !fits {
        let message =
            format!("found cones of {inner:?} and {outer:?} degrees, expected 0 <= inner < outer <= 90");
        return Err(reader.error(place, message));
    }
    // Measured at equal steps of the angle, the line is nearer to it than a smoothstep of the cosine or a power of it.
    output.differs(
        place,
        "between the cones light falls linearly with the angle, in glTF with the squared share of the cosine",
    );
    Ok(json!({
        "type": "spotlight", "position": position, "direction": direction, "beam_width": inner, "cutoff_angle": outer,
    }))
}
