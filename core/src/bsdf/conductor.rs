//! Owns metals, smooth or rough.

use super::BsdfSample;
use super::fresnel;
use super::microfacet::{Half, Microfacets, mirrored};
use glam::{Vec2, Vec3};

/// A metal: reflects by Fresnel's equations for a complex index of refraction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conductor {
    /// Indices of refraction and absorption by colour; without them all light is reflected.
    pub index: Option<(Vec3, Vec3)>,
    /// Factor of reflected light.
    pub reflectance: Vec3,
    /// Its microfacets; without them it is smooth.
    pub facets: Option<Microfacets>,
}

impl Conductor {
    fn fresnel(&self, cos: f32) -> Vec3 {
        self.reflectance * self.index.map_or(Vec3::ONE, |(eta, k)| fresnel::conductor(cos, eta, k))
    }

    pub(super) fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let none = (Vec3::ZERO, 0.0);
        let Some(facets) = &self.facets else { return none };
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return none;
        }
        let Some(half) = Half::new(wo, wi, 1.0) else { return none };
        (self.fresnel(wi.dot(half.h)) * facets.reflected(wo, wi, half.h), facets.reflection_pdf(wo, half.h))
    }

    pub(super) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let Some(facets) = &self.facets else {
            return Some(BsdfSample::reflected(mirrored(wo), self.fresnel(wo.z), f32::INFINITY));
        };
        let wi = facets.sample_reflection(wo, u);
        let (f, pdf) = self.scatter(wo, wi);
        (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample::reflected(wi, f / pdf, pdf))
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.fresnel(wo.z)
    }
}
