//! Owns how surfaces scatter light: an enum of materials' models, ready at a hit point, in the local frame.
//!
//! `wo` points to where the light goes, `wi` to where it comes from, both away from the surface and of unit length; z is
//! the shading normal, x the direction of u. The outside is above (z > 0), so an index of refraction is that of the side
//! below. Which side a direction is on is told by its z: whoever calls drops pairs that the geometric normal sees on
//! other sides. Densities are per solid angle and cover every lobe. A model knows nothing of scenes.

mod beckmann;
mod conductor;
mod dielectric;
mod diffuse;
mod fresnel;
mod interface;
mod microfacet;
mod mirror;
mod plastic;
mod principled;
mod thin_dielectric;

pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use microfacet::{Distribution, Microfacets};
pub use mirror::Mirror;
pub use plastic::{Coat, Plastic};
pub use principled::{Conserving, Lobes, Parameters, Principled};
pub use thin_dielectric::ThinDielectric;

use glam::{Vec2, Vec3};

/// A material at a point: parameters read, textures looked up.
#[derive(Debug, Clone, PartialEq)]
pub enum Bsdf {
    /// Lambert's law.
    Diffuse(Diffuse),
    /// The Disney BSDF, or one of its lobes.
    Principled(Principled),
    /// Glass.
    Dielectric(Dielectric),
    /// A thin pane of glass.
    ThinDielectric(ThinDielectric),
    /// A metal.
    Conductor(Conductor),
    /// A diffuse base under a coat.
    Plastic(Plastic),
    /// A perfect mirror.
    Mirror(Mirror),
}

/// A sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// Where the light comes from, unit length.
    pub wi: Vec3,
    /// `f(wo, wi) · |cos θi| / pdf`, over all lobes; of light that changes sides with the factor that radiance gets
    /// there, 1/η².
    pub weight: Vec3,
    /// Density of `wi` over all lobes; infinite for a direction that only this lobe can have found: a mirror's.
    pub pdf: f32,
    /// Square of the index of refraction of the side of `wi`, in units of that of the side of `wo`; 1 where light stays
    /// on its side.
    pub eta2: f32,
}

impl BsdfSample {
    /// Light that stays on its side.
    fn reflected(wi: Vec3, weight: Vec3, pdf: f32) -> Self {
        Self { wi, weight, pdf, eta2: 1.0 }
    }
}

impl Bsdf {
    /// `f(wo, wi) · |cos θi|`, 0 where nothing is scattered, and the density with which [`Bsdf::sample`] chooses `wi`.
    /// Lobes of a single direction are in neither.
    #[inline]
    pub fn scatter(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        match self {
            Self::Diffuse(b) => b.scatter(wo, wi),
            Self::Principled(b) => b.scatter(wo, wi),
            Self::Dielectric(b) => b.scatter(wo, wi),
            Self::Conductor(b) => b.scatter(wo, wi),
            Self::Plastic(b) => b.scatter(wo, wi),
            Self::ThinDielectric(_) | Self::Mirror(_) => (Vec3::ZERO, 0.0),
        }
    }

    /// The first part of [`Bsdf::scatter`].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.scatter(wo, wi).0
    }

    /// The second part of [`Bsdf::scatter`].
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.scatter(wo, wi).1
    }

    /// Chooses `wi`: `lobe` decides which lobe, `u` which direction. `None` when the light is absorbed.
    #[inline]
    pub fn sample(&self, wo: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self {
            Self::Diffuse(b) => b.sample(wo, u),
            Self::Principled(b) => b.sample(wo, lobe, u),
            Self::Dielectric(b) => b.sample(wo, lobe, u),
            Self::ThinDielectric(b) => b.sample(wo, lobe, u),
            Self::Conductor(b) => b.sample(wo, u),
            Self::Plastic(b) => b.sample(wo, lobe, u),
            Self::Mirror(b) => b.sample(wo),
        }
    }

    /// Whether `lobe` decides anything in [`Bsdf::sample`].
    #[inline]
    pub fn has_lobes(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Conductor(_) | Self::Mirror(_) => false,
            Self::Principled(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Plastic(_) => true,
        }
    }

    /// Colour of the surface under white light from all sides, 0..1: the albedo layer.
    pub fn albedo(&self, wo: Vec3) -> Vec3 {
        let albedo = match self {
            Self::Diffuse(b) => b.reflectance,
            Self::Principled(b) => b.albedo(wo),
            Self::Dielectric(b) => b.albedo(wo),
            Self::ThinDielectric(b) => b.albedo(wo),
            Self::Conductor(b) => b.albedo(wo),
            Self::Plastic(b) => b.albedo(wo),
            Self::Mirror(b) => b.reflectance,
        };
        albedo.clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// Whether every lobe has a single direction: then lights are found by following it and not by sampling them, and
    /// auxiliary layers show what is behind.
    #[inline]
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Plastic(_) => false,
            Self::Principled(b) => b.is_delta(),
            Self::Dielectric(b) => b.is_delta(),
            Self::Conductor(b) => b.facets.is_none(),
            Self::ThinDielectric(_) | Self::Mirror(_) => true,
        }
    }

    /// Whether light from the other side is scattered too.
    #[inline]
    pub fn transmits(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Plastic(_) | Self::Conductor(_) | Self::Mirror(_) => false,
            Self::Dielectric(_) | Self::ThinDielectric(_) => true,
            Self::Principled(b) => b.transmits(),
        }
    }

    /// Whether directions along x scatter otherwise than those along y.
    pub fn is_stretched(&self) -> bool {
        let facets = match self {
            Self::Principled(b) => Some(b.facets()),
            Self::Dielectric(b) => Some(b.facets()),
            Self::Conductor(b) => b.facets,
            Self::Diffuse(_) | Self::ThinDielectric(_) | Self::Plastic(_) | Self::Mirror(_) => None,
        };
        facets.is_some_and(|facets| facets.alpha.x != facets.alpha.y)
    }
}
