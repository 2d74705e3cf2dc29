//! Owns plastics: a diffuse base under a dielectric coat.

use super::BsdfSample;
use super::fresnel;
use super::microfacet::{Half, Microfacets, mirrored, refract};
use crate::color::luminance;
use crate::sampler::{Decision, Replicate, Sampler, Stream};
use crate::warp::{hemisphere_cosine, hemisphere_cosine_pdf};
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// A diffuse base under a coat; light that the coat turns back inside is scattered again.
#[derive(Debug, Clone, PartialEq)]
pub struct Plastic {
    /// Share of the light that the base scatters, 0..1 by channel.
    pub diffuse: Vec3,
    /// Factor of light that the coat reflects.
    pub specular: Vec3,
    /// Whether colours saturate by the light that is scattered again.
    pub nonlinear: bool,
    /// The coat.
    pub coat: Arc<Coat>,
}

/// What a coat lets through, computed once for a material.
#[derive(Debug, Clone, PartialEq)]
pub struct Coat {
    ior: f32,
    facets: Option<Microfacets>,
    /// Share of light that gets in from a direction, at evenly spaced cosines from 0 to 1; of a rough coat.
    entering: Vec<f32>,
    /// Share of diffuse light from inside that is turned back.
    turned_back: f32,
}

/// Cosines at which a rough coat's transmittance is tabulated.
const NODES: usize = 64;
/// Samples of each.
const SAMPLES: u32 = 4096;

impl Coat {
    /// A coat with the index of refraction `ior`, in units of that outside; without facets it is smooth.
    pub fn new(ior: f32, facets: Option<Microfacets>) -> Self {
        let Some(rough) = &facets else {
            return Self { ior, facets, entering: Vec::new(), turned_back: diffuse_fresnel(1.0 / ior) };
        };
        let cosine = |node: usize| (node as f32 / (NODES - 1) as f32).max(1.0e-3);
        let entering = (0..NODES).map(|node| transmitted(rough, cosine(node), ior) as f32).collect();
        // The mean of 2 μ R(μ) over the nodes, both ends counted in full: this sum is part of the model as Mitsuba has
        // it, whose pictures these materials come from. It is 1.4 % below the integral.
        let turned_back = (0..NODES)
            .map(|node| {
                let cos = cosine(node);
                2.0 * f64::from(cos) * reflected(rough, cos, 1.0 / ior) / NODES as f64
            })
            .sum::<f64>() as f32;
        Self { ior, facets, entering, turned_back }
    }

    /// Share of the light from a direction of this cosine that gets in; as much gets out.
    fn entering(&self, cos: f32) -> f32 {
        if self.facets.is_none() {
            return 1.0 - fresnel::dielectric(cos, self.ior).0;
        }
        let at = cos.clamp(0.0, 1.0) * (NODES - 1) as f32;
        let low = (at as usize).min(NODES - 2);
        let share = at - low as f32;
        self.entering[low] * (1.0 - share) + self.entering[low + 1] * share
    }
}

/// Share of light from a direction with this cosine that facets refract to the other side and that no facet masks there:
/// with what they reflect it is less than 1, as single scattering has it.
fn transmitted(facets: &Microfacets, cos: f32, ior: f32) -> f64 {
    mean(cos, |wo, u| {
        let h = facets.sample_visible(wo, u);
        let (f, cos_t) = fresnel::dielectric(wo.dot(h), ior);
        let wi = refract(wo, h, ior, cos_t);
        (wi.z < 0.0).then(|| (1.0 - f) * facets.unmasked(wi))
    })
}

/// Directional albedo of the facets' reflection under Fresnel's term, from a direction with this cosine.
fn reflected(facets: &Microfacets, cos: f32, ior: f32) -> f64 {
    mean(cos, |wo, u| {
        let wi = facets.sample_reflection(wo, u);
        let half = Half::new(wo, wi, 1.0).filter(|_| wi.z > 0.0)?;
        let (f, _) = fresnel::dielectric(wo.dot(half.h), ior);
        Some(f * facets.reflected(wo, wi, half.h) / facets.reflection_pdf(wo, half.h))
    })
}

/// Mean weight of samples from a direction with this cosine; `None` weighs nothing.
fn mean(cos: f32, weight: impl Fn(Vec3, Vec2) -> Option<f32>) -> f64 {
    let wo = Vec3::new(((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt(), 0.0, cos);
    let sum: f64 = (0..SAMPLES)
        .filter_map(|index| {
            let sampler = Sampler::new(Stream::new(0, 0), [0, 0], Replicate::A, index);
            weight(wo, sampler.get_2d(Decision::Direction(0))).map(f64::from)
        })
        .sum();
    sum / f64::from(SAMPLES)
}

/// Share of diffuse light that a smooth interface reflects: ∫ 2 μ F(μ) dμ by the midpoint rule.
fn diffuse_fresnel(eta: f32) -> f32 {
    const STEPS: u32 = 1 << 14;
    let sum: f64 = (0..STEPS)
        .map(|step| {
            let cos = (f64::from(step) + 0.5) / f64::from(STEPS);
            2.0 * cos * f64::from(fresnel::dielectric(cos as f32, eta).0)
        })
        .sum();
    (sum / f64::from(STEPS)) as f32
}

impl Plastic {
    /// What the base sends out, in units of the cosine lobe.
    fn base(&self, cos_o: f32, cos_i: f32) -> Vec3 {
        let coat = &self.coat;
        let again = if self.nonlinear { self.diffuse } else { Vec3::ONE } * coat.turned_back;
        let through = coat.entering(cos_o) * coat.entering(cos_i) / (coat.ior * coat.ior);
        self.diffuse * through / (Vec3::ONE - again)
    }

    /// Probability of following the coat.
    fn coat_share(&self, wo: Vec3) -> f32 {
        let entering = self.coat.entering(wo.z);
        let (coat, base) = ((1.0 - entering) * luminance(self.specular), entering * luminance(self.diffuse));
        let sum = coat + base;
        if sum > 0.0 { coat / sum } else { 0.0 }
    }

    pub(super) fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let share = self.coat_share(wo);
        let mut f = self.base(wo.z, wi.z) * (FRAC_1_PI * wi.z);
        let mut pdf = (1.0 - share) * hemisphere_cosine_pdf(wi.z);
        if let Some(facets) = &self.coat.facets
            && let Some(half) = Half::new(wo, wi, 1.0)
        {
            let (fresnel, _) = fresnel::dielectric(wi.dot(half.h), self.coat.ior);
            f += self.specular * (fresnel * facets.reflected(wo, wi, half.h));
            pdf += share * facets.reflection_pdf(wo, half.h);
        }
        (f, pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let share = self.coat_share(wo);
        let wi = if lobe >= share {
            hemisphere_cosine(u)
        } else if let Some(facets) = &self.coat.facets {
            facets.sample_reflection(wo, u)
        } else {
            let weight = self.specular * ((1.0 - self.coat.entering(wo.z)) / share);
            return Some(BsdfSample::reflected(mirrored(wo), weight, f32::INFINITY));
        };
        let (f, pdf) = self.scatter(wo, wi);
        (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample::reflected(wi, f / pdf, pdf))
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        self.diffuse * self.coat.entering(wo.z) + self.specular * (1.0 - self.coat.entering(wo.z))
    }
}
