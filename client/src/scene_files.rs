//! Reads a scene document and finds the asset files that it names, beside it on disk.

use std::path::{Path, PathBuf};

use karst_core::scene::{AssetSource, Document, Folder, Limits, Problems};

use crate::{Blob, Error};

/// A scene document and its asset files, ready to be uploaded.
#[derive(Clone, Debug)]
pub struct SceneFiles {
    /// For people: the file's name without its ending, or its folder's when that is just `scene`.
    pub name: String,
    /// The document.
    pub document: Blob,
    /// Each asset path as the document writes it, with its bytes.
    pub files: Vec<(String, Blob)>,
}

impl SceneFiles {
    /// The document and all files.
    pub fn blobs(&self) -> Vec<Blob> {
        std::iter::once(&self.document).chain(self.files.iter().map(|(_, blob)| blob)).cloned().collect()
    }
}

/// Reads and checks the document at `path` and hashes the files that it names.
///
/// # Errors
/// The document cannot be read or is wrong; files that it names cannot be read or lie outside its folder.
pub fn read_scene(path: &Path) -> Result<SceneFiles, Error> {
    let text = read_document(path, &Limits::default())?;
    let document = Document::parse(&text, &path.display().to_string(), &Limits::default())
        .map_err(|problems| scene_error(&problems))?;
    let root = scene_folder(path);
    let folder = Folder::new(root).map_err(|source| Error::file(root, source))?;
    let mut problems = Problems::default();
    let mut files = Vec::new();
    for asset in document.assets() {
        let blob = folder
            .len(&asset.path)
            .map_err(|error| error.to_string())
            .and_then(|_| Blob::of_file(&root.join(&asset.path)).map_err(|error| error.to_string()));
        match blob {
            Ok(blob) => files.push((asset.path.clone(), blob)),
            Err(message) => problems.push(asset.problem(message)),
        }
    }
    problems.or(()).map_err(|problems| scene_error(&problems))?;
    Ok(SceneFiles { name: scene_name(path), document: Blob::of_bytes(text.as_bytes()), files })
}

/// The folder that a document's asset paths start from.
pub fn scene_folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// All problems of a scene as one error.
pub fn scene_error(problems: &Problems) -> Error {
    Error::Scene(problems.to_string())
}

/// The text of a document that is not over the limit.
///
/// # Errors
/// The file cannot be read, is not text, or is too large.
pub fn read_document(path: &Path, limits: &Limits) -> Result<String, Error> {
    let failed = |source| Error::file(path, source);
    let size = std::fs::metadata(path).map_err(failed)?.len();
    let limit = limits.max_document_bytes;
    if size > limit {
        return Err(Error::Usage(format!(
            "{}: found {size} bytes, expected at most {limit}",
            path.display()
        )));
    }
    std::fs::read_to_string(path).map_err(failed)
}

fn scene_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    let absolute = std::path::absolute(path).unwrap_or_else(|_| PathBuf::from(path));
    let folder = absolute.parent().and_then(Path::file_name);
    let name = if stem == "scene" { folder.unwrap_or(stem) } else { stem };
    name.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::scene_name;
    use std::path::Path;

    #[test]
    fn a_scene_is_named_after_its_file_or_folder() {
        assert_eq!(scene_name(Path::new("/a/cave.json")), "cave");
        assert_eq!(scene_name(Path::new("/a/cave/scene.json")), "cave");
    }
}
