//! Owns the path tracer: waves of paths, advanced stage by stage.
//!
//! A wave holds some thousand paths as arrays. Each stage is a loop over the paths that are still alive: camera,
//! then for every surface intersect, emit, shade, shadow rays. A path's value depends on its own numbers only, never
//! on its neighbours in the wave, so that any grouping gives the same bits.

mod common;
mod draws;
mod media;
mod paths;
mod stage;
mod stages;
mod vertex;

pub use paths::{Feature, Paths};
pub use stage::{Stage, StageObserver, Unobserved};

use crate::film::Counters;
use crate::sampler::Replicate;
use crate::scene::Scene;
use std::ops::Range;

/// Samples to trace together: some sample indices of one replicate for some pixels.
#[derive(Debug, Clone)]
pub struct Wave<'a> {
    /// Pixels of the frame.
    pub pixels: &'a [[u32; 2]],
    /// Which half of their samples.
    pub replicate: Replicate,
    /// Which samples of it.
    pub samples: Range<u32>,
}

/// Traces a wave: afterwards `paths` holds radiance and features, sample by sample, pixel by pixel within.
///
/// The estimator is unidirectional path tracing with next-event estimation: light found by sampling a light and light
/// found by scattering are weighed by the power heuristic (Veach 1997, section 9.2). A path's `beta` is the product of
/// all its weights so far, the light that it then finds still missing.
///
/// What marching cost adds up in `paths` until [`Paths::take_tally`]. `observer` is told which stage begins.
pub fn trace(
    scene: &Scene,
    wave: &Wave<'_>,
    paths: &mut Paths,
    counters: &mut Counters,
    observer: &mut dyn StageObserver,
) {
    observer.begin(Stage::Camera);
    stages::camera(scene, wave, paths);
    counters.samples += paths.len() as u64;
    if scene.has_media() {
        trace_through(scene, paths, counters, observer);
        return;
    }
    for bounce in 0..scene.max_depth() {
        observer.begin(Stage::Intersect);
        stages::intersect(scene, bounce, paths, counters);
        observer.begin(Stage::Emit);
        stages::emit(scene, bounce, paths);
        if bounce + 1 == scene.max_depth() {
            stages::observe(scene, paths);
            break;
        }
        if paths.active.is_empty() {
            break;
        }
        observer.begin(Stage::Shade);
        stages::shade(scene, bounce, paths);
        observer.begin(Stage::Shadow);
        stages::shadow(scene, paths, counters);
    }
}

/// The rest of [`trace`] in a scene with media.
fn trace_through(
    scene: &Scene,
    paths: &mut Paths,
    counters: &mut Counters,
    observer: &mut dyn StageObserver,
) {
    paths.enter(scene.camera_interiors());
    for bounce in 0..scene.max_depth() {
        observer.begin(Stage::Intersect);
        stages::nearest(scene, bounce, paths, counters);
        observer.begin(Stage::Media);
        media::advance(scene, bounce, paths);
        if bounce + 1 == scene.max_depth() || (paths.active.is_empty() && paths.places.is_empty()) {
            observer.begin(Stage::Shadow);
            media::shadow(scene, paths, counters);
            break;
        }
        observer.begin(Stage::Shade);
        stages::scatter_all::<true>(scene, bounce, paths);
        observer.begin(Stage::Media);
        media::scatter(scene, bounce, paths);
        observer.begin(Stage::Shadow);
        media::shadow(scene, paths, counters);
        if paths.active.is_empty() {
            break;
        }
    }
}
