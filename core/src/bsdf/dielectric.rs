//! Owns glass, smooth or rough.

use super::BsdfSample;
use super::fresnel;
use super::interface::Interface;
use super::microfacet::{Microfacets, mirrored, refract};
use crate::color::luminance;
use glam::{Vec2, Vec3};

/// The interface of two dielectrics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dielectric {
    interface: Interface,
    smooth: bool,
}

impl Dielectric {
    /// An interface with the index of refraction `ior` below, in units of that above, and factors of reflected and
    /// refracted light; without facets it is smooth.
    pub fn new(ior: f32, facets: Option<Microfacets>, reflectance: Vec3, transmittance: Vec3) -> Self {
        let smooth = facets.is_none();
        let facets = facets.unwrap_or_else(|| Microfacets::new(super::Distribution::Ggx, Vec2::ZERO));
        Self { interface: Interface { facets, reflectance, transmittance, eta: ior }, smooth }
    }

    pub(super) fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if self.smooth { (Vec3::ZERO, 0.0) } else { self.interface.scatter(wo, wi) }
    }

    pub(super) fn sample(&self, wo: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        if self.smooth {
            return self.sample_smooth(wo, lobe);
        }
        if let Some(straight) = self.interface.straight(wo) {
            return Some(straight);
        }
        let wi = self.interface.sample(wo, lobe, u)?;
        let (f, pdf) = self.interface.scatter(wo, wi);
        let eta = self.interface.eta_from(wo);
        let eta2 = if wo.z * wi.z < 0.0 { eta * eta } else { 1.0 };
        (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample { wi, weight: f / pdf, pdf, eta2 })
    }

    fn sample_smooth(&self, wo: Vec3, lobe: f32) -> Option<BsdfSample> {
        let Interface { reflectance, transmittance, .. } = self.interface;
        let eta = self.interface.eta_from(wo);
        let (f, cos_t) = fresnel::dielectric(wo.z, eta);
        let (back, through) = (f * luminance(reflectance), (1.0 - f) * luminance(transmittance));
        let sum = back + through;
        if sum <= 0.0 {
            return None;
        }
        if lobe * sum < back {
            return Some(BsdfSample::reflected(mirrored(wo), reflectance * (f * sum / back), f32::INFINITY));
        }
        let eta2 = eta * eta;
        let weight = transmittance * ((1.0 - f) * sum / (through * eta2));
        (through > 0.0).then(|| BsdfSample {
            wi: refract(wo, Vec3::Z, eta, cos_t),
            weight,
            pdf: f32::INFINITY,
            eta2,
        })
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        let (f, _) = fresnel::dielectric(wo.z, self.interface.eta_from(wo));
        self.interface.reflectance * f + self.interface.transmittance * (1.0 - f)
    }

    pub(super) fn facets(&self) -> Microfacets {
        self.interface.facets
    }

    pub(super) fn is_delta(&self) -> bool {
        self.smooth || self.interface.is_straight()
    }
}
