//! Owns panes of glass too thin to bend light.

use super::BsdfSample;
use super::fresnel;
use super::microfacet::mirrored;
use crate::color::luminance;
use glam::{Vec2, Vec3};

/// Two interfaces in one: light is reflected, or passes straight through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThinDielectric {
    /// Index of refraction of the pane, in units of that outside.
    pub ior: f32,
    /// Factor of reflected light.
    pub reflectance: Vec3,
    /// Factor of light that passes.
    pub transmittance: Vec3,
}

impl ThinDielectric {
    /// Share that is reflected, with all the reflections between the two faces: R + T²R/(1 − R²) = 2R/(1 + R).
    fn reflected(&self, wo: Vec3) -> f32 {
        let (r, _) = fresnel::dielectric(wo.z, self.ior);
        2.0 * r / (1.0 + r)
    }

    pub(super) fn sample(&self, wo: Vec3, lobe: f32, _: Vec2) -> Option<BsdfSample> {
        let r = self.reflected(wo);
        let (back, through) = (r * luminance(self.reflectance), (1.0 - r) * luminance(self.transmittance));
        let sum = back + through;
        if lobe * sum < back {
            let weight = self.reflectance * (r * sum / back);
            return Some(BsdfSample::reflected(mirrored(wo), weight, f32::INFINITY));
        }
        (through > 0.0).then(|| {
            let weight = self.transmittance * ((1.0 - r) * sum / through);
            BsdfSample::reflected(-wo, weight, f32::INFINITY)
        })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        let r = self.reflected(wo);
        self.reflectance * r + self.transmittance * (1.0 - r)
    }
}
