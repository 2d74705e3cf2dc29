//! Owns the scenes that come with karst: each one is valid at every frame, compiles, and renders to finite light.

mod support;

use karst_core::scene::{Assets, Document, Folder, Limits, Overrides, Scene};
use std::ops::Range;
use std::path::{Path, PathBuf};
use support::{mean_of, render};

/// Renders the first and the last frame of a scene small, and holds the mean of its light against a range.
fn renders(file: &str, light: &Range<f64>) {
    let limits = Limits::default();
    let path = scenes().join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{file}: {e}"));
    let document = Document::parse(&text, file, &limits).unwrap_or_else(|p| panic!("{p}"));
    let source = Folder::new(path.parent().unwrap_or(&path)).unwrap_or_else(|e| panic!("{file}: {e}"));
    let assets = Assets::load(&document, &source, &limits).unwrap_or_else(|p| panic!("{p}"));
    let mut frames = vec![document.frames().first, document.frames().last];
    frames.dedup();
    for frame in frames {
        let mut description = document.at(frame).unwrap_or_else(|p| panic!("{p}"));
        let small = Overrides { spp: Some(4), size: Some((64, 36)), ..Overrides::default() };
        description.apply(&small, &limits).unwrap_or_else(|p| panic!("{p}"));
        let scene = Scene::build(&description, &assets, frame).unwrap_or_else(|p| panic!("{p}"));
        let film = render(&scene, 32, 2);
        let counters = film.summary().counters;
        assert_eq!((counters.nan_samples, counters.infinite_samples), (0, 0), "{file}");
        let mean = mean_of(&film.picture().color);
        assert!(light.contains(&mean), "{file} frame {frame}: mean {mean}");
    }
}

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

#[test]
fn every_scene_renders() {
    for (file, light) in [
        ("demo/demo.json", 0.01..5.0),
        ("cornell.json", 0.05..2.0),
        ("blend.json", 0.02..2.0),
        ("furnace.json", 0.9..1.1),
        ("cave/cave.json", 0.01..2.0),
    ] {
        renders(file, &light);
    }
}

#[test]
fn every_scene_of_a_distance_function_renders() {
    let folder = std::fs::read_dir(scenes().join("sdf")).unwrap();
    let mut names: Vec<_> = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| Path::new(name).extension().is_some_and(|kind| kind == "json"));
    names.sort();
    assert!(names.len() >= 24, "a scene for every node: {names:?}");
    for name in names {
        renders(&format!("sdf/{name}"), &(0.1..2.0));
    }
}
