//! Every file of the fuzzers' corpora, and every file that once broke a reader, is read again by every reader.
#![allow(clippy::unwrap_used, reason = "a step that fails is a test that fails")]

#[path = "../../fuzz/readers.rs"]
mod readers;

use std::fs;
use std::path::{Path, PathBuf};

use readers::{Format, convert_mitsuba, read};

fn files(below: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz").join(below);
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .collect();
    files.sort();
    files
}

#[test]
fn corpora_and_past_crashes_are_read_or_refused() {
    let mut all: Vec<PathBuf> = files("crashes");
    assert!(all.len() > 2, "crashes has {} files", all.len());
    for (name, _) in Format::ALL {
        let corpus = files(&format!("corpus/{name}"));
        assert!(corpus.len() >= 3, "corpus/{name} has {} files", corpus.len());
        all.extend(corpus);
    }
    for file in &all {
        let bytes = fs::read(file).unwrap();
        assert!(bytes.len() <= 1 << 16, "{} has {} bytes: keep corpora small", file.display(), bytes.len());
        for (name, format) in Format::ALL {
            let read = || read(format, &bytes);
            assert!(std::panic::catch_unwind(read).is_ok(), "{} as {name}", file.display());
        }
    }
}

/// The corpora show the fuzzers what the readers take: at least one file of each is not refused.
#[test]
fn corpora_have_files_that_are_taken() {
    use karst_convert::convert_gltf;
    use karst_core::scene::{Document, Limits};
    use karst_core::{mesh, texture};

    let limits = Limits::default();
    for (name, format) in Format::ALL {
        let taken = |path: &PathBuf| {
            let bytes = fs::read(path).unwrap();
            match format {
                Format::Document => {
                    std::str::from_utf8(&bytes).is_ok_and(|text| Document::parse(text, "a", &limits).is_ok())
                }
                Format::Mitsuba => convert_mitsuba(&bytes).is_ok(),
                Format::Obj => mesh::read(&bytes, "a.obj", 1 << 16).is_ok(),
                Format::Ply => mesh::read(&bytes, "a.ply", 1 << 16).is_ok(),
                Format::Gltf => convert_gltf(&bytes, "a", &limits).is_ok(),
                Format::Image => texture::Image::read(&bytes, 1 << 20).is_ok(),
            }
        };
        let corpus = files(&format!("corpus/{name}"));
        let refused: Vec<_> = corpus.iter().filter(|path| !taken(path)).collect();
        assert!(refused.len() < corpus.len(), "corpus/{name}: all are refused");
    }
}

/// Scenes find what lies beside them, so that meshes, images and included files are fuzzed too.
#[test]
fn a_scene_of_the_corpus_uses_every_file_beside_it() {
    let bytes =
        fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus/mitsuba/files.xml")).unwrap();
    let found = convert_mitsuba(&bytes).unwrap();
    let names: Vec<&str> = found.assets.keys().map(String::as_str).collect();
    assert_eq!(names, ["meshes/tri-smooth.ply", "meshes/tri.obj", "textures/a.png"]);
    assert!(found.document["materials"]["part"].is_object(), "{}", found.document);
}
