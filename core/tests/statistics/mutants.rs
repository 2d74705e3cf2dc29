//! Owns samplers that are wrong on purpose, each in a way that renderers have been wrong: the tests must see every one.

use super::FAMILY;
use super::chi2::sidak;
use super::materials::{facets, principled, view};
use super::oracle::Disney;
use super::random::Random;
use super::report::table;
use super::trial::{Effort, Scatterer, bent, run};
use glam::{Vec2, Vec3};
use karst_core::bsdf::{Bsdf, BsdfSample, Conductor, Diffuse, Distribution, Microfacets};

type Sampling = Box<dyn Fn(Vec3, &mut Random) -> Option<BsdfSample>>;

/// What must see the mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Finder {
    /// Directions do not have the density.
    Directions,
    /// The mean weight is not the integral of the value, or weights have no bound.
    Weights,
    /// Nothing: it is right, which shows that the others fail by their mistake.
    Nothing,
}

struct Mutant {
    name: &'static str,
    wo: Vec3,
    finder: Finder,
    eval: Box<dyn Fn(Vec3, Vec3) -> Vec3>,
    pdf: Box<dyn Fn(Vec3, Vec3) -> f32>,
    sample: Sampling,
}

impl Scatterer for Mutant {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        (self.eval)(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        (self.pdf)(wo, wi)
    }

    fn sample(&self, wo: Vec3, random: &mut Random) -> Option<BsdfSample> {
        (self.sample)(wo, random)
    }
}

impl Mutant {
    /// The model itself.
    fn of(name: &'static str, finder: Finder, degrees: f64, bsdf: &Bsdf) -> Self {
        let (e, p, s) = (bsdf.clone(), bsdf.clone(), bsdf.clone());
        Self {
            name,
            wo: view(degrees, 0.7),
            finder,
            eval: Box::new(move |wo, wi| e.eval(wo, wi)),
            pdf: Box::new(move |wo, wi| p.pdf(wo, wi)),
            sample: Box::new(move |wo, random| Scatterer::sample(&s, wo, random)),
        }
    }

    fn with_pdf(self, pdf: impl Fn(Vec3, Vec3) -> f32 + 'static) -> Self {
        Self { pdf: Box::new(pdf), ..self }
    }

    /// Directions from this function, weights as they follow.
    fn with_directions(self, draw: impl Fn(Vec3, &mut Random) -> Option<Vec3> + 'static) -> Self {
        let Self { name, wo, finder, eval, pdf, .. } = self;
        let (eval, pdf) = (std::rc::Rc::new(eval), std::rc::Rc::new(pdf));
        let (e, p) = (eval.clone(), pdf.clone());
        let sample: Sampling = Box::new(move |wo, random| {
            let wi = draw(wo, random)?;
            let pdf = p(wo, wi);
            (pdf > 0.0).then(|| BsdfSample { wi, weight: e(wo, wi) / pdf, pdf, eta2: 1.0 })
        });
        Self {
            name,
            wo,
            finder,
            eval: Box::new(move |wo, wi| eval(wo, wi)),
            pdf: Box::new(move |wo, wi| pdf(wo, wi)),
            sample,
        }
    }

    /// Samples of the model, changed.
    fn with_samples(self, change: impl Fn(BsdfSample, &mut Random) -> Option<BsdfSample> + 'static) -> Self {
        let Self { sample, .. } = self;
        Self { sample: Box::new(move |wo, random| change(sample(wo, random)?, random)), ..self }
    }
}

const BROWN: [f32; 3] = [0.7, 0.4, 0.15];

fn conductor(alpha: Vec2) -> (Bsdf, Microfacets) {
    let facets = Microfacets::new(Distribution::Ggx, alpha);
    (Bsdf::Conductor(Conductor { index: None, reflectance: Vec3::ONE, facets: Some(facets) }), facets)
}

fn set(p: Disney) -> Bsdf {
    principled(&Disney { base_color: BROWN, ..p })
}

fn half(wo: Vec3, wi: Vec3) -> Vec3 {
    (wo + wi).normalize()
}

