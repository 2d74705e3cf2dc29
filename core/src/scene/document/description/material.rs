//! Owns materials: how surfaces scatter light.

use glam::Vec3;
use serde_json::Value as Json;

use super::texture::{ColorTexture, NumberTexture};
use crate::bsdf::Distribution;
use crate::scene::document::cursor::Cursor;
use crate::scene::document::decode::{Decode, Fields};
use crate::scene::document::macros::{object, variants};
use crate::scene::document::rule::{Allowed, Rule, optional, or};
use crate::scene::document::schema::Definitions;

/// A material: a model of scattering, and what else belongs to a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// How light is scattered.
    pub model: Model,
    /// Holes and bumps.
    pub relief: Relief,
}

impl Decode for Material {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let model = Model::decode(at, allowed);
        let relief = Relief::decode_fields(at);
        Some(Self { model: model?, relief: relief? })
    }

    fn expected(allowed: &Allowed) -> String {
        Model::expected(allowed)
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        Model::schema(allowed, definitions)
    }

    fn show(&self) -> Json {
        let model = self.model.show();
        let mut fields = model.as_object().cloned().unwrap_or_default();
        self.relief.show_fields(&mut fields);
        Json::Object(fields)
    }
}

object! {
    "relief";
    /// Holes and bumps of a surface.
    pub struct Relief {
        /// Share of the surface that is there; where it is 0, rays pass as through nothing.
        opacity: NumberTexture = share(1.0);
        /// Height of small bumps, in units of `bump_scale`: tilts the normal, moves nothing.
        bump: Option<NumberTexture> = optional();
        /// Height that a bump of 1 stands for, in world units.
        bump_scale: f32 = or(1.0);
        /// Normals as colours, 0.5 (x, y, z) + 0.5: x along u, y along v, z out of the surface.
        normal_map: Option<ColorTexture> = optional();
    }
}

/// A number from 0 to 1 that may vary over a surface.
fn share(default: f32) -> Rule<NumberTexture> {
    or(NumberTexture::Constant(default)).from(0.0).to(1.0)
}

/// A colour whose channels are 0 to 1 and may vary over a surface.
fn color(default: f32) -> Rule<ColorTexture> {
    or(ColorTexture::Constant(Vec3::splat(default))).from(0.0).to(1.0)
}

/// An index of refraction of the inside, in units of that of the outside.
fn ior(default: f32) -> Rule<f32> {
    or(default).from(0.1).to(10.0)
}

/// The width of a distribution of microfacets.
fn alpha(default: f32) -> Rule<NumberTexture> {
    share(default)
}

