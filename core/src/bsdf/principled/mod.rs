//! Owns the Disney BSDF: its parameters, the weights of its lobes, and the mixture that samples them.
//!
//! Burley 2012 and 2015, with Smith's separable masking, values with the cosine of `wi`. Five lobes add up; each is a
//! model of its own under a name that begins with `disney_`. From inside only the glass lobe is left.

mod clearcoat;
mod conserve;
mod diffuse;
mod metal;
mod sheen;

pub use conserve::Conserving;

use super::BsdfSample;
use super::fresnel::{grazing, normal_incidence, schlick};
use super::interface::Interface;
use super::microfacet::{Distribution, Half, Microfacets, reflect};
use crate::color::luminance;
use crate::warp::{hemisphere_cosine, hemisphere_cosine_pdf};
use clearcoat::Clearcoat;
use diffuse::Diffuse;
use glam::{Vec2, Vec3};
use metal::Metal;
use sheen::Sheen;
use std::sync::Arc;

/// The parameters at a point, each in its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// Colour, 0..1 by channel.
    pub base_color: Vec3,
    /// Share of glass in what is not metal, 0..1.
    pub specular_transmission: f32,
    /// Share of metal, 0..1.
    pub metallic: f32,
    /// Blends the diffuse lobe towards a flattened one, 0..1.
    pub subsurface: f32,
    /// Strength of the highlight of what is not metal, 0..1.
    pub specular: f32,
    /// Roughness, 0..1.
    pub roughness: f32,
    /// Share of the base colour in the highlight of what is not metal, 0..1.
    pub specular_tint: f32,
    /// Stretch of highlights along x, 0..1.
    pub anisotropic: f32,
    /// Strength of the sheen, 0..1.
    pub sheen: f32,
    /// Share of the base colour in the sheen, 0..1.
    pub sheen_tint: f32,
    /// Strength of the clearcoat, 0..1.
    pub clearcoat: f32,
    /// Sharpness of the clearcoat, 0..1.
    pub clearcoat_gloss: f32,
    /// Index of refraction below, in units of that above; above 0.
    pub eta: f32,
}

impl Default for Parameters {
    /// What a document's `principled_bsdf` without fields has.
    fn default() -> Self {
        Self {
            base_color: Vec3::splat(0.5),
            specular_transmission: 0.0,
            metallic: 0.0,
            subsurface: 0.0,
            specular: 0.5,
            roughness: 0.5,
            specular_tint: 0.0,
            anisotropic: 0.0,
            sheen: 0.0,
            sheen_tint: 0.5,
            clearcoat: 0.0,
            clearcoat_gloss: 1.0,
            eta: 1.5,
        }
    }
}

/// Factors of the lobes in the sum, each at least 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lobes {
    /// Of the diffuse lobe.
    pub diffuse: f32,
    /// Of the sheen.
    pub sheen: f32,
    /// Of the metal, which is the highlight of what is not metal as well.
    pub metal: f32,
    /// Of the clearcoat.
    pub clearcoat: f32,
    /// Of the glass.
    pub glass: f32,
}

impl Lobes {
    /// The factors that the whole model has for these parameters.
    pub fn new(p: &Parameters) -> Self {
        let (metallic, glass) = (p.metallic, p.specular_transmission);
        Self {
            diffuse: (1.0 - glass) * (1.0 - metallic),
            sheen: (1.0 - metallic) * p.sheen,
            metal: 1.0 - glass * (1.0 - metallic),
            clearcoat: 0.25 * p.clearcoat,
            glass: (1.0 - metallic) * glass,
        }
    }
}

/// The Disney BSDF at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Principled {
    lobes: Lobes,
    diffuse: Diffuse,
    sheen: Sheen,
    metal: Metal,
    clearcoat: Clearcoat,
    glass: Interface,
    conserving: Option<Arc<Conserving>>,
}

/// Probabilities of choosing the lobes for a direction; they add up to 1.
struct Choice {
    /// The cosine lobe, which covers diffuse and sheen.
    cosine: f32,
    metal: f32,
    clearcoat: f32,
    glass: f32,
}

