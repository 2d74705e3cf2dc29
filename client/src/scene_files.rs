//! Opens scenes: a karst document with the files beside it on disk, or the scene of another renderer, converted.

use std::io;
use std::path::{Path, PathBuf};

use karst_convert::{Asset, ConvertError, Converted, NoteKind};
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

/// A scene that has been read but not checked; a source of the files that its document names.
#[derive(Debug)]
pub struct OpenScene {
    path: PathBuf,
    text: String,
    files: Files,
}

/// Where the files of a document are.
#[derive(Debug)]
enum Files {
    Beside(Folder),
    Converted(Box<Converted>),
}

impl AssetSource for OpenScene {
    fn len(&self, path: &str) -> Result<u64, io::Error> {
        match &self.files {
            Files::Beside(folder) => folder.len(path),
            Files::Converted(converted) => converted.len(path),
        }
    }

    fn read(&self, path: &str) -> Result<Vec<u8>, io::Error> {
        match &self.files {
            Files::Beside(folder) => folder.read(path),
            Files::Converted(converted) => converted.read(path),
        }
    }
}

/// Reads the scene at `path`: a karst document, or by its name the scene of another renderer.
///
/// # Errors
/// The file cannot be read, is no text, is too large, or cannot be converted.
pub fn open_scene(path: &Path, limits: &Limits) -> Result<OpenScene, Error> {
    let open = |text, files| OpenScene { path: path.to_owned(), text, files };
    if karst_convert::reads(path) {
        let converted = karst_convert::convert(path)?;
        return Ok(open(converted.text(), Files::Converted(Box::new(converted))));
    }
    let text = read_document(path, limits)?;
    let root = scene_folder(path);
    let folder = Folder::new(root).map_err(|source| Error::file(root, source))?;
    Ok(open(text, Files::Beside(folder)))
}

impl OpenScene {
    /// The document, checked.
    ///
    /// # Errors
    /// Everything that is wrong with it; of a converted scene, places in the document that `karst convert` writes.
    pub fn document(&self, limits: &Limits) -> Result<Document, Problems> {
        let name = self.path.display();
        let origin = match &self.files {
            Files::Beside(_) => name.to_string(),
            Files::Converted(_) => format!("{name} (converted)"),
        };
        Document::parse(&self.text, &origin, limits)
    }

    /// What a converted scene lacks or shows otherwise.
    pub fn notes(&self) -> &[karst_convert::Note] {
        match &self.files {
            Files::Beside(_) => &[],
            Files::Converted(converted) => &converted.notes,
        }
    }

    /// Number of things that the document lacks.
    pub fn lacks(&self) -> usize {
        self.notes().iter().filter(|note| note.kind == NoteKind::Untranslated).count()
    }

    /// The document with the bytes of all files that it names, hashed.
    ///
    /// # Errors
    /// The document is wrong; files that it names cannot be read or lie outside its folder.
    pub fn hashed(&self) -> Result<SceneFiles, Error> {
        let document = self.document(&Limits::default()).map_err(|problems| scene_error(&problems))?;
        let mut problems = Problems::default();
        let mut files = Vec::new();
        for asset in document.assets() {
            match self.blob(&asset.path) {
                Ok(blob) => files.push((asset.path.clone(), blob)),
                Err(message) => problems.push(asset.problem(message)),
            }
        }
        problems.or(()).map_err(|problems| scene_error(&problems))?;
        Ok(SceneFiles { name: scene_name(&self.path), document: Blob::of_bytes(self.text.as_bytes()), files })
    }

    fn blob(&self, path: &str) -> Result<Blob, String> {
        let hashed = |file: &Path| Blob::of_file(file).map_err(|error| error.to_string());
        match &self.files {
            Files::Beside(folder) => {
                folder.len(path).map_err(|error| error.to_string())?;
                hashed(&scene_folder(&self.path).join(path))
            }
            Files::Converted(converted) => match converted.assets.get(path) {
                Some(Asset::File(file)) => hashed(file),
                Some(Asset::Bytes(bytes)) => Ok(Blob::of_bytes(bytes)),
                None => Err("does not exist".to_owned()),
            },
        }
    }
}

impl From<ConvertError> for Error {
    fn from(error: ConvertError) -> Self {
        match error {
            ConvertError::File { path, source } => Self::File { path, source },
            other @ (ConvertError::Unknown { .. } | ConvertError::Scene { .. }) => {
                Self::Scene(other.to_string())
            }
        }
    }
}

/// Reads and checks the scene at `path` and hashes the files that it names.
///
/// # Errors
/// As [`open_scene`] and [`OpenScene::hashed`].
pub fn read_scene(path: &Path) -> Result<SceneFiles, Error> {
    open_scene(path, &Limits::default())?.hashed()
}

/// The folder that a document's asset paths start from.
fn scene_folder(path: &Path) -> &Path {
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
fn read_document(path: &Path, limits: &Limits) -> Result<String, Error> {
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