/// Mistakes in mixing lobes.
fn mixtures() -> Vec<Mutant> {
    use Finder::{Directions, Nothing, Weights};
    let diffuse = Bsdf::Diffuse(Diffuse { reflectance: Vec3::splat(0.5) });
    let (metal, _) = conductor(Vec2::splat(0.3));
    let both = |finder, name| {
        let (a, b) = (diffuse.clone(), metal.clone());
        let (c, d) = (diffuse.clone(), metal.clone());
        Mutant::of(name, finder, 45.0, &diffuse)
            .with_pdf(move |wo, wi| 0.5 * (a.pdf(wo, wi) + b.pdf(wo, wi)))
            .with_directions(move |wo, random| {
                let of = if random.chance(0.5) { &c } else { &d };
                Scatterer::sample(of, wo, random).map(|s| s.wi)
            })
    };
    let (a, b) = (diffuse.clone(), metal.clone());
    let forgets = Mutant {
        pdf: Box::new(move |wo, wi| a.pdf(wo, wi) + b.pdf(wo, wi)),
        ..both(Directions, "density without the choice of the lobe")
    };
    let a = diffuse.clone();
    let alone = Mutant {
        pdf: Box::new(move |wo, wi| a.pdf(wo, wi)),
        ..both(Directions, "density of one lobe of two")
    };
    let plain = set(Disney { roughness: 0.3, specular: 1.0, ..Disney::PLAIN });
    let again = plain.clone();
    let shared = Mutant {
        sample: Box::new(move |wo, random| {
            let u = random.pair();
            again.sample(wo, u.x, u)
        }),
        ..Mutant::of("one number for the lobe and its direction", Directions, 45.0, &plain)
    };
    let glass = Disney { specular_transmission: 1.0, roughness: 0.1, ..Disney::PLAIN };
    let (covered, bare) = (set(Disney { sheen: 1.0, ..glass }), set(glass));
    let uncovered = Mutant {
        eval: Box::new(move |wo, wi| covered.eval(wo, wi)),
        ..Mutant::of("sheen that no lobe covers", Weights, 45.0, &bare)
    };
    let (value, density) = (set(Disney { sheen: 1.0, ..glass }), set(glass));
    let uncovered = Mutant {
        sample: Box::new(move |wo, random| {
            let s = Scatterer::sample(&density, wo, random)?;
            Some(BsdfSample { weight: value.eval(wo, s.wi) / s.pdf, ..s })
        }),
        ..uncovered
    };
    let lossy = Mutant::of("one sample in a hundred lost", Directions, 45.0, &diffuse)
        .with_samples(|s, random| (!random.chance(0.01)).then_some(s));
    vec![both(Nothing, "right: two lobes"), forgets, alone, shared, uncovered, lossy]
}

/// Mistakes at microfacets.
fn reflections() -> Vec<Mutant> {
    use Finder::{Directions, Weights};
    let diffuse = Bsdf::Diffuse(Diffuse { reflectance: Vec3::splat(0.5) });
    let (metal, _) = conductor(Vec2::splat(0.3));
    let (wider, _) = conductor(Vec2::splat(0.315));
    let (brushed, _) = conductor(Vec2::new(0.5, 0.1));
    let (turned, _) = conductor(Vec2::new(0.1, 0.5));
    let (rough, wide) = conductor(Vec2::splat(0.8));
    let coat = principled(&Disney {
        base_color: [0.0; 3],
        specular: 0.0,
        clearcoat: 1.0,
        clearcoat_gloss: 0.0,
        ..Disney::PLAIN
    });
    let dull = coat.clone();
    vec![
        Mutant::of("density without the cosine", Directions, 45.0, &diffuse)
            .with_pdf(|_, wi| if wi.z > 0.0 { 0.5 * std::f32::consts::FRAC_1_PI } else { 0.0 }),
        Mutant::of("density of facets 5 % wider", Directions, 45.0, &metal)
            .with_pdf(move |wo, wi| wider.pdf(wo, wi)),
        Mutant::of("widths along x and y exchanged", Directions, 45.0, &brushed)
            .with_pdf(move |wo, wi| turned.pdf(wo, wi)),
        Mutant::of("reflections below the horizon folded up", Directions, 85.0, &rough).with_directions(
            move |wo, random| {
                let wi = wide.sample_reflection(wo, random.pair());
                Some(wi.with_z(wi.z.abs()))
            },
        ),
        Mutant::of("density of all visible facets for a cap of them", Directions, 45.0, &rough).with_pdf(
            move |wo, wi| {
                let h = half(wo, wi);
                if wi.z > 0.0 { wide.visible_pdf(wo, h) / (4.0 * wo.dot(h)) } else { 0.0 }
            },
        ),
        Mutant::of("clearcoat density without the facet's cosine", Directions, 45.0, &coat)
            .with_pdf(move |wo, wi| dull.pdf(wo, wi) / half(wo, wi).z),
        Mutant::of("weights 1 % too bright", Weights, 45.0, &metal)
            .with_samples(|s, _| Some(BsdfSample { weight: s.weight * 1.01, ..s })),
    ]
}

