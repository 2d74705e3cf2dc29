//! Owns the metal lobe: GGX facets under Schlick's Fresnel term.

use crate::bsdf::fresnel::schlick;
use crate::bsdf::microfacet::Microfacets;
use glam::Vec3;

/// Burley's specular lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Metal {
    pub(super) facets: Microfacets,
    /// Colour at normal incidence.
    pub(super) c0: Vec3,
}

impl Metal {
    /// Both directions outside, `h` between them at an angle of this cosine.
    pub(super) fn eval(&self, wo: Vec3, wi: Vec3, h: Vec3, cos_h: f32) -> Vec3 {
        schlick(self.c0, cos_h) * self.facets.reflected(wo, wi, h)
    }
}
