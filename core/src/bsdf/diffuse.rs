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
    pub(super) fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        (self.reflectance * (FRAC_1_PI * wi.z), hemisphere_cosine_pdf(wi.z))
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let wi = hemisphere_cosine(u);
        let pdf = hemisphere_cosine_pdf(wi.z);
        (wo.z > 0.0 && pdf > 0.0).then_some(BsdfSample::reflected(wi, self.reflectance, pdf))
    }
}
