//! Owns the random numbers that decide at surfaces, drawn for eight paths at a time.
//!
//! A number depends on its path only, so that drawing it beside others, or for nothing, changes none.

use super::paths::Paths;
use crate::sampler::{Decision, Sampler};
use crate::scene::Scene;
use glam::Vec2;

/// What decides at a surface; 0 where nothing is to be decided.
#[derive(Debug, Clone, Copy)]
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

/// What decides at the surfaces of eight paths.
#[derive(Default)]
pub(super) struct Draws {
    choice: [f32; Self::LANES],
    light: [Vec2; Self::LANES],
    lobe: [f32; Self::LANES],
    direction: [Vec2; Self::LANES],
    roulette: [f32; Self::LANES],
}

impl Draws {
    /// Number of paths.
    pub(super) const LANES: usize = Sampler::LANES;

    /// Those of the active paths from `first` on. Behind the last of them it stands in for others.
    #[inline]
    pub(super) fn new(scene: &Scene, bounce: u32, paths: &Paths, first: usize) -> Self {
        let last = paths.active.len().saturating_sub(1);
        let samplers =
            std::array::from_fn(|lane| paths.samplers[paths.active[(first + lane).min(last)] as usize]);
        let number = |is_asked: bool, decision| {
            if is_asked { Sampler::get_1d_of_all(&samplers, decision) } else { Default::default() }
        };
        Self {
            choice: number(!scene.lights().is_alone(), Decision::LightChoice(bounce)),
            light: Sampler::get_2d_of_all(&samplers, Decision::LightPoint(bounce)),
            lobe: number(scene.has_lobes(), Decision::Lobe(bounce)),
            direction: Sampler::get_2d_of_all(&samplers, Decision::Direction(bounce)),
            roulette: number(bounce + 1 >= scene.roulette_depth(), Decision::Roulette(bounce)),
        }
    }

    /// Of the path in a lane.
    #[inline]
    pub(super) fn of(&self, lane: usize) -> Draw {
        Draw {
            choice: self.choice[lane],
            light: self.light[lane],
            lobe: self.lobe[lane],
            direction: self.direction[lane],
            roulette: self.roulette[lane],
        }
    }
}
