//! Owns the scenes that come with karst: each one is valid at every frame, compiles, and renders to finite light.

mod support;

use karst_core::scene::{Assets, Document, Folder, Limits, Overrides, Scene};
use std::path::Path;
use support::{mean_of, render};

#[test]
fn every_scene_renders() {
    let limits = Limits::default();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    for (file, light) in [
        ("demo/demo.json", 0.01..5.0),
        ("cornell.json", 0.05..2.0),
        ("blend.json", 0.02..2.0),
        ("furnace.json", 0.9..1.1),
    ] {
        let path = root.join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        let document = Document::parse(&text, file, &limits).unwrap_or_else(|p| panic!("{p}"));
        let source = Folder::new(path.parent().unwrap()).unwrap();
        let assets = Assets::load(&document, &source, &limits).unwrap_or_else(|p| panic!("{p}"));
        for frame in [document.frames().first, document.frames().last] {
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
}
