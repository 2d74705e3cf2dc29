//! Scenes of other renderers become karst documents.
//!
//! One module a format. An importer keeps what has the same meaning, says what it had to leave out or what looks
//! different ([`Note`]), and makes an error only of what cannot be read at all.

mod error;
mod gltf;
mod mitsuba;
mod note;
mod parts;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use karst_core::scene::{AssetSource, Limits};
use serde_json::Value;

pub use error::ConvertError;
pub use note::{Note, NoteKind};

/// A scene of another renderer as a karst document.
#[derive(Debug, Clone, PartialEq)]
pub struct Converted {
    /// The document, in the order of the scene it was made from.
    pub document: Value,
    /// The files that the document names, by path relative to it.
    pub assets: BTreeMap<String, Asset>,
    /// What was left out or looks different, in the order of the scene.
    pub notes: Vec<Note>,
}

impl Converted {
    /// The document as text that people can read, with a line break at its end.
    pub fn text(&self) -> String {
        text::write(&self.document)
    }

    /// Calls assets by other paths, in the document too. `path` gives the new path of an asset; others keep theirs, with
    /// a number where a new path is in the way.
    pub fn rename_assets(&mut self, path: impl Fn(&str, &Asset) -> Option<String>) {
        let old = std::mem::take(&mut self.assets);
        let mut renamed: BTreeMap<String, String> =
            old.iter().filter_map(|(name, asset)| Some((name.clone(), path(name, asset)?))).collect();
        let mut taken: BTreeSet<String> = renamed.values().cloned().collect();
        for name in old.keys().filter(|name| !renamed.contains_key(*name)).cloned().collect::<Vec<_>>() {
            let (stem, ending) = name.rsplit_once('.').unwrap_or((&name, ""));
            let numbered = (2..).map(|number| format!("{stem}-{number}.{ending}"));
            let free = std::iter::once(name.clone()).chain(numbered).find(|new| taken.insert(new.clone()));
            renamed.insert(name.clone(), free.unwrap_or(name));
        }
        self.assets = old.into_iter().map(|(name, asset)| (renamed[&name].clone(), asset)).collect();
        rename(&mut self.document, &renamed);
    }
}

impl AssetSource for Converted {
    fn len(&self, path: &str) -> Result<u64, io::Error> {
        match self.assets.get(path) {
            Some(Asset::File(file)) => Ok(std::fs::metadata(file)?.len()),
            Some(Asset::Bytes(bytes)) => Ok(bytes.len() as u64),
            None => Err(io::ErrorKind::NotFound.into()),
        }
    }

    fn read(&self, path: &str) -> Result<Vec<u8>, io::Error> {
        match self.assets.get(path) {
            Some(Asset::File(file)) => std::fs::read(file),
            Some(Asset::Bytes(bytes)) => Ok(bytes.clone()),
            None => Err(io::ErrorKind::NotFound.into()),
        }
    }
}

/// Renames the files that a document names.
fn rename(value: &mut Value, renamed: &BTreeMap<String, String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members.iter_mut() {
                let file = matches!(name.as_str(), "file" | "image");
                let new = member.as_str().filter(|_| file).and_then(|old| renamed.get(old));
                match new {
                    Some(new) => *member = Value::from(new.as_str()),
                    None => rename(member, renamed),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| rename(item, renamed)),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
    }
}

/// Where the bytes of an asset are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Asset {
    /// In a file of the foreign scene.
    File(PathBuf),
    /// Here: made from what the scene describes.
    Bytes(Vec<u8>),
}

/// Endings of the files that [`convert`] reads, in lower case without the dot.
pub const EXTENSIONS: [&str; 3] = ["xml", "gltf", "glb"];

/// Whether [`convert`] reads files of this name.
pub fn reads(path: &Path) -> bool {
    extension(path).is_some_and(|found| EXTENSIONS.contains(&found.as_str()))
}

/// Reads a scene of another renderer; its name says which one it is of.
///
/// # Errors
/// Files that are missing, too large or malformed, and references that lead nowhere, with file and line.
pub fn convert(path: &Path) -> Result<Converted, ConvertError> {
    match extension(path).as_deref() {
        Some("xml") => mitsuba::convert(path),
        Some("gltf" | "glb") => gltf::convert(path),
        _ => Err(ConvertError::Unknown { path: path.to_owned() }),
    }
}

/// Reads a glTF scene whose bytes are at hand, JSON or binary, with everything it needs inside; `name` stands in
/// messages. What it becomes stays within `limits`.
///
/// # Errors
/// As for [`convert`]; also where the scene names files beside it.
pub fn convert_gltf(bytes: &[u8], name: &str, limits: &Limits) -> Result<Converted, ConvertError> {
    gltf::read(bytes, name, None, limits)
}

fn extension(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::{Asset, Converted};
    use serde_json::json;

    #[test]
    fn renamed_assets_do_not_meet() {
        let mut converted = Converted {
            document: json!({"meshes": {"a": {"file": "m/a.ply"}, "b": {"file": "m/a-2.ply"}}, "lights": {"image": "t.exr"}}),
            assets: ["m/a.ply", "m/a-2.ply", "t.exr"]
                .map(|name| (name.to_owned(), Asset::Bytes(name.into())))
                .into(),
            notes: Vec::new(),
        };
        converted.rename_assets(|name, _| match name {
            "m/a-2.ply" => Some("m/a.ply".to_owned()),
            "t.exr" => Some("s/t.exr".to_owned()),
            _ => None,
        });
        let meshes = json!({"a": {"file": "m/a-2.ply"}, "b": {"file": "m/a.ply"}});
        assert_eq!(converted.document, json!({"meshes": meshes, "lights": {"image": "s/t.exr"}}));
        assert_eq!(converted.assets["m/a.ply"], Asset::Bytes("m/a-2.ply".into()));
        assert_eq!(converted.assets["m/a-2.ply"], Asset::Bytes("m/a.ply".into()));
        assert_eq!(converted.assets["s/t.exr"], Asset::Bytes("t.exr".into()));
    }
}