/// Mistakes at glass.
fn refractions() -> Vec<Mutant> {
    use Finder::{Directions, Nothing, Weights};
    let glass = set(Disney { specular_transmission: 1.0, roughness: 0.8, ..Disney::PLAIN });
    let wide = facets(Distribution::Ggx, 0.64, 0.64);
    let own = |finder, name, degrees, keep: bool, by_surface: bool| {
        Mutant::of(name, finder, degrees, &glass)
            .with_directions(move |wo, random| refracted(&wide, wo, random, keep, by_surface))
    };
    let (a, b, c) = (glass.clone(), glass.clone(), glass.clone());
    vec![
        own(Nothing, "right: glass", 45.0, false, false),
        own(Nothing, "right: glass from inside", 125.0, false, false),
        own(Directions, "refractions that end on the same side kept", 100.0, true, false),
        own(Directions, "reflection chosen by the surface's Fresnel term", 45.0, false, true),
        Mutant::of("refraction's density without η²", Directions, 45.0, &glass)
            .with_pdf(move |wo, wi| a.pdf(wo, wi) / if wi.z < 0.0 { 2.25 } else { 1.0 }),
        Mutant::of("inside has the lobes of outside", Directions, 125.0, &glass)
            .with_pdf(move |wo, wi| 0.5 * b.pdf(wo, wi)),
        Mutant::of("light from behind ignored by the density", Directions, 125.0, &glass)
            .with_pdf(move |wo, wi| if wi.z > 0.0 { 0.0 } else { c.pdf(wo, wi) }),
        Mutant::of("weights without 1/η²", Weights, 45.0, &glass)
            .with_samples(|s, _| Some(BsdfSample { weight: s.weight * s.eta2, ..s })),
    ]
}

/// Rough glass of index 1.5 with mistakes to choose from.
fn refracted(
    facets: &Microfacets,
    wo: Vec3,
    random: &mut Random,
    keep: bool,
    by_surface: bool,
) -> Option<Vec3> {
    let h = facets.sample_visible(wo, random.pair());
    let eta = if wo.z > 0.0 { 1.5 } else { 1.0 / 1.5 };
    let cos = wo.dot(h);
    // In the frame of the facet the refraction is that of a plane.
    let flat =
        |cos: f32| bent(Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos), eta).map(|t| t.z.abs());
    let fresnel = |cos: f32| {
        let cos = cos.abs();
        flat(cos).map_or(1.0, |t| {
            0.5 * (((cos - eta * t) / (cos + eta * t)).powi(2) + ((eta * cos - t) / (eta * cos + t)).powi(2))
        })
    };
    let wi = if random.unit() < fresnel(if by_surface { wo.z } else { cos }) {
        let wi = (h * (2.0 * cos) - wo).normalize();
        return (wi.z * wo.z > 0.0).then_some(wi);
    } else {
        let t = flat(cos.abs())?;
        (h * (cos / eta - t * cos.signum()) - wo / eta).normalize()
    };
    if keep { Some(wi) } else { (wi.z * wo.z < 0.0).then_some(wi) }
}

#[test]
fn wrong_samplers_are_found() {
    // As strict as the test of the whole grid, which has fewer tests than this.
    let level = sidak(FAMILY, 1000);
    let mut rows = Vec::new();
    let mut wrong = Vec::new();
    for mutant in mixtures().into_iter().chain(reflections()).chain(refractions()) {
        let o = run(&mutant, mutant.wo, Effort { seed: 7, ..Effort::SHORT });
        let unbounded = o.largest > 10.0;
        let found = match mutant.finder {
            Finder::Directions => o.verdict.p < level || o.mass > 1.003,
            Finder::Weights => o.albedo_p() < level || unbounded,
            Finder::Nothing => o.verdict.p > level && o.albedo_p() > level && o.mass < 1.003,
        };
        rows.push(vec![
            mutant.name.to_owned(),
            format!("{:?}", mutant.finder),
            format!("{:.1e}", o.verdict.p),
            format!("{:.3}", o.mass),
            format!("{:.1e}", o.albedo_p()),
            format!("{:.1}", o.largest),
            if found { "as expected".to_owned() } else { "NOT FOUND".to_owned() },
        ]);
        if !found {
            wrong.push(mutant.name);
        }
    }
    println!(
        "{}",
        table(&["sampler", "found by", "p (χ²)", "∫ pdf", "p (mean)", "largest weight", ""], &rows)
    );
    println!("level {level:.1e}");
    assert!(wrong.is_empty(), "{wrong:?}");
}
