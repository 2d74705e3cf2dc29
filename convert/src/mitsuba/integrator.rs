//! Owns integrators: how long paths may get.

use serde_json::json;

use super::object::Object;
use super::output::Output;
use crate::ConvertError;

/// Longest paths of a document, for those without a limit.
const MAX_DEPTH: u32 = 1024;

/// Puts the limits of paths into the document.
pub(super) fn integrator(out: &mut Output<'_>, index: usize) -> Result<(), ConvertError> {
    let object = out.object(index);
    let inner = object.nested().find(|(_, index)| out.scene.objects[*index].tag == "integrator");
    if let Some((property, inner)) = inner {
        // Around another one: layers and moments, which karst writes by itself.
        property.used.set(true);
        object.properties.iter().for_each(|property| property.used.set(true));
        return integrator(out, inner);
    }
    let direct = object.plugin == "direct";
    if direct {
        object.ignore(&["shading_samples", "emitter_samples", "bsdf_samples"]);
    } else if !matches!(object.plugin.as_str(), "path" | "volpath" | "volpathmis" | "volpath_simple") {
        let text =
            format!("a {} is replaced by path tracing, which converges to the same picture", object.title());
        out.differs(&object.place, text);
        object.properties.iter().for_each(|property| property.used.set(true));
    }
    // Where roulette begins to pay depends on its rule, and karst has its own.
    object.ignore(&["rr_depth", "strict_normals", "samples_per_pass", "block_size", "timeout"]);
    if object.flag("hide_emitters", false)? {
        out.untranslated(&object.place, "hide_emitters: lights are seen directly");
    }
    let depth = surfaces(out, object, "max_depth", -1, MAX_DEPTH)?;
    let depth = if direct { 2 } else { depth };
    out.head.insert("integrator".to_owned(), json!({"max_depth": depth}));
    Ok(())
}

/// What a document without an integrator gets.
pub(super) fn default_integrator(out: &mut Output<'_>) {
    out.head.insert("integrator".to_owned(), json!({"max_depth": MAX_DEPTH}));
}

/// A number of surfaces, from 1 to the limit; −1 is no limit.
fn surfaces(
    out: &mut Output<'_>,
    object: &Object,
    name: &str,
    default: i64,
    limit: u32,
) -> Result<u32, ConvertError> {
    let found = object.integer(name)?.unwrap_or(default);
    if found == -1 {
        return Ok(limit);
    }
    let place = object.get(name).map_or(&object.place, |property| &property.place);
    let Ok(found) = u32::try_from(found) else {
        return Err(place.error(format!("found {found} as {name:?}, expected -1 or a number from 0")));
    };
    Ok(out.within(place, name, f64::from(found), [1.0, f64::from(limit)]) as u32)
}
