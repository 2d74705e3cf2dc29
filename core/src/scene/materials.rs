//! Owns compiling materials: what a document says to what is asked at hits.

use super::assets::Assets;
use super::document::{self as doc, ColorTexture, Description, NumberTexture, Problem, Problems};
use super::material::{
    ConductorTextures, DielectricTextures, FacetTextures, Material, Model, PrincipledTextures,
};
use crate::bsdf::{Coat, Conserving, Distribution, Lobes, Microfacets, Parameters};
use crate::sdf::{Noise, NoiseParameters};
use crate::texture::{
    Checkerboard, Color, ColorSpace, Fbm, ImageTexture, Number, OrbitTrap, SolidCheckerboard, SolidFbm,
    Texture,
};
use glam::{Affine2, Affine3A, DAffine2, DAffine3, Vec2, Vec3};
use std::sync::Arc;

/// All materials of a description, in its order.
pub(super) fn compile(description: &Description, assets: &Assets, problems: &mut Problems) -> Vec<Material> {
    let compile = |(name, material): (&str, &doc::Material)| {
        let path = format!("materials.{name}");
        let mut compiler = Compiler { description, assets, problems, path };
        compiler.material(material)
    };
    description.materials.iter().map(compile).collect()
}

/// Compiles one material.
struct Compiler<'a> {
    description: &'a Description,
    assets: &'a Assets,
    problems: &'a mut Problems,
    path: String,
}

/// Black, where something is missing: the problem is reported and nothing is rendered.
const MISSING: Texture =
    Texture::Checkerboard(Checkerboard { colors: [Vec3::ZERO; 2], transform: Affine2::IDENTITY });

