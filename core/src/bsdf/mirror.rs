//! Owns the perfect mirror.

use super::BsdfSample;
use super::microfacet::mirrored;
use glam::Vec3;

/// Reflects every ray of the outside into one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mirror {
    /// Share of the light that is reflected, 0..1 by channel.
    pub reflectance: Vec3,
}

impl Mirror {
    pub(super) fn sample(&self, wo: Vec3) -> Option<BsdfSample> {
        (wo.z > 0.0).then(|| BsdfSample::reflected(mirrored(wo), self.reflectance, f32::INFINITY))
    }
}
