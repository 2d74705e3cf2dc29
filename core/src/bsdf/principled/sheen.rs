//! Owns the sheen lobe, light at grazing angles for cloth.

use crate::bsdf::fresnel::grazing;
use glam::Vec3;

/// Burley's sheen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sheen {
    pub(super) color: Vec3,
}

impl Sheen {
    /// Both directions outside; `cos_h` is the cosine between `wi` and the half vector.
    pub(super) fn eval(&self, wi: Vec3, cos_h: f32) -> Vec3 {
        self.color * (grazing(cos_h) * wi.z)
    }
}
