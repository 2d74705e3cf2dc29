//! Owns compiled materials: parameters whose textures are loaded, read once at a hit.

use super::object::Surface;
use crate::bsdf::{
    Bsdf, Coat, Conductor, Conserving, Dielectric, Diffuse, Distribution, Lobes, Microfacets, Mirror,
    Parameters, Plastic, Principled, ThinDielectric,
};
use crate::math::Frame;
use crate::texture::{Color, Number};
use glam::{Vec2, Vec3};
use std::borrow::Cow;
use std::sync::Arc;

/// A material whose textures are loaded.
#[derive(Debug, Clone)]
pub(super) struct Material {
    pub(super) model: Model,
    /// Whether the back side is like the front side.
    pub(super) two_sided: bool,
    /// Share of the surface that is there; `None` where all of it is.
    pub(super) opacity: Option<Number>,
    /// Height in world units.
    pub(super) bump: Option<(Number, f32)>,
    pub(super) normal_map: Option<Color>,
}

/// How a material scatters, before textures are looked up.
#[derive(Debug, Clone)]
pub(super) enum Model {
    /// The same everywhere.
    Ready(Bsdf),
    Diffuse(Color),
    Principled(Box<PrincipledTextures>),
    Dielectric(Box<DielectricTextures>),
    ThinDielectric {
        ior: f32,
        reflectance: Color,
        transmittance: Color,
    },
    Conductor(Box<ConductorTextures>),
    Plastic {
        diffuse: Color,
        specular: Color,
        nonlinear: bool,
        coat: Arc<Coat>,
    },
    Mirror(Color),
}

/// The parameters of the Disney BSDF as textures.
#[derive(Debug, Clone)]
pub(super) struct PrincipledTextures {
    pub(super) base_color: Color,
    pub(super) specular_transmission: Number,
    pub(super) metallic: Number,
    pub(super) subsurface: Number,
    pub(super) specular: Number,
    pub(super) roughness: Number,
    pub(super) specular_tint: Number,
    pub(super) anisotropic: Number,
    pub(super) sheen: Number,
    pub(super) sheen_tint: Number,
    pub(super) clearcoat: Number,
    pub(super) clearcoat_gloss: Number,
    pub(super) eta: Number,
    /// The lobe that it is alone; `None` for the whole model.
    pub(super) lobes: Option<Lobes>,
    pub(super) conserving: Option<Arc<Conserving>>,
}

impl PrincipledTextures {
    /// Constant textures with these values.
    pub(super) fn constant(p: &Parameters) -> Self {
        let number = Number::Constant;
        Self {
            base_color: Color::Constant(p.base_color),
            specular_transmission: number(p.specular_transmission),
            metallic: number(p.metallic),
            subsurface: number(p.subsurface),
            specular: number(p.specular),
            roughness: number(p.roughness),
            specular_tint: number(p.specular_tint),
            anisotropic: number(p.anisotropic),
            sheen: number(p.sheen),
            sheen_tint: number(p.sheen_tint),
            clearcoat: number(p.clearcoat),
            clearcoat_gloss: number(p.clearcoat_gloss),
            eta: number(p.eta),
            lobes: None,
            conserving: None,
        }
    }

    /// The parameters at a texture coordinate.
    pub(super) fn parameters(&self, uv: Vec2) -> Parameters {
        let share = |number: &Number| number.at(uv).clamp(0.0, 1.0);
        Parameters {
            base_color: color(&self.base_color, uv),
            specular_transmission: share(&self.specular_transmission),
            metallic: share(&self.metallic),
            subsurface: share(&self.subsurface),
            specular: share(&self.specular),
            roughness: share(&self.roughness),
            specular_tint: share(&self.specular_tint),
            anisotropic: share(&self.anisotropic),
            sheen: share(&self.sheen),
            sheen_tint: share(&self.sheen_tint),
            clearcoat: share(&self.clearcoat),
            clearcoat_gloss: share(&self.clearcoat_gloss),
            eta: self.eta.at(uv).clamp(0.1, 10.0),
        }
    }

