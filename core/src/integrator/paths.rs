//! Owns the state of the paths of a wave, as arrays that are kept from wave to wave.

use super::media::{Piece, Place};
use crate::light::Receiver;
use crate::math::Ray;
use crate::sampler::{Replicate, Sampler, Stream};
use crate::scene::{Hit, Interiors, Marching, Surface, Tally};
use glam::Vec3;

/// The auxiliary layers of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// Albedo of the first surface behind all mirrors and panes, in their colours; 0 where there is none.
    pub albedo: Vec3,
    /// Shading normal of the same surface, towards the path; 0 where there is none.
    pub normal: Vec3,
    /// Distance to the first surface; infinite where there is none.
    pub depth: f32,
    /// Luminance of the lights that are seen, themselves or behind nothing but mirrors and panes.
    pub emission: f32,
}

impl Feature {
    const NONE: Self = Self { albedo: Vec3::ZERO, normal: Vec3::ZERO, depth: f32::INFINITY, emission: 0.0 };
}

/// A shadow ray and what it brings where nothing is in its way.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShadowRay {
    pub(super) path: u32,
    pub(super) ray: Ray,
    pub(super) contribution: Vec3,
    /// Inside of what it begins, in scenes with media.
    pub(super) interiors: Interiors,
}

/// The paths of a wave; every array has one entry for each.
#[derive(Debug, Default)]
pub struct Paths {
    /// Light gathered so far, linear Rec.709.
    pub radiance: Vec<Vec3>,
    /// Auxiliary layers.
    pub features: Vec<Feature>,
    /// Evaluations of distance functions; empty in scenes without any.
    pub evaluations: Vec<u32>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) rays: Vec<Ray>,
    /// Product of the weights of all decisions so far.
    pub(super) beta: Vec<Vec3>,
    /// Density per solid angle with which the last direction was scattered; infinite for those that light sampling
    /// cannot find: camera rays, and behind mirrors.
    pub(super) pdf: Vec<f32>,
    /// Product of the squared indices of refraction that the path has entered by: radiance there is that much denser.
    pub(super) eta2: Vec<f32>,
    /// What the first surface, or the first place in a medium, left of the path's throughput, at most 1.
    pub(super) first: Vec<f32>,
    /// Whether the path has only met mirrors and panes so far.
    pub(super) unseen: Vec<bool>,
    /// Length of the ray before surfaces that it crossed.
    pub(super) crossed: Vec<f32>,
    /// The point that the last direction left from.
    pub(super) receivers: Vec<Receiver>,
    pub(super) hits: Vec<Option<Hit>>,
    /// Surfaces of the active paths, by position in `active`.
    pub(super) surfaces: Vec<Surface>,
    /// Paths that are still alive, in increasing order.
    pub(super) active: Vec<u32>,
    pub(super) shadows: Vec<ShadowRay>,
    /// Whether something is in the way of each shadow ray.
    pub(super) blocked: Vec<bool>,
    /// Inside of what each path is; empty in scenes without media, as are the following.
    pub(super) interiors: Vec<Interiors>,
    /// What of each path arrives at the surface that it has come to, over how often lights are sampled there.
    pub(super) arriving: Vec<Vec3>,
    /// Whether a path was scattered by a medium last.
    pub(super) scattered: Vec<bool>,
    /// Places in media where paths are scattered.
    pub(super) places: Vec<Place>,
    /// The media on the way of one path.
    pub(super) pieces: Vec<Piece>,
    pub(super) marching: Marching,
}

impl Paths {
    /// What marching cost since the last time.
    pub fn take_tally(&mut self) -> Tally {
        std::mem::take(&mut self.marching.tally)
    }

    /// Number of paths of the wave.
    pub fn len(&self) -> usize {
        self.radiance.len()
    }

    /// Whether the wave is empty.
    pub fn is_empty(&self) -> bool {
        self.radiance.is_empty()
    }

    /// Adds the evaluations since the tally said `before` to those of a path, where they are counted.
    pub(super) fn count_evaluations(&mut self, path: usize, before: u64) {
        if let Some(evaluations) = self.evaluations.get_mut(path) {
            *evaluations += (self.marching.tally.evaluations() - before) as u32;
        }
    }

    /// Starts over with `n` paths, `counted` of whose evaluations are counted, keeping the memory.
    pub(super) fn reset(&mut self, n: usize, counted: usize) {
        self.evaluations.clear();
        self.evaluations.resize(counted, 0);
        self.radiance.clear();
        self.radiance.resize(n, Vec3::ZERO);
        self.features.clear();
        self.features.resize(n, Feature::NONE);
        self.beta.clear();
        self.beta.resize(n, Vec3::ONE);
        self.pdf.clear();
        self.pdf.resize(n, f32::INFINITY);
        self.eta2.clear();
        self.eta2.resize(n, 1.0);
        self.first.clear();
        self.first.resize(n, 1.0);
        self.unseen.clear();
        self.unseen.resize(n, true);
        self.crossed.clear();
        self.crossed.resize(n, 0.0);
        self.arriving.clear();
        self.receivers.clear();
        self.receivers.resize(n, Receiver { p: Vec3::ZERO, n: Vec3::ZERO });
        self.hits.clear();
        self.hits.resize(n, None);
        self.rays.clear();
        self.rays.resize(n, Ray::new(Vec3::ZERO, Vec3::Z));
        self.samplers.clear();
        self.samplers.resize(n, Sampler::new(Stream::new(0, 0), [0, 0], Replicate::A, 0));
        self.active.clear();
        self.active.extend(0..n as u32);
    }

    /// Starts over inside of what the camera is.
    pub(super) fn enter(&mut self, interiors: Interiors) {
        let n = self.len();
        self.interiors.clear();
        self.interiors.resize(n, interiors);
        self.scattered.clear();
        self.scattered.resize(n, false);
        self.arriving.resize(n, Vec3::ONE);
    }
}