impl Principled {
    /// The whole model.
    pub fn new(parameters: &Parameters) -> Self {
        Self::with_lobes(parameters, Lobes::new(parameters))
    }

    /// Some lobes of it, such as one alone.
    pub fn with_lobes(p: &Parameters, lobes: Lobes) -> Self {
        let aspect = (1.0 - 0.9 * p.anisotropic).sqrt();
        let r2 = p.roughness * p.roughness;
        let facets = Microfacets::new(Distribution::Ggx, Vec2::new(r2 / aspect, r2 * aspect));
        let tint = tint(p.base_color);
        let toned = |share: f32| Vec3::splat(1.0 - share) + tint * share;
        let highlight = p.specular * normal_incidence(p.eta) * (1.0 - p.metallic);
        Self {
            lobes,
            diffuse: Diffuse { base: p.base_color, roughness: p.roughness, subsurface: p.subsurface },
            sheen: Sheen { color: toned(p.sheen_tint) },
            metal: Metal { facets, c0: toned(p.specular_tint) * highlight + p.base_color * p.metallic },
            clearcoat: Clearcoat::new(p.clearcoat_gloss),
            glass: Interface {
                facets,
                reflectance: p.base_color,
                // A slab has the colour once.
                transmittance: p.base_color.map(f32::sqrt),
                eta: p.eta,
            },
            conserving: None,
        }
    }

    /// The same model with its lobes scaled so that it reflects no more than it receives.
    #[must_use]
    pub fn conserving(self, table: Arc<Conserving>) -> Self {
        Self { conserving: Some(table), ..self }
    }

    pub(super) fn sample(&self, wo: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let choice = self.choose(wo)?;
        let mut rest = lobe;
        let mut falls_in = |share: f32| {
            let inside = rest < share;
            if !inside {
                rest -= share;
            }
            inside
        };
        let mut from_glass = false;
        let wi = if falls_in(choice.cosine) {
            hemisphere_cosine(u)
        } else if falls_in(choice.metal) {
            self.metal.facets.sample_reflection(wo, u)
        } else if falls_in(choice.clearcoat) {
            reflect(wo, self.clearcoat.sample(u))
        } else if choice.glass > 0.0 {
            from_glass = true;
            if let Some(straight) = self.glass.straight(wo) {
                let weight =
                    straight.weight * (self.lobes.glass / choice.glass) * self.factor(wo, straight.wi);
                return Some(BsdfSample { weight, ..straight });
            }
            self.glass.sample(wo, (rest / choice.glass).clamp(0.0, 1.0), u)?
        } else {
            // Only by rounding of the shares: the last lobe above had them all.
            return None;
        };
        // A reflection that ends below must not pass for what the glass sends there.
        if wi.z * wo.z <= 0.0 && !from_glass {
            return None;
        }
        let (f, pdf) = self.scatter(wo, wi);
        let eta = self.glass.eta_from(wo);
        let eta2 = if wo.z * wi.z < 0.0 { eta * eta } else { 1.0 };
        (pdf > 0.0 && pdf.is_finite()).then(|| BsdfSample { wi, weight: f / pdf, pdf, eta2 })
    }

