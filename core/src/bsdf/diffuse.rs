//! Owns Lambert's law.

use super::BsdfSample;
use crate::warp::{hemisphere_cosine, hemisphere_cosine_pdf};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// The same radiance in all directions of the outside: `f = reflectance / π`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Diffuse {
    /// Share of the light that is scattered, 0..1 by channel.
    pub reflectance: Vec3,
}

impl Diffuse {
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wo.z <= 0.0 || wi.z <= 0.0 { Vec3::ZERO } else { self.reflectance * (FRAC_1_PI * wi.z) }
    }

    #[expect(clippy::unused_self, reason = "the density of every model has the same shape")]
    pub(super) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z <= 0.0 { 0.0 } else { hemisphere_cosine_pdf(wi.z) }
    }

    pub(super) fn sample(&self, wo: Vec3, _: f32, u: Vec2) -> Option<BsdfSample> {
        let wi = hemisphere_cosine(u);
        let pdf = hemisphere_cosine_pdf(wi.z);
        (wo.z > 0.0 && pdf > 0.0).then_some(BsdfSample::reflected(wi, self.reflectance, pdf))
    }

    pub(super) fn albedo(&self, _: Vec3) -> Vec3 {
        self.reflectance
    }

    #[expect(clippy::unused_self, reason = "the question to every model has the same shape")]
    pub(super) fn is_delta(&self) -> bool {
        false
    }
}