    /// The scattering at a texture coordinate.
    pub(super) fn at(&self, uv: Vec2) -> Principled {
        let parameters = self.parameters(uv);
        let lobes = self.lobes.unwrap_or_else(|| Lobes::new(&parameters));
        let model = Principled::with_lobes(&parameters, lobes);
        match &self.conserving {
            Some(table) => model.conserving(Arc::clone(table)),
            None => model,
        }
    }

    /// Whether nothing varies.
    pub(super) fn is_constant(&self) -> bool {
        is_constant_color(&self.base_color)
            && [
                &self.specular_transmission,
                &self.metallic,
                &self.subsurface,
                &self.specular,
                &self.roughness,
                &self.specular_tint,
                &self.anisotropic,
                &self.sheen,
                &self.sheen_tint,
                &self.clearcoat,
                &self.clearcoat_gloss,
                &self.eta,
            ]
            .into_iter()
            .all(is_constant)
    }
}

/// Widths of microfacets as textures; `None` for a smooth surface.
#[derive(Debug, Clone)]
pub(super) struct FacetTextures {
    pub(super) distribution: Distribution,
    pub(super) alpha: Number,
    /// Along v; as along u where `None`.
    pub(super) alpha_v: Option<Number>,
}

impl FacetTextures {
    /// The facets at a texture coordinate; `None` where the surface is smooth.
    fn at(&self, uv: Vec2) -> Option<Microfacets> {
        let u = self.alpha.at(uv).clamp(0.0, 1.0);
        let v = self.alpha_v.as_ref().map_or(u, |alpha| alpha.at(uv).clamp(0.0, 1.0));
        (u > 0.0 || v > 0.0).then(|| Microfacets::new(self.distribution, Vec2::new(u, v)))
    }

    fn is_constant(&self) -> bool {
        is_constant(&self.alpha) && self.alpha_v.as_ref().is_none_or(is_constant)
    }
}

/// The parameters of glass as textures.
#[derive(Debug, Clone)]
pub(super) struct DielectricTextures {
    pub(super) ior: f32,
    pub(super) facets: FacetTextures,
    pub(super) reflectance: Color,
    pub(super) transmittance: Color,
}

/// The parameters of a metal as textures.
#[derive(Debug, Clone)]
pub(super) struct ConductorTextures {
    pub(super) index: Option<(Vec3, Vec3)>,
    pub(super) reflectance: Color,
    pub(super) facets: FacetTextures,
}

fn is_constant(number: &Number) -> bool {
    matches!(number, Number::Constant(_))
}

fn is_constant_color(color: &Color) -> bool {
    matches!(color, Color::Constant(_))
}

/// A colour of a reflectance: no channel below 0 or above 1.
fn color(color: &Color, uv: Vec2) -> Vec3 {
    color.at(uv).clamp(Vec3::ZERO, Vec3::ONE)
}

impl Model {
    /// The same model, with textures looked up here and now where none varies.
    pub(super) fn ready(self) -> Self {
        let constant = match &self {
            Self::Ready(_) => true,
            Self::Diffuse(c) | Self::Mirror(c) => is_constant_color(c),
            Self::Principled(p) => p.is_constant(),
            Self::Dielectric(d) => {
                d.facets.is_constant()
                    && is_constant_color(&d.reflectance)
                    && is_constant_color(&d.transmittance)
            }
            Self::ThinDielectric { reflectance, transmittance, .. } => {
                is_constant_color(reflectance) && is_constant_color(transmittance)
            }
            Self::Conductor(c) => c.facets.is_constant() && is_constant_color(&c.reflectance),
            Self::Plastic { diffuse, specular, .. } => {
                is_constant_color(diffuse) && is_constant_color(specular)
            }
        };
        if constant { Self::Ready(self.at(Vec2::ZERO).into_owned()) } else { self }
    }

