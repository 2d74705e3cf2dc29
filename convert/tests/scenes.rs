//! Scenes that others made: each is converted with nothing left out, and the core takes the document.
#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![expect(clippy::print_stdout, reason = "a test that is skipped says why")]

use std::path::{Path, PathBuf};

use karst_convert::{Converted, convert};
use karst_core::scene::{Assets, Document, Limits};

fn scenes() -> Option<Vec<PathBuf>> {
    let Some(folder) = std::env::var_os("KARST_SCENES") else {
        println!("skipped: KARST_SCENES does not say where scenes are");
        return None;
    };
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path().join("scene.xml")).collect();
    found.retain(|path| path.is_file());
    found.sort();
    Some(found)
}

fn converted(path: &Path) -> Converted {
    convert(path).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn nothing_is_left_out() {
    let Some(scenes) = scenes() else { return };
    assert!(scenes.len() >= 15, "found {} scenes", scenes.len());
    for path in scenes {
        let found = converted(&path);
        let notes: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
        assert!(notes.is_empty(), "{}\n{}", path.display(), notes.join("\n"));
    }
}

#[test]
fn the_core_takes_every_document_and_its_files() {
    for path in scenes().unwrap_or_default() {
        let found = converted(&path);
        let limits = Limits::default();
        let document = Document::parse(&found.text(), &path.display().to_string(), &limits)
            .unwrap_or_else(|problems| panic!("{problems}\n{}", found.text()));
        let named: Vec<&str> = document.assets().iter().map(|asset| asset.path.as_str()).collect();
        assert!(
            found.assets.keys().all(|asset| named.contains(&asset.as_str())),
            "{}: a file too many",
            path.display()
        );
        Assets::load(&document, &found, &limits).unwrap_or_else(|problems| panic!("{problems}"));
        document.at(1).unwrap_or_else(|problems| panic!("{problems}"));
    }
}
