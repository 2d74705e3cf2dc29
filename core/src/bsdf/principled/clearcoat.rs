//! Owns the clearcoat lobe: a colourless coat with a distribution of its own.

use crate::bsdf::fresnel::grazing;
use crate::bsdf::microfacet::{Distribution, Microfacets};
use crate::math::{ln, powf, sin_cos_turn};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Burley's clearcoat: the GTR distribution with exponent 1, masking of a fixed width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Clearcoat {
    /// Squared width.
    alpha2: f32,
    /// `(α² − 1) / (π ln α²)`.
    scale: f32,
}

/// Width of the masking.
const MASKING: f32 = 0.25;

impl Clearcoat {
    pub(super) fn new(gloss: f32) -> Self {
        let alpha = (1.0 - gloss) * 0.1 + gloss * 0.001;
        let alpha2 = alpha * alpha;
        Self { alpha2, scale: (alpha2 - 1.0) / (PI * ln(alpha2)) }
    }

    fn density(self, h: Vec3) -> f32 {
        // 1 + (α² − 1) cos² without its cancellation near the peak.
        self.scale / (h.x * h.x + h.y * h.y + self.alpha2 * h.z * h.z)
    }

    /// Value and density of `wi`; both directions outside, `h` between them at an angle of this cosine.
    pub(super) fn eval(self, wo: Vec3, wi: Vec3, h: Vec3, cos_h: f32) -> (f32, f32) {
        let fresnel = 0.04 + 0.96 * grazing(cos_h);
        let masking = Microfacets::new(Distribution::Ggx, Vec2::splat(MASKING));
        let masked = masking.unmasked(wo) * masking.unmasked(wi);
        let d = self.density(h);
        let pdf = if cos_h > 0.0 { d * h.z / (4.0 * cos_h) } else { 0.0 };
        (fresnel * d * masked / (4.0 * wo.z), pdf)
    }

    /// Chooses a facet in proportion to their density times cosine.
    pub(super) fn sample(self, u: Vec2) -> Vec3 {
        let sin2 = ((powf(self.alpha2, 1.0 - u.x) - self.alpha2) / (1.0 - self.alpha2)).clamp(0.0, 1.0);
        let (sin_phi, cos_phi) = sin_cos_turn(u.y);
        let sin = sin2.sqrt();
        Vec3::new(sin * cos_phi, sin * sin_phi, (1.0 - sin2).sqrt())
    }
}
