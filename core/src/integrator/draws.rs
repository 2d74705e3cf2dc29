//! Owns the random numbers that decide at surfaces, drawn for eight paths at a time.
//!
//! A number depends on its path only, so that drawing it beside others, or for nothing, changes none.

use super::common::may_end;
use super::paths::Paths;
use crate::sampler::{Decision, Sampler};
use crate::scene::Scene;
use glam::Vec2;

/// What decides at a surface; 0 where nothing is to be decided.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Draw {
    /// Which light, of those at a finite distance where others are sampled beside them.
    pub(super) choice: f32,
    /// Point on it.
    pub(super) light: Vec2,
    /// Which lobe.
    pub(super) lobe: f32,
    /// Direction of the lobe.
    pub(super) direction: Vec2,
    /// Whether the path goes on.
    pub(super) roulette: f32,
}

/// What decides at the surfaces of the active paths from `first` on; the last path stands in for those behind it.
#[inline]
pub(super) fn draw_all(scene: &Scene, bounce: u32, paths: &Paths, first: usize) -> [Draw; Sampler::LANES] {
    let last = paths.active.len().saturating_sub(1);
    let samplers =
        std::array::from_fn(|lane| paths.samplers[paths.active[(first + lane).min(last)] as usize]);
    let number = |is_asked: bool, decision| {
        if is_asked { Sampler::get_1d_of_all(&samplers, decision) } else { Default::default() }
    };
    let choice = number(!scene.lights().is_alone(), Decision::LightChoice(bounce));
    let light = Sampler::get_2d_of_all(&samplers, Decision::LightPoint(bounce));
    let lobe = number(scene.has_lobes(), Decision::Lobe(bounce));
    let direction = Sampler::get_2d_of_all(&samplers, Decision::Direction(bounce));
    let roulette = number(may_end(scene, bounce), Decision::Roulette(bounce));
    std::array::from_fn(|lane| Draw {
        choice: choice[lane],
        light: light[lane],
        lobe: lobe[lane],
        direction: direction[lane],
        roulette: roulette[lane],
    })
}