impl Compiler<'_> {
    fn material(&mut self, material: &doc::Material) -> Material {
        let doc::Relief { opacity, bump, bump_scale, normal_map } = &material.relief;
        let is_null = matches!(material.model, doc::Model::Null {});
        let opacity = if is_null {
            Some(Number::Constant(0.0))
        } else {
            (*opacity != NumberTexture::Constant(1.0)).then(|| self.number(opacity))
        };
        let (model, two_sided) = self.model(&material.model);
        let bump = bump.as_ref().map(|height| (self.number(height), *bump_scale));
        let normal_map = normal_map.as_ref().map(|map| self.data(map));
        self.needs_uv("bump", bump.as_ref().and_then(|(height, _)| height.texture()));
        self.needs_uv("normal_map", normal_map.as_ref().and_then(Color::texture));
        Material { model: model.ready(), two_sided, opacity, bump, normal_map }
    }

    /// Reports a range without an inside.
    fn rises(&mut self, field: &str, [low, high]: [f32; 2], than: &str) {
        if low >= high {
            self.problem(field, &format!("found {high}, expected a number above \"{than}\", which is {low}"));
        }
    }

    /// Reports a solid texture where only one over uv has a meaning.
    fn needs_uv(&mut self, field: &str, texture: Option<&Texture>) {
        if texture.is_some_and(|texture| !texture.is_over_uv()) {
            self.problem(
                field,
                "found a solid texture, expected an image, a checkerboard or fbm: its slope along u and v is what bends the \
                 normal",
            );
        }
    }

    /// The model, and whether its back side is like its front side.
    fn model(&mut self, model: &doc::Model) -> (Model, bool) {
        match model {
            doc::Model::Diffuse { reflectance, two_sided } => {
                (Model::Diffuse(self.color(reflectance)), *two_sided)
            }
            doc::Model::Mirror { reflectance, two_sided } => {
                (Model::Mirror(self.color(reflectance)), *two_sided)
            }
            doc::Model::Dielectric {
                ior,
                alpha,
                alpha_v,
                distribution,
                specular_reflectance,
                specular_transmittance,
            } => {
                let model = DielectricTextures {
                    ior: *ior,
                    facets: self.facets(*distribution, alpha, alpha_v.as_ref()),
                    reflectance: self.color(specular_reflectance),
                    transmittance: self.color(specular_transmittance),
                };
                (Model::Dielectric(Box::new(model)), false)
            }
            doc::Model::ThinDielectric { ior, specular_reflectance, specular_transmittance } => {
                let reflectance = self.color(specular_reflectance);
                let transmittance = self.color(specular_transmittance);
                (Model::ThinDielectric { ior: *ior, reflectance, transmittance }, true)
            }
            doc::Model::Conductor { eta, k, reflectance, alpha, alpha_v, distribution, two_sided } => {
                let model = ConductorTextures {
                    index: eta.map(|eta| (eta, k.unwrap_or_default())),
                    reflectance: self.color(reflectance),
                    facets: self.facets(*distribution, alpha, alpha_v.as_ref()),
                };
                (Model::Conductor(Box::new(model)), *two_sided)
            }
            doc::Model::Plastic {
                diffuse_reflectance,
                specular_reflectance,
                ior,
                alpha,
                distribution,
                nonlinear,
                two_sided,
            } => {
                let facets = (*alpha > 0.0).then(|| Microfacets::new(*distribution, Vec2::splat(*alpha)));
                let model = Model::Plastic {
                    diffuse: self.color(diffuse_reflectance),
                    specular: self.color(specular_reflectance),
                    nonlinear: *nonlinear,
                    coat: Arc::new(Coat::new(*ior, facets)),
                };
                (model, *two_sided)
            }
            // Never asked: rays pass it.
            doc::Model::Null {} => (Model::Diffuse(Color::Constant(Vec3::ZERO)), true),
            doc::Model::Principled { .. }
            | doc::Model::DisneyDiffuse { .. }
            | doc::Model::DisneyMetal { .. }
            | doc::Model::DisneyClearcoat { .. }
            | doc::Model::DisneyGlass { .. }
            | doc::Model::DisneySheen { .. } => self.disney(model),
        }
    }

    /// The Disney BSDF, or a lobe of it.
    fn disney(&mut self, model: &doc::Model) -> (Model, bool) {
        let mut textures = PrincipledTextures::constant(&Parameters::default());
        let none = Lobes::default();
        let two_sided = match model {
            doc::Model::DisneyDiffuse { base_color, roughness, subsurface, two_sided } => {
                textures.base_color = self.color(base_color);
                textures.roughness = self.number(roughness);
                textures.subsurface = self.number(subsurface);
                textures.lobes = Some(Lobes { diffuse: 1.0, ..none });
                *two_sided
            }
            doc::Model::DisneyMetal { base_color, roughness, anisotropic, two_sided } => {
                textures.base_color = self.color(base_color);
                textures.roughness = self.number(roughness);
                textures.anisotropic = self.number(anisotropic);
                textures.metallic = Number::Constant(1.0);
                textures.lobes = Some(Lobes { metal: 1.0, ..none });
                *two_sided
            }
            doc::Model::DisneyClearcoat { clearcoat_gloss, two_sided } => {
                textures.clearcoat_gloss = self.number(clearcoat_gloss);
                textures.lobes = Some(Lobes { clearcoat: 1.0, ..none });
                *two_sided
            }
            doc::Model::DisneyGlass { base_color, roughness, anisotropic, eta } => {
                textures.base_color = self.color(base_color);
                textures.roughness = self.number(roughness);
                textures.anisotropic = self.number(anisotropic);
                textures.eta = self.number(eta);
                textures.lobes = Some(Lobes { glass: 1.0, ..none });
                false
            }
            doc::Model::DisneySheen { base_color, sheen_tint, two_sided } => {
                textures.base_color = self.color(base_color);
                textures.sheen_tint = self.number(sheen_tint);
                textures.lobes = Some(Lobes { sheen: 1.0, ..none });
                *two_sided
            }
            doc::Model::Principled { .. } => return self.principled(model),
            doc::Model::Diffuse { .. }
            | doc::Model::Mirror { .. }
            | doc::Model::Dielectric { .. }
            | doc::Model::ThinDielectric { .. }
            | doc::Model::Conductor { .. }
            | doc::Model::Plastic { .. }
            | doc::Model::Null {} => return self.model(model),
        };
        (Model::Principled(Box::new(textures)), two_sided)
    }

    fn principled(&mut self, model: &doc::Model) -> (Model, bool) {
        let doc::Model::Principled {
            base_color,
            specular_transmission,
            metallic,
            subsurface,
            specular,
            roughness,
            specular_tint,
            anisotropic,
            sheen,
            sheen_tint,
            clearcoat,
            clearcoat_gloss,
            eta,
            two_sided,
            energy_conserving,
        } = model
        else {
            return (Model::Diffuse(Color::Constant(Vec3::ZERO)), true);
        };
        let mut textures = PrincipledTextures {
            base_color: self.color(base_color),
            specular_transmission: self.number(specular_transmission),
            metallic: self.number(metallic),
            subsurface: self.number(subsurface),
            specular: self.number(specular),
            roughness: self.number(roughness),
            specular_tint: self.number(specular_tint),
            anisotropic: self.number(anisotropic),
            sheen: self.number(sheen),
            sheen_tint: self.number(sheen_tint),
            clearcoat: self.number(clearcoat),
            clearcoat_gloss: self.number(clearcoat_gloss),
            eta: self.number(eta),
            lobes: None,
            conserving: None,
        };
        if *energy_conserving {
            match textures.conserve() {
                Some(table) => textures.conserving = Some(Arc::new(table)),
                None => self.problem(
                    "energy_conserving",
                    "found textured parameters, expected numbers in all but \"base_color\": the albedo is tabulated once",
                ),
            }
        }
        (Model::Principled(Box::new(textures)), *two_sided)
    }

    fn problem(&mut self, field: &str, message: &str) {
        let path = format!("{}.{field}", self.path);
        self.problems.push(Problem::new(self.description.origin.clone(), &path, message.to_owned()));
    }

    fn facets(
        &mut self,
        distribution: Distribution,
        alpha: &NumberTexture,
        alpha_v: Option<&NumberTexture>,
    ) -> FacetTextures {
        let alpha_v = alpha_v.map(|alpha| self.number(alpha));
        FacetTextures { distribution, alpha: self.number(alpha), alpha_v }
    }

    /// A colour: pictures are sRGB unless they say otherwise.
    fn color(&mut self, color: &ColorTexture) -> Color {
        match color {
            ColorTexture::Constant(c) => Color::Constant(*c),
            ColorTexture::Texture(texture) => {
                Color::Texture(Arc::new(self.texture(texture, ColorSpace::Srgb)))
            }
        }
    }

    /// Three numbers that are no colour: linear unless they say otherwise.
    fn data(&mut self, color: &ColorTexture) -> Color {
        match color {
            ColorTexture::Constant(c) => Color::Constant(*c),
            ColorTexture::Texture(texture) => {
                Color::Texture(Arc::new(self.texture(texture, ColorSpace::Linear)))
            }
        }
    }

    fn number(&mut self, number: &NumberTexture) -> Number {
        match number {
            NumberTexture::Constant(n) => Number::Constant(*n),
            NumberTexture::Texture(texture) => {
                Number::Texture(Arc::new(self.texture(texture, ColorSpace::Linear)))
            }
        }
    }

    fn texture(&mut self, texture: &doc::Texture, space: ColorSpace) -> Texture {
        match texture {
            doc::Texture::Image { file, color_space, channel, wrap, filter, transform } => {
                let Some(image) = self.assets.image(file) else {
                    self.problem("file", &format!("the image {file} has not been loaded"));
                    return MISSING;
                };
                let natural = if image.is_float() { ColorSpace::Linear } else { space };
                Texture::Image(ImageTexture {
                    image,
                    color_space: color_space.unwrap_or(natural),
                    channel: *channel,
                    wrap: *wrap,
                    filter: *filter,
                    transform: single(transform),
                })
            }
            doc::Texture::Checkerboard { color0, color1, transform } => Texture::Checkerboard(Checkerboard {
                colors: [color0.0, color1.0],
                transform: single(transform),
            }),
            doc::Texture::Fbm { color0, color1, octaves, gain, lacunarity, frequency, seed, transform } => {
                Texture::Fbm(Fbm {
                    colors: [color0.0, color1.0],
                    octaves: *octaves,
                    gain: *gain,
                    lacunarity: *lacunarity,
                    frequency: *frequency,
                    seed: *seed,
                    transform: single(transform),
                })
            }
            doc::Texture::SolidCheckerboard { color0, color1, transform } => {
                Texture::SolidCheckerboard(SolidCheckerboard {
                    colors: [color0.0, color1.0],
                    transform: single_solid(transform),
                })
            }
            doc::Texture::SolidFbm {
                color0,
                color1,
                low,
                high,
                octaves,
                gain,
                lacunarity,
                frequency,
                seed,
                transform,
            } => {
                self.rises("high", [*low, *high], "low");
                let (octaves, gain, lacunarity) = (*octaves, *gain, *lacunarity);
                let (frequency, seed) = (*frequency, *seed);
                let parameters =
                    NoiseParameters { amplitude: 1.0, frequency, octaves, gain, lacunarity, seed };
                let Ok(noise) =
                    Noise::new(parameters).map_err(|error| self.problem("solid_fbm", &error.to_string()))
                else {
                    return MISSING;
                };
                let transform = single_solid(transform);
                Texture::SolidFbm(SolidFbm {
                    colors: [color0.0, color1.0],
                    noise,
                    range: [*low, *high],
                    transform,
                })
            }
            doc::Texture::OrbitTrap { color0, color1, trap, near, far } => {
                self.rises("far", [*near, *far], "near");
                Texture::OrbitTrap(OrbitTrap {
                    colors: [color0.0, color1.0],
                    trap: *trap,
                    range: [*near, *far],
                })
            }
        }
    }
}

impl PrincipledTextures {
    /// The factors that keep the model from gaining energy; `None` where another parameter than the base colour varies.
    ///
    /// Where that varies, they are those of the bases that reflect most: white, and in each channel the pure colour,
    /// whose tint (the base in units of its luminance) is the strongest.
    fn conserve(&self) -> Option<Conserving> {
        let bases = match self.base_color {
            Color::Constant(base) => vec![base],
            Color::Texture(_) => vec![Vec3::ONE, Vec3::X, Vec3::Y, Vec3::Z],
        };
        let with = |base| Self { base_color: Color::Constant(base), ..self.clone() };
        let models: Option<Vec<_>> = bases
            .into_iter()
            .map(|base| Some(with(base)).filter(Self::is_constant).map(|model| model.at(&Vec2::ZERO.into())))
            .collect();
        models.map(|models| Conserving::new(&models))
    }
}

/// A texture transform in single precision.
fn single(transform: &DAffine2) -> Affine2 {
    Affine2::from_cols_array(&transform.to_cols_array().map(|number| number as f32))
}

/// A transform of solid textures in single precision.
fn single_solid(transform: &DAffine3) -> Affine3A {
    Affine3A::from_cols_array(&transform.to_cols_array().map(|number| number as f32))
}
