//! Owns the Disney BSDF in f64: what the renderer's own is compared with, written lobe by lobe from the equations of
//! Burley 2012 and 2015 as they are taught in UCSD CSE 272, and itself held against a table made with numpy.

use std::f64::consts::{FRAC_1_PI, PI};

/// A direction or a colour.
pub(crate) type Triple = [f64; 3];

/// The thirteen parameters, as numbers that an f32 holds exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disney {
    pub(crate) base_color: [f32; 3],
    pub(crate) specular_transmission: f32,
    pub(crate) metallic: f32,
    pub(crate) subsurface: f32,
    pub(crate) specular: f32,
    pub(crate) roughness: f32,
    pub(crate) specular_tint: f32,
    pub(crate) anisotropic: f32,
    pub(crate) sheen: f32,
    pub(crate) sheen_tint: f32,
    pub(crate) clearcoat: f32,
    pub(crate) clearcoat_gloss: f32,
    pub(crate) eta: f32,
}

impl Disney {
    /// The model with every share at 0.
    pub(crate) const PLAIN: Self = Self {
        base_color: [0.5; 3],
        specular_transmission: 0.0,
        metallic: 0.0,
        subsurface: 0.0,
        specular: 0.5,
        roughness: 0.5,
        specular_tint: 0.0,
        anisotropic: 0.0,
        sheen: 0.0,
        sheen_tint: 0.0,
        clearcoat: 0.0,
        clearcoat_gloss: 1.0,
        eta: 1.5,
    };

    /// The value of the model times the cosine of `wi`, for unit directions in the frame of the surface.
    pub(crate) fn value(&self, wo: Triple, wi: Triple) -> Triple {
        let p = Wide::new(self);
        let glass = (1.0 - p.metallic) * p.transmission;
        let mut sum = if glass > 0.0 { scaled(glass, p.glass(wo, wi)) } else { [0.0; 3] };
        if wo[2] > 0.0 && wi[2] > 0.0 {
            let pair = Pair::new(wo, wi);
            let opaque = 1.0 - p.transmission * (1.0 - p.metallic);
            add(&mut sum, (1.0 - p.transmission) * (1.0 - p.metallic), p.diffuse(&pair));
            add(&mut sum, (1.0 - p.metallic) * p.sheen, p.cloth(&pair));
            add(&mut sum, opaque, p.metal(&pair));
            add(&mut sum, 0.25 * p.clearcoat, p.coat(&pair));
        }
        sum
    }
}

/// The parameters in f64, and what follows from them.
struct Wide {
    base: Triple,
    tint: Triple,
    transmission: f64,
    metallic: f64,
    subsurface: f64,
    specular: f64,
    roughness: f64,
    specular_tint: f64,
    sheen: f64,
    sheen_tint: f64,
    clearcoat: f64,
    gloss: f64,
    eta: f64,
    facets: Facets,
}

/// Microfacets of these widths.
struct Facets(f64, f64);

/// Two directions above the surface, and what all lobes ask of them.
struct Pair {
    wo: Triple,
    wi: Triple,
    h: Triple,
    hi: f64,
}

impl Pair {
    fn new(wo: Triple, wi: Triple) -> Self {
        let h = unit(std::array::from_fn(|c| wo[c] + wi[c]));
        Self { wo, wi, h, hi: dot(h, wi).abs() }
    }
}

impl Wide {
    fn new(p: &Disney) -> Self {
        let base = p.base_color.map(f64::from);
        let luminance = dot(base, [0.212_671, 0.715_160, 0.072_169]);
        let aspect = (1.0 - 0.9 * f64::from(p.anisotropic)).sqrt();
        let square = f64::from(p.roughness).powi(2);
        Self {
            base,
            tint: if luminance > 0.0 { base.map(|c| c / luminance) } else { [1.0; 3] },
            transmission: p.specular_transmission.into(),
            metallic: p.metallic.into(),
            subsurface: p.subsurface.into(),
            specular: p.specular.into(),
            roughness: p.roughness.into(),
            specular_tint: p.specular_tint.into(),
            sheen: p.sheen.into(),
            sheen_tint: p.sheen_tint.into(),
            clearcoat: p.clearcoat.into(),
            gloss: p.clearcoat_gloss.into(),
            eta: p.eta.into(),
            facets: Facets((square / aspect).max(1e-4), (square * aspect).max(1e-4)),
        }
    }

