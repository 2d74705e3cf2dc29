//! Owns the diffuse lobe: retro-reflection by roughness, blended with a flattened lobe.

use crate::bsdf::fresnel::grazing;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// Burley's diffuse lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Diffuse {
    pub(super) base: Vec3,
    pub(super) roughness: f32,
    pub(super) subsurface: f32,
}

impl Diffuse {
    /// Both directions outside; `cos_h` is the cosine between `wi` and the half vector.
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, cos_h: f32) -> Vec3 {
        let rough = self.roughness * cos_h * cos_h;
        let (out, inward) = (grazing(wo.z), grazing(wi.z));
        let faded = |at_grazing: f32| (1.0 + (at_grazing - 1.0) * out) * (1.0 + (at_grazing - 1.0) * inward);
        let base = faded(0.5 + 2.0 * rough) * wi.z;
        // cos θi / (cos θo + cos θi) stays below 1 where the sum alone would blow up.
        let flat = 1.25 * (faded(rough) * (wi.z / (wo.z + wi.z) - 0.5 * wi.z) + 0.5 * wi.z);
        self.base * (FRAC_1_PI * (base + (flat - base) * self.subsurface))
    }
}
