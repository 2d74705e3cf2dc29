//! Owns the materials that are tested: every model at normal and at corner parameters, and the directions they are seen from.

use super::oracle::Disney;
use super::random::Random;
use super::trial::Scatterer;
use glam::{Vec2, Vec3};
use karst_core::bsdf::{
    Bsdf, BsdfSample, Coat, Conductor, Dielectric, Diffuse, Distribution, Lobes, Microfacets, Mirror,
    Parameters, Plastic, Principled, ThinDielectric,
};
use std::sync::Arc;

/// A material under its name. The truth that its weights are held against is the oracle where there is one.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) bsdf: Bsdf,
    /// Its parameters, where the oracle knows it.
    pub(crate) disney: Option<Disney>,
}

impl Scatterer for Case {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.bsdf.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.bsdf.pdf(wo, wi)
    }

    fn sample(&self, wo: Vec3, random: &mut Random) -> Option<BsdfSample> {
        Scatterer::sample(&self.bsdf, wo, random)
    }

    fn truth(&self, wo: Vec3, wi: Vec3) -> f64 {
        let mean = |p: &Disney| {
            p.value(wo.to_array().map(f64::from), wi.to_array().map(f64::from)).iter().sum::<f64>() / 3.0
        };
        self.disney.as_ref().map_or_else(|| f64::from(self.eval(wo, wi).element_sum()) / 3.0, mean)
    }
}

/// The renderer's parameters.
pub(crate) fn parameters(p: &Disney) -> Parameters {
    Parameters {
        base_color: Vec3::from_array(p.base_color),
        specular_transmission: p.specular_transmission,
        metallic: p.metallic,
        subsurface: p.subsurface,
        specular: p.specular,
        roughness: p.roughness,
        specular_tint: p.specular_tint,
        anisotropic: p.anisotropic,
        sheen: p.sheen,
        sheen_tint: p.sheen_tint,
        clearcoat: p.clearcoat,
        clearcoat_gloss: p.clearcoat_gloss,
        eta: p.eta,
    }
}

/// The renderer's model for these parameters.
pub(crate) fn principled(p: &Disney) -> Bsdf {
    Bsdf::Principled(Principled::new(&parameters(p)))
}

/// Facets of a distribution with widths along x and y.
pub(crate) fn facets(distribution: Distribution, x: f32, y: f32) -> Microfacets {
    Microfacets::new(distribution, Vec2::new(x, y))
}

/// Where a material is seen from: the cosine, and an azimuth that no symmetry hides.
pub(crate) fn view(degrees: f64, azimuth: f64) -> Vec3 {
    let (sin, cos) = libm::sincos(degrees.to_radians());
    let (y, x) = libm::sincos(azimuth);
    Vec3::new((sin * x) as f32, (sin * y) as f32, cos as f32).normalize()
}

/// From above, slanted, grazing, and from below.
pub(crate) fn views() -> [(f64, Vec3); 4] {
    [0.0, 45.0, 85.0, 125.0].map(|degrees| (degrees, view(degrees, 0.7)))
}

const WHITE: [f32; 3] = [1.0; 3];
const BROWN: [f32; 3] = [0.7, 0.4, 0.15];