    fn diffuse(&self, pair: &Pair) -> Triple {
        let (no, ni) = (pair.wo[2], pair.wi[2]);
        let flat = self.roughness * pair.hi * pair.hi;
        let at = |grazing: f64, cos: f64| 1.0 + (grazing - 1.0) * fifth(cos);
        let base = FRAC_1_PI * at(0.5 + 2.0 * flat, no) * at(0.5 + 2.0 * flat, ni);
        let product = at(flat, no) * at(flat, ni);
        let under = 1.25 * FRAC_1_PI * (product * (1.0 / (no + ni) - 0.5) + 0.5);
        scaled(ni * (base + self.subsurface * (under - base)), self.base)
    }

    fn cloth(&self, pair: &Pair) -> Triple {
        scaled(fifth(pair.hi) * pair.wi[2], mixed(self.sheen_tint, self.tint))
    }

    fn metal(&self, pair: &Pair) -> Triple {
        let highlight = self.specular * normal(self.eta) * (1.0 - self.metallic);
        let spread = self.facets.density(pair.h) * self.facets.seen(pair.wo) * self.facets.seen(pair.wi);
        let tint = mixed(self.specular_tint, self.tint);
        std::array::from_fn(|c| {
            let c0 = highlight * tint[c] + self.metallic * self.base[c];
            (c0 + (1.0 - c0) * fifth(pair.hi)) * spread / (4.0 * pair.wo[2])
        })
    }

    fn coat(&self, pair: &Pair) -> Triple {
        let alpha = 0.1 + self.gloss * (0.001 - 0.1);
        let a2 = alpha * alpha;
        let density = (a2 - 1.0)
            / (PI * libm::log(a2) * (pair.h[0].powi(2) + pair.h[1].powi(2) + a2 * pair.h[2].powi(2)));
        let masks = Facets(0.25, 0.25);
        let fresnel = 0.04 + 0.96 * fifth(pair.hi);
        [fresnel * density * masks.seen(pair.wo) * masks.seen(pair.wi) / (4.0 * pair.wo[2]); 3]
    }

    fn glass(&self, wo: Triple, wi: Triple) -> Triple {
        let eta = if wo[2] > 0.0 { self.eta } else { 1.0 / self.eta };
        let same = wo[2] * wi[2] > 0.0;
        let factor = if same { 1.0 } else { eta };
        let mut h = unit(std::array::from_fn(|c| wo[c] + factor * wi[c]));
        if h[2] < 0.0 {
            h = h.map(|c| -c);
        }
        let (ho, hi) = (dot(h, wo), dot(h, wi));
        let reflected = dielectric(ho.abs(), eta);
        let spread = self.facets.density(h) * self.facets.seen(wo) * self.facets.seen(wi) / wo[2].abs();
        if same {
            return scaled(reflected * spread / 4.0, self.base);
        }
        if ho * wo[2] <= 0.0 || hi * wi[2] <= 0.0 {
            return [0.0; 3];
        }
        let through = (1.0 - reflected) * spread * (ho * hi).abs() / (ho + eta * hi).powi(2).max(1e-300);
        self.base.map(|c| c.sqrt() * through)
    }
}

impl Facets {
    fn density(&self, h: Triple) -> f64 {
        let sum = (h[0] / self.0).powi(2) + (h[1] / self.1).powi(2) + h[2] * h[2];
        1.0 / (PI * self.0 * self.1 * sum * sum)
    }

    fn seen(&self, w: Triple) -> f64 {
        let slope2 = ((w[0] * self.0).powi(2) + (w[1] * self.1).powi(2)) / (w[2] * w[2]);
        2.0 / (1.0 + (1.0 + slope2).sqrt())
    }
}

fn dielectric(cos: f64, eta: f64) -> f64 {
    let rest = 1.0 - (1.0 - cos * cos) / (eta * eta);
    if rest < 0.0 {
        return 1.0;
    }
    let inner = rest.sqrt();
    let s = (cos - eta * inner) / (cos + eta * inner);
    let p = (eta * cos - inner) / (eta * cos + inner);
    f64::midpoint(s * s, p * p)
}

fn normal(eta: f64) -> f64 {
    ((eta - 1.0) / (eta + 1.0)).powi(2)
}

fn fifth(cos: f64) -> f64 {
    (1.0 - cos).powi(5)
}

/// From white to a tint.
fn mixed(share: f64, tint: Triple) -> Triple {
    tint.map(|c| 1.0 - share + share * c)
}

fn dot(a: Triple, b: Triple) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(v: Triple) -> Triple {
    let length = dot(v, v).sqrt().max(1e-30);
    v.map(|c| c / length)
}

fn scaled(factor: f64, v: Triple) -> Triple {
    v.map(|c| c * factor)
}

fn add(sum: &mut Triple, factor: f64, v: Triple) {
    for (s, c) in sum.iter_mut().zip(v) {
        *s += factor * c;
    }
}
