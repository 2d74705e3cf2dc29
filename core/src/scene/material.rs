//! Owns compiled materials: parameters whose textures are loaded, read once at a hit.

use super::object::{Needs, Surface};
use crate::bsdf::{
    Bsdf, Coat, Conductor, Conserving, Dielectric, Diffuse, Distribution, Lobes, Microfacets, Mirror,
    Parameters, Plastic, Principled, ThinDielectric,
};
use crate::math::Frame;
use crate::texture::{Color, Number, Place, Texture};
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

    /// The parameters at a point.
    pub(super) fn parameters(&self, place: &Place) -> Parameters {
        let share = |number: &Number| number.at(place).clamp(0.0, 1.0);
        Parameters {
            base_color: color(&self.base_color, place),
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
            eta: self.eta.at(place).clamp(0.1, 10.0),
        }
    }

    /// The scattering at a point.
    pub(super) fn at(&self, place: &Place) -> Principled {
        let parameters = self.parameters(place);
        let lobes = self.lobes.unwrap_or_else(|| Lobes::new(&parameters));
        let model = Principled::with_lobes(&parameters, lobes);
        match &self.conserving {
            Some(table) => model.conserving(Arc::clone(table)),
            None => model,
        }
    }

    /// Whether nothing varies.
    pub(super) fn is_constant(&self) -> bool {
        self.textures().is_empty()
    }

    fn textures(&self) -> Vec<&Texture> {
        let numbers = [
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
        ];
        let numbers = numbers.into_iter().filter_map(Number::texture);
        self.base_color.texture().into_iter().chain(numbers).collect()
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
    /// The facets at a point; `None` where the surface is smooth.
    fn at(&self, place: &Place) -> Option<Microfacets> {
        let u = self.alpha.at(place).clamp(0.0, 1.0);
        let v = self.alpha_v.as_ref().map_or(u, |alpha| alpha.at(place).clamp(0.0, 1.0));
        (u > 0.0 || v > 0.0).then(|| Microfacets::new(self.distribution, Vec2::new(u, v)))
    }

    fn textures(&self) -> impl Iterator<Item = &Texture> {
        self.alpha.texture().into_iter().chain(self.alpha_v.as_ref().and_then(Number::texture))
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

/// A colour of a reflectance: no channel below 0 or above 1.
fn color(color: &Color, place: &Place) -> Vec3 {
    color.at(place).clamp(Vec3::ZERO, Vec3::ONE)
}

impl Model {
    /// The same model, with textures looked up here and now where none varies.
    pub(super) fn ready(self) -> Self {
        if self.textures().is_empty() { Self::Ready(self.at(&Vec2::ZERO.into()).into_owned()) } else { self }
    }

    /// The textures that its parameters are.
    fn textures<'a>(&'a self) -> Vec<&'a Texture> {
        let colors = |colors: Vec<&'a Color>| colors.into_iter().filter_map(Color::texture).collect();
        match self {
            Self::Ready(_) => Vec::new(),
            Self::Diffuse(c) | Self::Mirror(c) => colors(vec![c]),
            Self::Principled(p) => p.textures(),
            Self::Dielectric(d) => {
                let mut textures = colors(vec![&d.reflectance, &d.transmittance]);
                textures.extend(d.facets.textures());
                textures
            }
            Self::ThinDielectric { reflectance, transmittance, .. } => {
                colors(vec![reflectance, transmittance])
            }
            Self::Conductor(c) => {
                let mut textures = colors(vec![&c.reflectance]);
                textures.extend(c.facets.textures());
                textures
            }
            Self::Plastic { diffuse, specular, .. } => colors(vec![diffuse, specular]),
        }
    }

    /// The scattering at a point.
    pub(super) fn at(&self, place: &Place) -> Cow<'_, Bsdf> {
        Cow::Owned(match self {
            Self::Ready(bsdf) => return Cow::Borrowed(bsdf),
            Self::Diffuse(c) => Bsdf::Diffuse(Diffuse { reflectance: color(c, place) }),
            Self::Principled(p) => Bsdf::Principled(p.at(place)),
            Self::Dielectric(d) => Bsdf::Dielectric(Dielectric::new(
                d.ior,
                d.facets.at(place),
                color(&d.reflectance, place),
                color(&d.transmittance, place),
            )),
            Self::ThinDielectric { ior, reflectance, transmittance } => {
                Bsdf::ThinDielectric(ThinDielectric {
                    ior: *ior,
                    reflectance: color(reflectance, place),
                    transmittance: color(transmittance, place),
                })
            }
            Self::Conductor(c) => Bsdf::Conductor(Conductor {
                index: c.index,
                reflectance: color(&c.reflectance, place),
                facets: c.facets.at(place),
            }),
            Self::Plastic { diffuse, specular, nonlinear, coat } => Bsdf::Plastic(Plastic {
                diffuse: color(diffuse, place),
                specular: color(specular, place),
                nonlinear: *nonlinear,
                coat: Arc::clone(coat),
            }),
            Self::Mirror(c) => Bsdf::Mirror(Mirror { reflectance: color(c, place) }),
        })
    }
}

impl Material {
    /// What it needs to know of a hit.
    pub(super) fn needs(&self) -> Needs {
        let tangents = self.bump.is_some() || self.normal_map.is_some() || self.model.is_stretched();
        let mut textures = self.model.textures();
        textures.extend(self.opacity.as_ref().and_then(Number::texture));
        let traps = textures.iter().any(|texture| matches!(texture, Texture::OrbitTrap(_)));
        Needs { tangents, traps }
    }

    /// Whether a random number chooses among its lobes.
    pub(super) fn has_lobes(&self) -> bool {
        match &self.model {
            Model::Ready(bsdf) => bsdf.has_lobes(),
            Model::Diffuse(_) | Model::Conductor(_) | Model::Mirror(_) => false,
            Model::Principled(_)
            | Model::Dielectric(_)
            | Model::ThinDielectric { .. }
            | Model::Plastic { .. } => true,
        }
    }

    /// Share of the surface that is there.
    pub(super) fn opacity_at(&self, place: &Place) -> f32 {
        self.opacity.as_ref().map_or(1.0, |opacity| opacity.at(place).clamp(0.0, 1.0))
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
            let local = map.at(&surface.uv.into()) * 2.0 - Vec3::ONE;
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