/// Parameter sets of the whole model.
pub(crate) fn sets() -> Vec<(&'static str, Disney)> {
    let plain = Disney { base_color: BROWN, ..Disney::PLAIN };
    let metal = Disney { metallic: 1.0, ..plain };
    let glass = Disney { specular_transmission: 1.0, ..plain };
    vec![
        ("plain", plain),
        ("rough", Disney { roughness: 1.0, base_color: WHITE, ..plain }),
        ("polished", Disney { roughness: 0.05, specular: 1.0, ..plain }),
        ("mirror-like", Disney { roughness: 0.02, specular: 1.0, ..plain }),
        ("subsurface", Disney { subsurface: 1.0, roughness: 0.8, ..plain }),
        ("black with highlight", Disney { base_color: [0.0; 3], specular: 1.0, roughness: 0.3, ..plain }),
        ("black without highlight", Disney { base_color: [0.0; 3], specular: 0.0, roughness: 1.0, ..plain }),
        ("tinted highlight", Disney { specular: 1.0, specular_tint: 1.0, roughness: 0.2, ..plain }),
        ("metal", Disney { roughness: 0.3, ..metal }),
        ("metal rough", Disney { roughness: 1.0, base_color: WHITE, ..metal }),
        ("metal sharp", Disney { roughness: 0.02, ..metal }),
        ("metal brushed", Disney { roughness: 0.3, anisotropic: 1.0, ..metal }),
        ("metal brushed sharp", Disney { roughness: 0.01, anisotropic: 1.0, ..metal }),
        ("metal half", Disney { metallic: 0.5, roughness: 0.4, ..plain }),
        ("sheen", Disney { sheen: 1.0, sheen_tint: 1.0, roughness: 0.9, ..plain }),
        ("sheen on glass", Disney { sheen: 1.0, roughness: 0.1, base_color: WHITE, ..glass }),
        ("sheen alone", Disney { sheen: 1.0, base_color: [0.0; 3], specular: 0.0, ..plain }),
        ("clearcoat", Disney { clearcoat: 1.0, clearcoat_gloss: 0.5, roughness: 0.7, ..plain }),
        ("clearcoat glossy", Disney { clearcoat: 1.0, roughness: 0.7, ..plain }),
        (
            "clearcoat dull",
            Disney { clearcoat: 1.0, clearcoat_gloss: 0.0, base_color: [0.0; 3], specular: 0.0, ..plain },
        ),
        ("glass", Disney { roughness: 0.3, ..glass }),
        ("glass sharp", Disney { roughness: 0.05, base_color: WHITE, ..glass }),
        ("glass rough", Disney { roughness: 1.0, base_color: WHITE, ..glass }),
        ("glass brushed", Disney { roughness: 0.4, anisotropic: 1.0, ..glass }),
        ("glass bubble", Disney { roughness: 0.3, eta: 0.7, ..glass }),
        ("glass thin", Disney { roughness: 0.3, eta: 1.05, ..glass }),
        ("glass dense", Disney { roughness: 0.2, eta: 2.4, ..glass }),
        ("glass without contrast", Disney { roughness: 0.5, eta: 1.0, ..glass }),
        ("glass half", Disney { specular_transmission: 0.5, roughness: 0.3, ..plain }),
        ("everything", everything()),
    ]
}

/// Every lobe at once.
pub(crate) fn everything() -> Disney {
    Disney {
        base_color: BROWN,
        specular_transmission: 0.4,
        metallic: 0.3,
        subsurface: 0.5,
        specular: 0.8,
        roughness: 0.35,
        specular_tint: 0.5,
        anisotropic: 0.7,
        sheen: 0.6,
        sheen_tint: 0.4,
        clearcoat: 0.9,
        clearcoat_gloss: 0.6,
        eta: 1.45,
    }
}

/// All materials.
pub(crate) fn grid() -> Vec<Case> {
    let of_set = |(name, p): (&str, Disney)| {
        // Where glass has no contrast the model's refraction is a peak without width, which the renderer passes by.
        let disney = (p.eta != 1.0).then_some(p);
        Case { name: format!("principled {name}"), bsdf: principled(&p), disney }
    };
    let other = |(name, bsdf): (&str, Bsdf)| Case { name: name.to_owned(), bsdf, disney: None };
    let mut all: Vec<Case> = sets().into_iter().map(of_set).collect();
    all.extend(lobes().into_iter().map(other));
    all.extend(dielectrics().into_iter().map(other));
    all.extend(opaque().into_iter().map(other));
    all
}

