//! Owns a resolved picture: means instead of sums, as layers over a region.

use super::{FrameSize, Region};
use glam::Vec3;

/// Resolved layers, row by row over `window`.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The full frame.
    pub size: FrameSize,
    /// The part of it that the layers cover.
    pub window: Region,
    /// Radiance, linear Rec.709.
    pub color: Vec<Vec3>,
    /// Albedo of the first surface, 0..1.
    pub albedo: Vec<Vec3>,
    /// Shading normal of the first surface in the world, averaged, so of length up to 1.
    pub normal: Vec<Vec3>,
    /// Distance to the first surface; infinite where there is none.
    pub depth: Vec<f32>,
    /// Samples per pixel.
    pub samples: Vec<f32>,
    /// Estimated relative error, the same over a block; infinite where it is unknown.
    pub error: Vec<f32>,
    /// Evaluations of distance functions per sample; empty where the scene has none.
    pub evaluations: Vec<f32>,
}
