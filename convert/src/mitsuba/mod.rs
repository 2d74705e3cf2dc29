//! Owns Mitsuba's XML scenes, of version 3 and 0.6.
//!
//! Text becomes elements ([`xml`]), files and variables are put together and elements become objects with properties
//! ([`load`], [`object`]), and one module for each kind of object puts it into the document ([`output`]). What nobody
//! asked an object for is noted at the end, so that nothing is lost in silence.

mod bsdf;
mod cie;
mod color;
mod emitter;
mod integrator;
mod load;
mod medium;
mod normals;
mod object;
mod output;
mod place;
mod primitive;
mod sensor;
mod shape;
mod substance;
#[cfg(test)]
mod tests;
mod texture;
mod transform;
mod value;
mod xml;

use std::path::Path;

use crate::{ConvertError, Converted};
use output::Output;

/// Reads a scene and everything it includes.
pub(crate) fn convert(path: &Path) -> Result<Converted, ConvertError> {
    let scene = load::load(path)?;
    let mut out = Output::new(&scene);
    let root = out.object(scene.root);
    let (mut sensors, mut integrators) = (0, 0);
    for (property, index) in root.nested() {
        property.used.set(true);
        let object = &scene.objects[index];
        match object.tag.as_str() {
            "integrator" => {
                integrators += 1;
                integrator::integrator(&mut out, index)?;
            }
            "sensor" if sensors == 0 => {
                sensors += 1;
                sensor::sensor(&mut out, index)?;
            }
            "bsdf" => drop(bsdf::material(&mut out, index, "material")?),
            "shape" => shape::shape(&mut out, index)?,
            // Shapes refer to it.
            "emitter" if object.plugin == "area" => {}
            "emitter" => emitter::emitter(&mut out, index)?,
            "medium" => drop(medium::medium(&mut out, index)?),
            // They are looked up where they are referred to.
            "texture" | "spectrum" | "rfilter" | "sampler" | "film" | "phase" | "volume" => {}
            _ => out.untranslated(&object.place, format!("a {}", object.title())),
        }
    }
    for (_, index) in root.nested() {
        let object = &scene.objects[index];
        if object.tag == "emitter" && !object.converted.get() {
            out.untranslated(&object.place, format!("a {} that no shape refers to", object.title()));
        }
    }
    medium::note_surroundings(&mut out);
    if sensors == 0 {
        return Err(root.place.error("found no sensor, expected one of type perspective or thinlens"));
    }
    if integrators == 0 {
        integrator::default_integrator(&mut out);
    }
    Ok(out.finish())
}
