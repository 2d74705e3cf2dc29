//! Owns light from all directions.

use super::{LightSample, Target};
use crate::color::luminance;
use crate::math::Aabb;
use crate::warp::{sphere_uniform, sphere_uniform_pdf};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// The same radiance from every direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnvironmentLight {
    /// Radiance, linear Rec.709.
    pub radiance: Vec3,
}

impl EnvironmentLight {
    pub(super) fn sample(&self, u: Vec2) -> LightSample {
        LightSample {
            wi: sphere_uniform(u),
            radiance: self.radiance,
            pdf: self.pdf(),
            target: Target::Infinity,
        }
    }

    /// Density of sampling any direction.
    pub fn pdf(&self) -> f32 {
        sphere_uniform_pdf()
    }

    /// Irradiance of an open horizon.
    pub(super) fn importance(&self) -> f32 {
        luminance(self.radiance) * PI
    }

    pub(super) fn power(&self, scene: &Aabb) -> f32 {
        let r2 = if scene.is_empty() { 1.0 } else { scene.size().length_squared() * 0.25 };
        luminance(self.radiance) * 4.0 * PI * PI * r2
    }
}
