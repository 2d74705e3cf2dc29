//! Owns what the core's tests share: scenes from text, rendering, pooled statistics.
#![allow(dead_code, reason = "every test file uses a part of it")]

use glam::Vec3;
use karst_core::film::{Film, Picture};
use karst_core::render::{FrameObserver, render_frame};
use karst_core::scene::{Assets, Document, Folder, Limits, Scene};
use sha2::{Digest, Sha256};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Nobody watches.
#[derive(Debug)]
pub(crate) struct Nobody;

impl FrameObserver for Nobody {}

/// Compiles a frame of a document whose assets lie in `folder`.
pub(crate) fn scene_in(folder: &Path, text: &str, frame: i32) -> Scene {
    let limits = Limits::default();
    let document = Document::parse(text, "test.json", &limits).unwrap_or_else(|p| panic!("{p}"));
    let source = Folder::new(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let assets = Assets::load(&document, &source, &limits).unwrap_or_else(|p| panic!("{p}"));
    let description = document.at(frame).unwrap_or_else(|p| panic!("{p}"));
    Scene::build(&description, &assets, frame).unwrap_or_else(|p| panic!("{p}"))
}

/// Compiles the first frame of a document without assets.
pub(crate) fn scene(text: &str) -> Scene {
    scene_in(Path::new("."), text, 1)
}

/// Renders with a number of threads.
pub(crate) fn render(scene: &Scene, tile_size: u32, threads: usize) -> Film {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap_or_else(|e| panic!("{e}"));
    pool.install(|| render_frame(scene, tile_size, &AtomicBool::new(false), &Nobody))
        .unwrap_or_else(|| panic!("nobody stops it"))
}

/// The SHA-256 of all layers' bits.
pub(crate) fn fingerprint(picture: &Picture) -> String {
    let mut hash = Sha256::new();
    for layer in [&picture.color, &picture.albedo, &picture.normal] {
        for v in layer.iter().flat_map(Vec3::to_array) {
            hash.update(v.to_le_bytes());
        }
    }
    for v in picture.depth.iter().chain(&picture.samples).chain(&picture.error) {
        hash.update(v.to_le_bytes());
    }
    format!("{:x?}", hash.finalize())
}

/// Mean over pixels and channels, and its standard error from the difference of the replicates.
pub(crate) fn pooled_mean(film: &Film) -> (f64, f64) {
    let picture = film.picture();
    let mean = mean_of(&picture.color);
    let rmse = film.summary().rmse.unwrap_or(f64::NAN);
    (mean, rmse / (picture.color.len() as f64).sqrt())
}

/// Mean over pixels and channels.
pub(crate) fn mean_of(colors: &[Vec3]) -> f64 {
    colors.iter().map(|c| f64::from(c.element_sum()) / 3.0).sum::<f64>() / colors.len() as f64
}
