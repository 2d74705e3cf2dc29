//! Owns the asset files of a document: meshes and images, each read once and within the limits.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::mesh;
use crate::scene::document::{AssetKind, AssetRef, Document, Limits, Problems};
use crate::scene::object::PreparedMesh;
use crate::scene::trees::Kept;
use crate::texture::Image;

/// Where asset files come from; paths are those of [`AssetRef::path`].
pub trait AssetSource: Sync {
    /// Size of a file in bytes.
    ///
    /// # Errors
    /// Those of the source, [`io::ErrorKind::NotFound`] where there is no such file.
    fn len(&self, path: &str) -> Result<u64, io::Error>;

    /// The bytes of a file.
    ///
    /// # Errors
    /// As for [`AssetSource::len`].
    fn read(&self, path: &str) -> Result<Vec<u8>, io::Error>;
}

/// The files in and below one folder.
#[derive(Debug, Clone)]
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    /// A source that reads below `root`.
    ///
    /// # Errors
    /// When the folder is not there or cannot be entered.
    pub fn new(root: impl AsRef<Path>) -> Result<Self, io::Error> {
        Ok(Self { root: root.as_ref().canonicalize()? })
    }

    /// The place of a file after all symbolic links, which must be in the folder.
    fn resolve(&self, path: &str) -> Result<PathBuf, io::Error> {
        let found = self.root.join(path).canonicalize()?;
        if !found.starts_with(&self.root) {
            return Err(io::Error::new(
                io::ErrorKind::PermissionDenied,
                "leads out of the document's folder",
            ));
        }
        if !found.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "is not a regular file"));
        }
        Ok(found)
    }
}

impl AssetSource for Folder {
    fn len(&self, path: &str) -> Result<u64, io::Error> {
        Ok(self.resolve(path)?.metadata()?.len())
    }

    fn read(&self, path: &str) -> Result<Vec<u8>, io::Error> {
        std::fs::read(self.resolve(path)?)
    }
}

/// The asset files of a document, read and checked.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    meshes: BTreeMap<String, Arc<PreparedMesh>>,
    images: BTreeMap<String, Arc<Image>>,
    /// The tree over their triangles in the last frame that was compiled.
    kept: Arc<Kept>,
}

/// What is left of the limits while files are loaded.
#[derive(Debug)]
struct Budget {
    triangles: u64,
    texels: u64,
}

impl Assets {
    /// Reads every file that a document names, once.
    ///
    /// # Errors
    /// Files that are missing, too large or malformed, at the places in the document that name them; the sizes
    /// of all files are checked before the first is read.
    pub fn load(document: &Document, source: &dyn AssetSource, limits: &Limits) -> Result<Self, Problems> {
        let mut problems = Problems::default();
        check_sizes(document.assets(), source, limits, &mut problems);
        problems.or(())?;
        let (mut problems, mut assets) = (Problems::default(), Self::default());
        let mut left = Budget { triangles: limits.max_triangles, texels: limits.max_texels };
        for asset in document.assets() {
            if let Err(message) = assets.add(asset, source, &mut left) {
                problems.push(asset.problem(message));
            }
        }
        problems.or(assets)
    }

    fn add(&mut self, asset: &AssetRef, source: &dyn AssetSource, left: &mut Budget) -> Result<(), String> {
        let bytes = source.read(&asset.path).map_err(|error| reading(&error))?;
        match asset.kind {
            AssetKind::Mesh => {
                let mesh =
                    mesh::read(&bytes, &asset.path, left.triangles).map_err(|error| error.to_string())?;
                left.triangles -= mesh.triangles.len() as u64;
                let prepared = PreparedMesh::new(mesh).map_err(|error| error.to_string())?;
                self.meshes.insert(asset.path.clone(), Arc::new(prepared));
            }
            AssetKind::Image => {
                let image = Image::read(&bytes, left.texels).map_err(|error| error.to_string())?;
                left.texels -= u64::from(image.width()) * u64::from(image.height());
                self.images.insert(asset.path.clone(), Arc::new(image));
            }
        }
        Ok(())
    }

    /// What the last frame may leave to the next.
    pub(super) fn kept(&self) -> &Kept {
        &self.kept
    }

    /// The mesh in a file that the document names.
    pub fn mesh(&self, path: &str) -> Option<Arc<PreparedMesh>> {
        self.meshes.get(path).cloned()
    }

    /// The image in a file that the document names.
    pub fn image(&self, path: &str) -> Option<Arc<Image>> {
        self.images.get(path).cloned()
    }
}

