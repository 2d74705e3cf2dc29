//! Owns the perfect mirror.

use super::BsdfSample;
use super::microfacet::mirrored;
use glam::{Vec2, Vec3};

/// Reflects every ray of the outside into one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirror {
    /// Share of the light that is reflected, 0..1 by channel.
    pub reflectance: Vec3,
}

#[expect(clippy::unused_self, reason = "the functions of every model have the same shape")]
impl Mirror {
    pub(super) fn eval(&self, _: Vec3, _: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    pub(super) fn pdf(&self, _: Vec3, _: Vec3) -> f32 {
        0.0
    }

    pub(super) fn sample(&self, wo: Vec3, _: f32, _: Vec2) -> Option<BsdfSample> {
        (wo.z > 0.0).then(|| BsdfSample::reflected(mirrored(wo), self.reflectance, f32::INFINITY))
    }

    pub(super) fn albedo(&self, _: Vec3) -> Vec3 {
        self.reflectance
    }

    pub(super) fn is_delta(&self) -> bool {
        true
    }
}