variants! {
    "material";
    /// How a surface scatters light.
    pub enum Model with Relief {
        /// Lambert's law: the same radiance in all directions.
        "diffuse" => Diffuse {
            /// Share of the light that is scattered back, linear Rec.709, each channel 0 to 1.
            reflectance: ColorTexture = color(0.5);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(true);
        }
        /// The Disney BSDF (Burley 2012 and 2015): plastics, metals, coats, cloth and glass in one model. Light comes
        /// through to the inside, which is behind the front side, where it is glass.
        "principled_bsdf" => Principled {
            /// Colour, linear Rec.709, each channel 0 to 1.
            base_color: ColorTexture = color(0.5);
            /// Share that is glass instead of diffuse.
            specular_transmission: NumberTexture = share(0.0);
            /// Share that is metal.
            metallic: NumberTexture = share(0.0);
            /// Blends the diffuse lobe towards a flattened one, as of thin subsurface scattering.
            subsurface: NumberTexture = share(0.0);
            /// Strength of the highlight of what is not metal; 1 is that of `eta`.
            specular: NumberTexture = share(0.5);
            /// Roughness of all lobes but the clearcoat; microfacets have the width of its square.
            roughness: NumberTexture = share(0.5);
            /// Share of the base colour in the highlight of what is not metal.
            specular_tint: NumberTexture = share(0.0);
            /// Stretch of highlights along u.
            anisotropic: NumberTexture = share(0.0);
            /// Strength of the lobe at grazing angles, for cloth.
            sheen: NumberTexture = share(0.0);
            /// Share of the base colour in the sheen.
            sheen_tint: NumberTexture = share(0.5);
            /// Strength of a second highlight on top.
            clearcoat: NumberTexture = share(0.0);
            /// Sharpness of the clearcoat's highlight.
            clearcoat_gloss: NumberTexture = share(1.0);
            /// Index of refraction of the inside, in units of that of the outside.
            eta: NumberTexture = or(NumberTexture::Constant(1.5)).from(0.1).to(10.0);
            /// Whether the back side is like the front side; then there is no inside. For glass leave it off.
            two_sided: bool = or(false);
            /// Whether lobes are scaled by their directional albedo so that nothing reflects more than it receives;
            /// off, the model is evaluated as published, which gains energy for some parameters.
            energy_conserving: bool = or(false);
        }
        /// The diffuse lobe of `principled_bsdf` alone.
        "disney_diffuse" => DisneyDiffuse {
            /// Colour, linear Rec.709, each channel 0 to 1.
            base_color: ColorTexture = color(0.5);
            /// Roughness.
            roughness: NumberTexture = share(0.5);
            /// Blends towards a flattened lobe, as of thin subsurface scattering.
            subsurface: NumberTexture = share(0.0);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(false);
        }
        /// The metal lobe of `principled_bsdf` alone, with the base colour at normal incidence.
        "disney_metal" => DisneyMetal {
            /// Colour at normal incidence, linear Rec.709, each channel 0 to 1.
            base_color: ColorTexture = color(0.5);
            /// Roughness; microfacets have the width of its square.
            roughness: NumberTexture = share(0.5);
            /// Stretch of highlights along u.
            anisotropic: NumberTexture = share(0.0);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(false);
        }
        /// The clearcoat lobe of `principled_bsdf` alone, at full strength.
        "disney_clearcoat" => DisneyClearcoat {
            /// Sharpness of the highlight.
            clearcoat_gloss: NumberTexture = share(1.0);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(false);
        }
        /// The glass lobe of `principled_bsdf` alone.
        "disney_glass" => DisneyGlass {
            /// Colour of reflected light, and squared colour of refracted light, each channel 0 to 1.
            base_color: ColorTexture = color(1.0);
            /// Roughness; microfacets have the width of its square.
            roughness: NumberTexture = share(0.0);
            /// Stretch of highlights along u.
            anisotropic: NumberTexture = share(0.0);
            /// Index of refraction of the inside, in units of that of the outside.
            eta: NumberTexture = or(NumberTexture::Constant(1.5)).from(0.1).to(10.0);
        }
        /// The sheen lobe of `principled_bsdf` alone.
        "disney_sheen" => DisneySheen {
            /// Colour, linear Rec.709, each channel 0 to 1.
            base_color: ColorTexture = color(0.5);
            /// Share of the colour in the sheen.
            sheen_tint: NumberTexture = share(0.5);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(false);
        }
        /// Glass: reflects and refracts at an interface, smooth or rough (Walter et al. 2007).
        "dielectric" => Dielectric {
            /// Index of refraction of the inside, in units of that of the outside.
            ior: f32 = ior(1.5);
            /// Width of the microfacets along u; 0 is smooth.
            alpha: NumberTexture = alpha(0.0);
            /// Width of the microfacets along v; as along u where left out.
            alpha_v: Option<NumberTexture> = optional();
            /// Distribution of the microfacets.
            distribution: Distribution = or(Distribution::Ggx);
            /// Factor of reflected light.
            specular_reflectance: ColorTexture = color(1.0);
            /// Factor of refracted light.
            specular_transmittance: ColorTexture = color(1.0);
        }
        /// A pane of glass so thin that light leaves it as it came in.
        "thin_dielectric" => ThinDielectric {
            /// Index of refraction of the pane, in units of that of the outside.
            ior: f32 = ior(1.5);
            /// Factor of reflected light.
            specular_reflectance: ColorTexture = color(1.0);
            /// Factor of light that passes.
            specular_transmittance: ColorTexture = color(1.0);
        }
        /// A metal, smooth or rough.
        "conductor" => Conductor {
            /// Refraction index by colour; without it the metal reflects all light at all angles.
            eta: Option<Vec3> = optional().from(0.0).to(100.0);
            /// Absorption index by colour; 0 where left out beside `eta`.
            k: Option<Vec3> = optional().from(0.0).to(100.0);
            /// Factor of reflected light.
            reflectance: ColorTexture = color(1.0);
            /// Width of the microfacets along u; 0 is smooth.
            alpha: NumberTexture = alpha(0.0);
            /// Width of the microfacets along v; as along u where left out.
            alpha_v: Option<NumberTexture> = optional();
            /// Distribution of the microfacets.
            distribution: Distribution = or(Distribution::Ggx);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(true);
        }
        /// A diffuse base under a dielectric coat, smooth or rough, with the light that is reflected to and fro inside.
        "plastic" => Plastic {
            /// Share of the light that the base scatters, linear Rec.709, each channel 0 to 1.
            diffuse_reflectance: ColorTexture = color(0.5);
            /// Factor of light that the coat reflects.
            specular_reflectance: ColorTexture = color(1.0);
            /// Index of refraction of the coat, in units of that of the outside.
            ior: f32 = ior(1.5);
            /// Width of the microfacets; 0 is smooth.
            alpha: f32 = or(0.0).from(0.0).to(1.0);
            /// Distribution of the microfacets.
            distribution: Distribution = or(Distribution::Ggx);
            /// Whether colours saturate by the light that is reflected to and fro inside.
            nonlinear: bool = or(false);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(true);
        }
        /// A perfect mirror.
        "mirror" => Mirror {
            /// Share of the light that is reflected, linear Rec.709, each channel 0 to 1.
            reflectance: ColorTexture = color(1.0);
            /// Whether the back side is like the front side; otherwise it is black.
            two_sided: bool = or(true);
        }
        /// Nothing: light passes unchanged. Such a surface bounds a medium.
        "null" => Null {}
    }
}