    pub(super) fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let Some(choice) = self.choose(wo) else { return (Vec3::ZERO, 0.0) };
        let (mut f, mut pdf) = (Vec3::ZERO, 0.0);
        let sides = wo.z * wi.z;
        if sides > 0.0
            && let Some(half) = Half::new(wo, wi, 1.0)
        {
            if wo.z > 0.0 {
                (f, pdf) = self.reflect_outside(wo, wi, half.h, &choice);
            }
            if self.lobes.glass > 0.0 {
                let (value, density) = self.glass.reflect(wo, wi, half.h);
                f += value * self.lobes.glass;
                pdf += density * choice.glass;
            }
        } else if sides < 0.0 && self.lobes.glass > 0.0 {
            let (value, density) = self.glass.refract(wo, wi);
            f = value * self.lobes.glass;
            pdf = density * choice.glass;
        }
        (f * self.factor(wo, wi), pdf)
    }

    /// The lobes of the outside alone: all but glass.
    fn reflect_outside(&self, wo: Vec3, wi: Vec3, h: Vec3, choice: &Choice) -> (Vec3, f32) {
        let lobes = &self.lobes;
        // Of either direction, but for rounding: so that light goes both ways alike.
        let cos_h = 0.5 * (wo + wi).dot(h).abs();
        let mut f = Vec3::ZERO;
        let mut pdf = choice.cosine * hemisphere_cosine_pdf(wi.z);
        if lobes.diffuse > 0.0 {
            f += self.diffuse.eval(wo, wi, cos_h) * lobes.diffuse;
        }
        if lobes.sheen > 0.0 {
            f += self.sheen.eval(wi, cos_h) * lobes.sheen;
        }
        if lobes.metal > 0.0 {
            f += self.metal.eval(wo, wi, h, cos_h) * lobes.metal;
            pdf += choice.metal * self.metal.facets.reflection_pdf(wo, h);
        }
        if lobes.clearcoat > 0.0 {
            let (value, density) = self.clearcoat.eval(wo, wi, h, cos_h);
            f += Vec3::splat(value * lobes.clearcoat);
            pdf += choice.clearcoat * density;
        }
        (f, pdf)
    }

    /// Lobes are chosen by what they are estimated to reflect; `None` where all of them are dark.
    fn choose(&self, wo: Vec3) -> Option<Choice> {
        if wo.z == 0.0 {
            return None;
        }
        let lobes = &self.lobes;
        if wo.z < 0.0 {
            return (lobes.glass > 0.0).then_some(Choice {
                cosine: 0.0,
                metal: 0.0,
                clearcoat: 0.0,
                glass: 1.0,
            });
        }
        // Sheen brings some tenth of its factor, more at grazing angles, and has no lobe of its own.
        let sheen = lobes.sheen * (0.1 + 0.9 * grazing(wo.z));
        let cosine = lobes.diffuse * luminance(self.diffuse.base) + sheen;
        // Rough facets reflect at other angles too: on average Schlick's term adds 1/21 to a black metal.
        let spread = self.metal.facets.alpha.max_element().min(1.0) / 21.0;
        let metal =
            lobes.metal * luminance(self.metal.c0.lerp(Vec3::ONE, grazing(wo.z).max(spread).max(1.0e-3)));
        let clearcoat = lobes.clearcoat * (0.04 + 0.96 * grazing(wo.z));
        let glass = lobes.glass * self.glass.brightness(wo);
        let sum = cosine + metal + clearcoat + glass;
        (sum > 0.0).then(|| Choice {
            cosine: cosine / sum,
            metal: metal / sum,
            clearcoat: clearcoat / sum,
            glass: glass / sum,
        })
    }

    /// What energy conservation leaves of the lobes: the same in both directions, so that they stay reciprocal.
    fn factor(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.conserving.as_ref().map_or(Vec3::ONE, |table| table.factor(wo.z).min(table.factor(wi.z)))
    }

    pub(super) fn albedo(&self, wo: Vec3) -> Vec3 {
        let lobes = &self.lobes;
        let outside = self.diffuse.base * lobes.diffuse
            + schlick(self.metal.c0, wo.z.abs()) * lobes.metal
            + Vec3::splat((0.04 + 0.96 * grazing(wo.z.abs())) * lobes.clearcoat)
            + self.sheen.color * (0.1 * lobes.sheen);
        outside + self.glass.transmittance * lobes.glass
    }

    pub(super) fn facets(&self) -> Microfacets {
        self.metal.facets
    }

    pub(super) fn is_delta(&self) -> bool {
        let l = &self.lobes;
        l.diffuse + l.sheen + l.metal + l.clearcoat == 0.0 && l.glass > 0.0 && self.glass.is_straight()
    }

    pub(super) fn transmits(&self) -> bool {
        self.lobes.glass > 0.0
    }
}

/// The hue of a colour: divided by its luminance, with the weights of the model's handout; white for black.
fn tint(base: Vec3) -> Vec3 {
    let luminance = base.dot(Vec3::new(0.212_671, 0.715_160, 0.072_169));
    if luminance > 0.0 { base / luminance } else { Vec3::ONE }
}
