//! Owns glTF 2.0: `.gltf` with its buffers beside it or inside, and `.glb`.
//!
//! The first camera or a view of the whole scene, meshes by node, materials as `principled_bsdf`, lights of
//! `KHR_lights_punctual`. Planes that cut near and far, mipmaps and tangents have no counterpart and are not noted.
//! Nothing is believed before it was checked: indices, sizes, trees, numbers.

mod accessor;
mod camera;
mod container;
mod description;
mod layers;
mod light;
mod material;
mod mesh;
mod node;
mod output;
mod reader;
#[cfg(test)]
mod tests;
mod texture;

use std::path::Path;

use karst_core::scene::Limits;
use serde_json::{Value, json};

use crate::{ConvertError, Converted};
use node::Walk;
use output::Output;
use reader::Reader;

/// Longest JSON text, in bytes: in memory it takes several times as much.
const MAX_JSON: usize = 512 << 20;

/// Extensions that may be required: they are read, or the scene has its shape without them.
const EXTENSIONS: [&str; 3] = ["KHR_lights_punctual", "KHR_mesh_quantization", "KHR_texture_transform"];

/// Converts a file, and what it names beside it.
pub(super) fn convert(path: &Path) -> Result<Converted, ConvertError> {
    let limits = Limits::default();
    let unread = |source| ConvertError::File { path: path.to_owned(), source };
    let size = std::fs::metadata(path).map_err(unread)?.len();
    let name = path.display().to_string();
    if size > limits.max_asset_bytes {
        let message = format!("has {size} bytes, the limit is {}", limits.max_asset_bytes);
        return Err(ConvertError::scene(name, 0, message));
    }
    let bytes = std::fs::read(path).map_err(unread)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    read(&bytes, &name, Some(folder), &limits)
}

/// Converts the bytes of a file called `name`; without a folder there are no files beside it.
pub(super) fn read(
    bytes: &[u8],
    name: &str,
    folder: Option<&Path>,
    limits: &Limits,
) -> Result<Converted, ConvertError> {
    let parts = container::split(bytes, name)?;
    if parts.json.len() > MAX_JSON {
        let message = format!("found {} bytes of JSON, the limit is {MAX_JSON}", parts.json.len());
        return Err(ConvertError::scene(name, 0, message));
    }
    let root = container::read_json(parts.json, name, limits.max_names)?;
    let reader = Reader::new(name, &root, parts.binary, folder, limits)?;
    let mut output = Output::new(name, limits);
    check_extensions(&reader)?;
    output.others("extensions", &root.extensions.others);
    if !root.animations.is_empty() {
        let count = root.animations.len();
        output.untranslated("animations", format!("{count} animations: the scene stands as its nodes say"));
    }
    let roots = node::roots(&reader, &mut output)?;
    let Walk { view, bounds: (low, high), shines, .. } = Walk::over(&roots, &reader, &mut output)?;
    let view = view.unwrap_or_else(|| {
        output.differs(
            "cameras",
            "the scene has no camera that can be used: one that shows all of it is added",
        );
        camera::whole(low, high)
    });
    if !output.materials.is_empty() {
        output.differs(
            "materials",
            "metallic and roughness become principled_bsdf, whose diffuse part changes with the roughness and is \
             not dimmed below the highlight",
        );
    }
    if output.lights.is_empty() && !shines {
        output.differs("lights", "the scene has no light: a white environment of radiance 1 is added");
        let world = json!({"type": "environment", "radiance": [1, 1, 1]});
        output.lights.insert("environment".to_owned(), world);
    }
    let document = json!({
        "version": 1,
        "camera": view.camera,
        "film": view.film,
        "materials": Value::Object(output.materials),
        "meshes": Value::Object(output.meshes),
        "instances": Value::Object(output.instances),
        "lights": Value::Object(output.lights),
    });
    Ok(Converted { document, assets: output.assets, notes: output.notes })
}

/// Refuses a scene that cannot be shown without something that is not read.
fn check_extensions(reader: &Reader<'_>) -> Result<(), ConvertError> {
    let may_be_missing = |name: &&String| {
        EXTENSIONS.contains(&name.as_str())
            || name.starts_with("KHR_materials_")
            || name.contains("_texture_")
    };
    match reader.root.extensions_required.iter().find(|name| !may_be_missing(name)) {
        None => Ok(()),
        Some(name) => {
            let hint = "write the file again without that extension";
            let error = reader.error("extensionsRequired", format!("found {name:.100?}, which is not read"));
            Err(error.with_hint(hint))
        }
    }
}