/// The lobes of the whole model alone.
fn lobes() -> Vec<(&'static str, Bsdf)> {
    let p = Disney {
        base_color: BROWN,
        roughness: 0.4,
        anisotropic: 0.5,
        metallic: 1.0,
        sheen_tint: 0.5,
        clearcoat_gloss: 0.8,
        ..Disney::PLAIN
    };
    let alone = |lobes: Lobes, p: &Disney| Bsdf::Principled(Principled::with_lobes(&parameters(p), lobes));
    let none = Lobes::default();
    vec![
        ("disney_diffuse", alone(Lobes { diffuse: 1.0, ..none }, &p)),
        ("disney_sheen", alone(Lobes { sheen: 1.0, ..none }, &p)),
        ("disney_metal", alone(Lobes { metal: 1.0, ..none }, &p)),
        ("disney_clearcoat", alone(Lobes { clearcoat: 1.0, ..none }, &p)),
        ("disney_glass", alone(Lobes { glass: 1.0, ..none }, &p)),
        (
            "disney_glass smooth",
            alone(Lobes { glass: 1.0, ..none }, &Disney { roughness: 0.0, base_color: WHITE, ..p }),
        ),
    ]
}

fn dielectrics() -> Vec<(&'static str, Bsdf)> {
    let glass =
        |ior, facets| Bsdf::Dielectric(Dielectric::new(ior, facets, Vec3::ONE, Vec3::new(0.9, 0.8, 0.7)));
    let (ggx, beckmann) = (Distribution::Ggx, Distribution::Beckmann);
    let (reflectance, transmittance) = (Vec3::ONE, Vec3::splat(0.8));
    vec![
        ("dielectric smooth", glass(1.5, None)),
        ("dielectric ggx 0.1", glass(1.5, Some(facets(ggx, 0.1, 0.1)))),
        ("dielectric ggx 0.5", glass(1.5, Some(facets(ggx, 0.5, 0.5)))),
        ("dielectric ggx 1 × 0.1", glass(1.33, Some(facets(ggx, 1.0, 0.1)))),
        ("dielectric ggx 0.3, ior 0.6", glass(0.6, Some(facets(ggx, 0.3, 0.3)))),
        ("dielectric ggx 0.3, ior 1.05", glass(1.05, Some(facets(ggx, 0.3, 0.3)))),
        ("dielectric beckmann 0.05", glass(1.5, Some(facets(beckmann, 0.05, 0.05)))),
        ("dielectric beckmann 0.5", glass(1.5, Some(facets(beckmann, 0.5, 0.5)))),
        ("thin_dielectric", Bsdf::ThinDielectric(ThinDielectric { ior: 1.5, reflectance, transmittance })),
    ]
}

fn opaque() -> Vec<(&'static str, Bsdf)> {
    let (ggx, beckmann) = (Distribution::Ggx, Distribution::Beckmann);
    let gold = Some((Vec3::new(0.143, 0.375, 1.442), Vec3::new(3.983, 2.386, 1.603)));
    let metal = |index, facets| Bsdf::Conductor(Conductor { index, reflectance: Vec3::ONE, facets });
    let plastic = |facets, nonlinear| {
        let coat = Arc::new(Coat::new(1.5, facets));
        Bsdf::Plastic(Plastic { diffuse: Vec3::from_array(BROWN), specular: Vec3::ONE, nonlinear, coat })
    };
    vec![
        ("diffuse", Bsdf::Diffuse(Diffuse { reflectance: Vec3::from_array(BROWN) })),
        ("mirror", Bsdf::Mirror(Mirror { reflectance: Vec3::splat(0.9) })),
        ("conductor smooth", metal(gold, None)),
        ("conductor ggx 0.3", metal(gold, Some(facets(ggx, 0.3, 0.3)))),
        ("conductor ggx 0.02", metal(gold, Some(facets(ggx, 0.02, 0.02)))),
        ("conductor ggx 0.0001", metal(None, Some(facets(ggx, 0.0001, 0.0001)))),
        ("conductor ggx 1", metal(None, Some(facets(ggx, 1.0, 1.0)))),
        ("conductor ggx 0.5 × 0.05", metal(gold, Some(facets(ggx, 0.5, 0.05)))),
        ("conductor beckmann 0.1", metal(gold, Some(facets(beckmann, 0.1, 0.1)))),
        ("conductor beckmann 1", metal(None, Some(facets(beckmann, 1.0, 1.0)))),
        ("plastic smooth", plastic(None, false)),
        ("plastic ggx 0.1", plastic(Some(facets(ggx, 0.1, 0.1)), true)),
        ("plastic beckmann 0.4", plastic(Some(facets(beckmann, 0.4, 0.4)), false)),
    ]
}