    /// The scattering at a texture coordinate.
    pub(super) fn at(&self, uv: Vec2) -> Cow<'_, Bsdf> {
        Cow::Owned(match self {
            Self::Ready(bsdf) => return Cow::Borrowed(bsdf),
            Self::Diffuse(c) => Bsdf::Diffuse(Diffuse { reflectance: color(c, uv) }),
            Self::Principled(p) => Bsdf::Principled(p.at(uv)),
            Self::Dielectric(d) => Bsdf::Dielectric(Dielectric::new(
                d.ior,
                d.facets.at(uv),
                color(&d.reflectance, uv),
                color(&d.transmittance, uv),
            )),
            Self::ThinDielectric { ior, reflectance, transmittance } => {
                Bsdf::ThinDielectric(ThinDielectric {
                    ior: *ior,
                    reflectance: color(reflectance, uv),
                    transmittance: color(transmittance, uv),
                })
            }
            Self::Conductor(c) => Bsdf::Conductor(Conductor {
                index: c.index,
                reflectance: color(&c.reflectance, uv),
                facets: c.facets.at(uv),
            }),
            Self::Plastic { diffuse, specular, nonlinear, coat } => Bsdf::Plastic(Plastic {
                diffuse: color(diffuse, uv),
                specular: color(specular, uv),
                nonlinear: *nonlinear,
                coat: Arc::clone(coat),
            }),
            Self::Mirror(c) => Bsdf::Mirror(Mirror { reflectance: color(c, uv) }),
        })
    }
}

impl Material {
    /// Whether it needs to know where u and v point.
    pub(super) fn needs_tangents(&self) -> bool {
        self.bump.is_some() || self.normal_map.is_some() || self.model.is_stretched()
    }

    /// Share of the surface that is there.
    pub(super) fn opacity_at(&self, uv: Vec2) -> f32 {
        self.opacity.as_ref().map_or(1.0, |opacity| opacity.at(uv).clamp(0.0, 1.0))
    }

    /// The frame of the surface, z its front side with all bumps, x along u where that matters.
    pub(super) fn frame(&self, surface: &Surface) -> Frame {
        let Some([du, dv]) = surface.tangents else { return Frame::new(surface.ns) };
        let mut n = surface.ns;
        if let Some((height, scale)) = &self.bump {
            let slope = height.gradient(surface.uv) * *scale;
            // Before the bumps the surface is the interpolated one, which the flat triangle's tangents lie across.
            let raised = |tangent: Vec3, slope: f32| tangent + n * (slope - n.dot(tangent));
            let bent = raised(du, slope.x).cross(raised(dv, slope.y));
            n = (bent * 1.0_f32.copysign(bent.dot(n))).try_normalize().unwrap_or(n);
        }
        if let Some(map) = &self.normal_map {
            let base = Frame::with_tangent(n, du);
            // v may run either way around the normal.
            let t = base.t * 1.0_f32.copysign(base.t.dot(dv));
            let local = map.at(surface.uv) * 2.0 - Vec3::ONE;
            let bent = base.s * local.x + t * local.y + n * local.z;
            n = bent.try_normalize().filter(|bent| bent.dot(n) > 0.0).unwrap_or(n);
        }
        Frame::with_tangent(n, du)
    }
}

impl Model {
    /// Whether directions along u scatter otherwise than those along v.
    fn is_stretched(&self) -> bool {
        match self {
            Self::Ready(bsdf) => bsdf.is_stretched(),
            Self::Diffuse(_) | Self::ThinDielectric { .. } | Self::Plastic { .. } | Self::Mirror(_) => false,
            Self::Principled(p) => !matches!(p.anisotropic, Number::Constant(0.0)),
            Self::Dielectric(d) => d.facets.alpha_v.is_some(),
            Self::Conductor(c) => c.facets.alpha_v.is_some(),
        }
    }
}