/// Reports missing files, and the file with which all files together pass the limit.
fn check_sizes(assets: &[AssetRef], source: &dyn AssetSource, limits: &Limits, problems: &mut Problems) {
    let (mut total, limit) = (0_u64, limits.max_asset_bytes);
    for asset in assets {
        match source.len(&asset.path) {
            Err(error) => problems.push(asset.problem(reading(&error))),
            Ok(bytes) => {
                let before = total;
                total = total.saturating_add(bytes);
                if before <= limit && total > limit {
                    let message = format!(
                        "has {bytes} bytes, with the files before it {total}, the limit is {limit} for all together"
                    );
                    problems.push(asset.problem(message));
                }
            }
        }
    }
}

fn reading(error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound { "does not exist".to_owned() } else { error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::{AssetSource, Assets, Folder};
    use crate::scene::document::{Document, Limits};
    use std::fs;
    use std::path::Path;

    const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    fn document(files: &[&str]) -> Document {
        let meshes: Vec<String> =
            files.iter().enumerate().map(|(i, file)| format!("\"m{i}\":{{\"file\":\"{file}\"}}")).collect();
        let text = format!(
            "{{\"version\":1,\"camera\":{{\"type\":\"perspective\",\"vfov\":40}},\"film\":{{\"width\":8,\"height\":6}},\n\
             \"meshes\":{{{}}}}}",
            meshes.join(",")
        );
        Document::parse(&text, "scene.json", &Limits::default()).unwrap()
    }

    fn load(root: &Path, files: &[&str], limits: &Limits) -> Result<Assets, String> {
        Assets::load(&document(files), &Folder::new(root).unwrap(), limits)
            .map_err(|problems| problems.to_string())
    }

    #[test]
    fn files_are_read_once_and_checked() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.obj"), MESH).unwrap();
        fs::write(folder.path().join("bad.obj"), MESH.replace("f 1", "f 7")).unwrap();
        let limits = Limits::default();
        let assets = load(folder.path(), &["a.obj", "a.obj"], &limits).unwrap();
        assert_eq!(assets.mesh("a.obj").unwrap().mesh.triangles, [[0, 1, 2]]);
        assert!(assets.mesh("b.obj").is_none() && assets.image("a.obj").is_none());
        for (limits, files, expected) in [
            (
                &limits,
                &["a.obj", "b.obj", "c.obj"][..],
                "scene.json:2:46: meshes.m1.file: file \"b.obj\": does not exist\n\
                scene.json:2:68: meshes.m2.file: file \"c.obj\": does not exist",
            ),
            (
                &limits,
                &["a.obj", "bad.obj"],
                "scene.json:2:46: meshes.m1.file: file \"bad.obj\": line 4: found the index 7, \
                the file has 3 vertices, counted from 1",
            ),
            (
                &Limits { max_asset_bytes: 50, ..limits.clone() },
                &["a.obj", "bad.obj"],
                "scene.json:2:46: meshes.m1.file: \
                file \"bad.obj\": has 32 bytes, with the files before it 64, the limit is 50 for all together",
            ),
            (
                &Limits { max_triangles: 0, ..limits.clone() },
                &["a.obj"],
                "scene.json:2:24: meshes.m0.file: file \"a.obj\": \
                has 1 triangles, 0 are left of the limit for all meshes",
            ),
        ] {
            assert_eq!(load(folder.path(), files, limits).unwrap_err(), expected);
        }
    }

    #[test]
    fn nothing_outside_the_folder_is_read() {
        let outside = tempfile::tempdir().unwrap();
        fs::write(outside.path().join("a.obj"), MESH).unwrap();
        fs::create_dir(outside.path().join("in")).unwrap();
        let inside = outside.path().join("in");
        fs::create_dir(inside.join("folder.obj")).unwrap();
        std::os::unix::fs::symlink(outside.path().join("a.obj"), inside.join("link.obj")).unwrap();
        std::os::unix::fs::symlink(outside.path(), inside.join("up")).unwrap();
        fs::write(inside.join("real.obj"), MESH).unwrap();
        std::os::unix::fs::symlink(inside.join("real.obj"), inside.join("within.obj")).unwrap();
        let source = Folder::new(&inside).unwrap();
        assert_eq!(source.len("within.obj").unwrap(), 32);
        for path in ["link.obj", "up/a.obj", "../a.obj"] {
            let error = source.read(path).unwrap_err().to_string();
            assert_eq!(error, "leads out of the document's folder", "{path}");
        }
        assert_eq!(source.read("folder.obj").unwrap_err().to_string(), "is not a regular file");
        assert!(Folder::new(outside.path().join("none")).is_err());
    }
}
