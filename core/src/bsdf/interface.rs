//! Owns the rough interface of two dielectrics: reflection and refraction at microfacets, from both sides.

use super::BsdfSample;
use super::fresnel::dielectric;
use super::microfacet::{Half, Microfacets, reflect, refract};
use crate::color::luminance;
use glam::{Vec2, Vec3};

/// Microfacets between two dielectrics (Walter et al. 2007), with a colour for either way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interface {
    pub(super) facets: Microfacets,
    /// Factor of reflected light.
    pub(super) reflectance: Vec3,
    /// Factor of refracted light.
    pub(super) transmittance: Vec3,
    /// Index of refraction below, in units of that above.
    pub(super) eta: f32,
}

/// Indices closer to 1 do not refract: the half vector of such a refraction is rounding error.
const STRAIGHT: f32 = 1.0e-3;

impl Interface {
    /// Whether light passes straight through.
    pub(super) fn is_straight(&self) -> bool {
        (self.eta - 1.0).abs() < STRAIGHT
    }

    /// Index of refraction of the other side, in units of that of the side of `wo`.
    pub(super) fn eta_from(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// What a straight passage brings, where there is no refraction.
    pub(super) fn straight(&self, wo: Vec3) -> Option<BsdfSample> {
        self.is_straight().then(|| BsdfSample {
            wi: -wo,
            weight: self.transmittance,
            pdf: f32::INFINITY,
            eta2: 1.0,
        })
    }

    /// Roughly the luminance of what it sends to `wo` under white light.
    pub(super) fn brightness(&self, wo: Vec3) -> f32 {
        let (f, _) = dielectric(wo.z, self.eta_from(wo));
        f * luminance(self.reflectance) + (1.0 - f) * luminance(self.transmittance)
    }

    /// Value and density of `wi`.
    pub(super) fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let sides = wo.z * wi.z;
        if self.is_straight() || sides == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        if sides < 0.0 {
            return self.refract(wo, wi);
        }
        Half::new(wo, wi, 1.0).map_or((Vec3::ZERO, 0.0), |half| self.reflect(wo, wi, half.h))
    }

    /// Value and density of a reflection: both directions on one side, `h` between them.
    pub(super) fn reflect(&self, wo: Vec3, wi: Vec3, h: Vec3) -> (Vec3, f32) {
        if self.is_straight() {
            return (Vec3::ZERO, 0.0);
        }
        let facets = &self.facets;
        // Both cosines are the same but for rounding; near total reflection that would tell the two ways apart.
        let cos = 0.5 * (wo + wi).dot(h).abs();
        let (f, _) = dielectric(cos, self.eta_from(wo));
        let value = f * facets.reflected(wo, wi, h);
        let pdf = if cos > 0.0 { facets.visible_pdf(wo, h) * f / (4.0 * cos) } else { 0.0 };
        (self.reflectance * value, pdf)
    }

    /// Value and density of a refraction: the directions on different sides. The square of the index of refraction in
    /// the solid angle is cancelled by that of the radiance.
    pub(super) fn refract(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let eta = self.eta_from(wo);
        let none = (Vec3::ZERO, 0.0);
        if self.is_straight() {
            return none;
        }
        let Some(Half { h, length }) = Half::new(wo, wi, eta) else { return none };
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        // A facet that one of the directions sees from behind does not refract between them.
        if cos_o * wo.z <= 0.0 || cos_i * wi.z <= 0.0 {
            return none;
        }
        let (f, _) = dielectric(cos_o, eta);
        let facets = &self.facets;
        let masked = facets.unmasked(wo) * facets.unmasked(wi);
        let squared = length * length;
        let value = (1.0 - f) * facets.density(h) * masked * (cos_o * cos_i).abs() / (wo.z.abs() * squared);
        let pdf = (1.0 - f) * facets.visible_pdf(wo, h) * cos_i.abs() * eta * eta / squared;
        (self.transmittance * value, pdf)
    }

    /// Chooses a facet and whether it reflects; `None` when the direction ends on the wrong side.
    pub(super) fn sample(&self, wo: Vec3, choice: f32, u: Vec2) -> Option<Vec3> {
        let h = self.facets.sample_visible(wo, u);
        let eta = self.eta_from(wo);
        let (f, cos_t) = dielectric(wo.dot(h), eta);
        if choice < f {
            let wi = reflect(wo, h);
            return (wi.z * wo.z > 0.0).then_some(wi);
        }
        let wi = refract(wo, h, eta, cos_t);
        (wi.z * wo.z < 0.0).then_some(wi)
    }
}
