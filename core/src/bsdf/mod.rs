//! Owns how surfaces scatter light: an enum of materials' models, ready at a hit point, in the local frame.
//!
//! `wo` points to where the light goes, `wi` to where it comes from, both away from the surface; z is the shading
//! normal, turned to the side of `wo`. Densities are per solid angle. A model knows nothing of scenes.

mod diffuse;

pub use diffuse::Diffuse;

use glam::{Vec2, Vec3};

/// A material at a point: parameters read, textures looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bsdf {
    /// Lambert's law.
    Diffuse(Diffuse),
}

/// A sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// Where the light comes from, unit length.
    pub wi: Vec3,
    /// `f(wo, wi) · |cos θi| / pdf`.
    pub weight: Vec3,
    /// Density of `wi` over all lobes.
    pub pdf: f32,
}

impl Bsdf {
    /// `f(wo, wi) · |cos θi|`; 0 where nothing is scattered.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Self::Diffuse(b) => b.eval(wo, wi),
        }
    }

    /// Density with which [`Bsdf::sample`] chooses `wi`.
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Self::Diffuse(b) => b.pdf(wo, wi),
        }
    }

    /// Chooses `wi`; `None` when the light is absorbed.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(b) => b.sample(wo, u),
        }
    }

    /// Colour of the surface under white light from all sides, 0..1: the albedo layer.
    pub fn albedo(&self) -> Vec3 {
        match self {
            Self::Diffuse(b) => b.reflectance,
        }
    }
}
