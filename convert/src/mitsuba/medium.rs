//! Owns media: homogeneous ones are kept in the document.

use serde_json::{Map, Value as Json, json};

use super::color::Role;
use super::object::Object;
use super::output::{Output, Table};
use super::texture;
use crate::ConvertError;

/// Furthest from 0 that g may be in a document.
const MAX_G: f64 = 0.99;

/// The name of a medium in the document; `None`, with a note, for one that documents cannot have.
pub(super) fn medium(out: &mut Output<'_>, index: usize) -> Result<Option<String>, ConvertError> {
    if let Some(name) = out.media.get(&index) {
        return Ok(name.clone());
    }
    let object = out.object(index);
    let fields = if object.plugin == "homogeneous" { homogeneous(out, object)? } else { None };
    let name = if let Some(fields) = fields {
        let name = out.name(Table::Media, object.id.as_deref().unwrap_or("medium"));
        out.add(Table::Media, name.clone(), fields);
        Some(name)
    } else {
        out.untranslated(&object.place, format!("a {}", object.title()));
        object.properties.iter().for_each(|property| property.used.set(true));
        None
    };
    out.media.insert(index, name.clone());
    Ok(name)
}

/// A medium that is the same everywhere; `None` if something of it varies.
fn homogeneous(out: &mut Output<'_>, object: &Object) -> Result<Option<Map<String, Json>>, ConvertError> {
    object.ignore(&["sample_emitters", "has_spectral_extinction", "strategy", "sampling_weight"]);
    let mut color = |name: &str| match object.get(name) {
        Some(property) => texture::constant(out, property, Role::Share).map(Some),
        None => Ok(None),
    };
    let [sigma_t, albedo, sigma_a, sigma_s] =
        [color("sigma_t")?, color("albedo")?, color("sigma_a")?, color("sigma_s")?];
    let (sigma_a, sigma_s) = match (sigma_t, albedo, sigma_a, sigma_s) {
        (None, None, Some(sigma_a), Some(sigma_s)) => (sigma_a, sigma_s),
        (sigma_t, albedo, None, None) => {
            // Mitsuba's defaults.
            let sigma_t = sigma_t.unwrap_or(Some([1.0; 3]));
            let albedo = albedo.unwrap_or(Some([0.75; 3]));
            let split = sigma_t.zip(albedo);
            let part = |share: fn(f64) -> f64| {
                split.map(|(sigma_t, albedo)| [0, 1, 2].map(|at| sigma_t[at] * share(albedo[at])))
            };
            (part(|albedo| 1.0 - albedo), part(|albedo| albedo))
        }
        _ => {
            let message = "found neither both of sigma_t and albedo nor both of sigma_a and sigma_s";
            return Err(object.place.error(message));
        }
    };
    let (Some(sigma_a), Some(sigma_s)) = (sigma_a, sigma_s) else { return Ok(None) };
    let g = phase(out, object)?;
    let mut fields = Map::new();
    for (name, sigma) in [("sigma_a", sigma_a), ("sigma_s", sigma_s)] {
        let sigma = sigma.map(|channel| out.within(&object.place, name, channel, [0.0, f64::MAX]));
        fields.insert(name.to_owned(), json!(sigma));
    }
    let density = object.number_or("scale", 1.0)?;
    if density != 1.0 {
        fields.insert(
            "density".to_owned(),
            json!(out.within(&object.place, "scale", density, [0.0, f64::MAX])),
        );
    }
    if g != 0.0 {
        fields.insert("g".to_owned(), json!(g));
    }
    Ok(Some(fields))
}

/// Notes media that shapes name as what is around them, and that nothing fills: in documents a medium is everywhere, or
/// inside of things.
pub(super) fn note_surroundings(out: &mut Output<'_>) {
    for (place, name) in std::mem::take(&mut out.surroundings) {
        let everywhere = out.head.get("medium").and_then(Json::as_str) == Some(&name);
        if !everywhere && !out.fillings.contains(&name) {
            out.untranslated(
                &place,
                format!("the medium {name:?} around a shape: neither the sensor nor a shape is in it"),
            );
        }
    }
}

/// Henyey–Greenstein's g of the medium's phase function; 0 where it has none.
fn phase(out: &mut Output<'_>, object: &Object) -> Result<f64, ConvertError> {
    let mut g = 0.0;
    for (property, index) in object.nested() {
        let inner = &out.scene.objects[index];
        if inner.tag != "phase" {
            continue;
        }
        property.used.set(true);
        inner.converted.set(true);
        match inner.plugin.as_str() {
            "isotropic" => {}
            "hg" => {
                let found = inner.number_or("g", 0.8)?;
                g = out.within(&inner.place, "g", found, [-MAX_G, MAX_G]);
            }
            _ => out.untranslated(&inner.place, format!("a {}: it scatters evenly", inner.title())),
        }
    }
    Ok(g)
}
