//! Owns what is done with the bytes of a foreign file: by the fuzz targets with anything, by a test with the corpora.
//!
//! Every reader may refuse. What it takes must hold: converted scenes are documents, meshes are sound and survive being
//! written, texels can be looked up.

use std::path::PathBuf;
use std::sync::LazyLock;

use karst_convert::{ConvertError, Converted, convert, convert_gltf};
use karst_core::mesh::{self, Mesh};
use karst_core::scene::{Document, Limits};
use karst_core::texture::{ColorSpace, Image};

/// What a file is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    /// A scene document.
    Document,
    /// A scene of Mitsuba.
    Mitsuba,
    /// A mesh as OBJ.
    Obj,
    /// A mesh as PLY.
    Ply,
    /// A scene as glTF, JSON or binary.
    Gltf,
    /// A PNG, JPEG, EXR or HDR image.
    Image,
}

impl Format {
    /// Every format, by the name of its target and of its folder of files.
    #[allow(dead_code, reason = "each target needs one format, the test all of them")]
    pub(crate) const ALL: [(&str, Self); 6] = [
        ("document", Self::Document),
        ("mitsuba", Self::Mitsuba),
        ("obj", Self::Obj),
        ("ply", Self::Ply),
        ("gltf", Self::Gltf),
        ("image", Self::Image),
    ];
}

/// Small enough that every allocation stays below what the fuzzer allows.
fn limits() -> Limits {
    Limits {
        max_document_bytes: 1 << 20,
        max_values: 1 << 16,
        max_names: 1 << 12,
        max_asset_bytes: 1 << 24,
        max_triangles: 1 << 16,
        max_texels: 1 << 20,
        ..Limits::default()
    }
}

/// Reads a file, and checks what was made of it.
///
/// # Panics
/// When a reader took what it should not have.
pub(crate) fn read(format: Format, bytes: &[u8]) {
    match format {
        Format::Document => document(bytes),
        Format::Mitsuba => drop(convert_mitsuba(bytes).map(|scene| converted(&scene))),
        Format::Obj => drop(mesh::read(bytes, "fuzz.obj", limits().max_triangles).map(|mesh| check(&mesh))),
        Format::Ply => drop(mesh::read(bytes, "fuzz.ply", limits().max_triangles).map(|mesh| check(&mesh))),
        Format::Gltf => drop(convert_gltf(bytes, "fuzz.gltf", &limits()).map(|scene| converted(&scene))),
        Format::Image => image(bytes),
    }
}

fn document(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(document) = Document::parse(text, "fuzz.json", &limits()) else { return };
    let frames = document.frames();
    for frame in [frames.first, frames.last] {
        drop(document.at(frame));
    }
}

/// A folder of this process: scenes are read from it, and what they may name lies in it.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("karst-fuzz-{}", std::process::id()));
    let files: [(&str, &[u8]); 4] = [
        ("tri.obj", include_bytes!("corpus/obj/square.obj")),
        // Without normals, which are made.
        ("tri.ply", include_bytes!("corpus/ply/doubles.ply")),
        ("a.png", include_bytes!("corpus/image/rgba.png")),
        ("part.xml", br#"<scene version="3.0.0"><bsdf type="diffuse" id="part"/></scene>"#),
    ];
    let write = |(name, bytes): &(&str, &[u8])| std::fs::write(folder.join(name), bytes);
    let written = std::fs::create_dir_all(&folder).and_then(|()| files.iter().try_for_each(write));
    if let Err(error) = written {
        panic!("{}: {error}", folder.display());
    }
    folder
});

/// Converts a scene of Mitsuba that has `tri.obj`, `tri.ply`, `a.png` and `part.xml` beside it.
pub(crate) fn convert_mitsuba(bytes: &[u8]) -> Result<Converted, ConvertError> {
    // A name for each thread: tests read at the same time.
    let path = FOLDER.join(format!("scene-{:?}.xml", std::thread::current().id()));
    std::fs::write(&path, bytes).map_err(|source| ConvertError::File { path: path.clone(), source })?;
    convert(&path)
}

fn converted(scene: &Converted) {
    let text = scene.document.to_string();
    if let Err(problems) = Document::parse(&text, "fuzz.json", &Limits::default()) {
        panic!("the importer made a document that is none: {problems}\n{text}");
    }
}

fn check(mesh: &Mesh) {
    let vertices = mesh.positions.len();
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert!(mesh.normals.is_empty() || mesh.normals.len() == vertices);
    assert!(mesh.uvs.is_empty() || mesh.uvs.len() == vertices);
    assert!(mesh.triangles.iter().flatten().all(|&index| (index as usize) < vertices));
    let again = match mesh::read(&mesh.to_ply(), "fuzz.ply", limits().max_triangles) {
        Ok(again) => again,
        Err(error) => panic!("a written mesh could not be read: {error}"),
    };
    assert_eq!(&Mesh { dropped: mesh.dropped, ..again }, mesh);
}

fn image(bytes: &[u8]) {
    let Ok(image) = Image::read(bytes, limits().max_texels) else { return };
    let (width, height) = (image.width(), image.height());
    assert!(u64::from(width) * u64::from(height) <= limits().max_texels);
    for (x, y) in [(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)] {
        let (color, alpha) = (image.texel(x, y, ColorSpace::Srgb), image.alpha(x, y));
        assert!(color.is_finite() && alpha.is_finite(), "texel ({x}, {y}): {color} {alpha}");
    }
}
