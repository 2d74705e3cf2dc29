//! Owns the names of asset files: which paths a document may name, and where it names them.

use crate::scene::document::cursor::Cursor;
use crate::scene::document::problem::Problem;

/// What an asset file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AssetKind {
    /// Triangles: OBJ or PLY.
    Mesh,
    /// Texels: PNG, JPEG, EXR or Radiance HDR.
    Image,
}

impl AssetKind {
    /// What a file of this kind is, in words.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Mesh => "a mesh file (.obj or .ply)",
            Self::Image => "an image file (.png, .jpg, .jpeg, .exr or .hdr)",
        }
    }

    const fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Mesh => &["obj", "ply"],
            Self::Image => &["png", "jpg", "jpeg", "exr", "hdr"],
        }
    }
}

/// An asset file that a document names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AssetRef {
    /// Path relative to the document, `/` between its parts, none of them `..`.
    pub path: String,
    /// What the file holds.
    pub kind: AssetKind,
    /// Where the document names it first, with an empty message.
    pub(super) place: Problem,
}

impl AssetRef {
    /// What is wrong with the file, at the place in the document that names it.
    pub fn problem(&self, message: impl Into<String>) -> Problem {
        Problem { message: format!("file {:?}: {}", self.path, message.into()), ..self.place.clone() }
    }
}

/// Longest path of a file, in bytes.
const MAX_PATH: usize = 512;

/// Takes the path of an asset and notes it in the context, or reports what is wrong with it.
pub(super) fn decode_path(at: &Cursor<'_>, path: &str, kind: AssetKind) -> Option<String> {
    if let Some(wrong) = wrong_with(path) {
        let hint = "put the file in the document's folder or below and name it relative to the document";
        at.problem(format!("found {}, {wrong}", at.found()), Some(hint.to_owned()));
        return None;
    }
    let extension =
        path.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase()).unwrap_or_default();
    if !kind.extensions().contains(&extension.as_str()) {
        at.expected(&format!("the path of {}", kind.words()));
        return None;
    }
    let place = at.context.source.problem(at.node.start, at.path.text(), String::new(), None);
    at.context.assets.borrow_mut().push(AssetRef { path: path.to_owned(), kind, place });
    Some(path.to_owned())
}

/// Why a path is not that of a file beside the document, if it is not.
fn wrong_with(path: &str) -> Option<&'static str> {
    let drive = path.as_bytes().get(1) == Some(&b':');
    if path.is_empty() || path.len() > MAX_PATH {
        Some("a path has 1 to 512 bytes")
    } else if path.chars().any(char::is_control) {
        Some("a path has no control characters")
    } else if path.contains('\\') {
        Some("the parts of a path are separated by '/'")
    } else if path.starts_with('/') || drive {
        Some("a path is relative to the document")
    } else if path.split('/').any(|part| matches!(part, "" | "." | "..")) {
        Some("no part of a path is empty, '.' or '..'")
    } else {
        None
    }
}
