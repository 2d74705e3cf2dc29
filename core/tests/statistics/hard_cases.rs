//! Owns the hard cases of materials: narrow peaks, grazing views, indices near 1, total reflection. Each has its number.

use super::albedos::albedo;
use super::materials::{parameters, principled, view};
use super::oracle::Disney;
use super::random::Random;
use super::trial::{Effort, run};
use glam::{DVec3, Vec2, Vec3};
use karst_core::bsdf::{Bsdf, Dielectric, Distribution, Lobes, Microfacets, Principled};

const WHITE: Disney = Disney { base_color: [1.0; 3], ..Disney::PLAIN };

/// The density of facets near a very narrow peak, in f32 against f64 of the same half vectors.
#[test]
fn case_01_the_narrowest_peak_keeps_its_digits() {
    let alpha = 1e-4_f32;
    let facets = Microfacets::new(Distribution::Ggx, Vec2::splat(alpha));
    let mut random = Random::new(1);
    let mut worst: f64 = 0.0;
    for _ in 0..100_000 {
        let (r, angle) = (alpha * 5.0 * random.unit(), std::f64::consts::TAU * f64::from(random.unit()));
        let (sin, cos) = libm::sincos(angle);
        let h = Vec3::new(r * cos as f32, r * sin as f32, 1.0).normalize();
        let got = f64::from(facets.density(h));
        let (a, h) = (f64::from(alpha), h.as_dvec3());
        let s = (h.x / a).powi(2) + (h.y / a).powi(2) + h.z * h.z;
        let want = 1.0 / (std::f64::consts::PI * a * a * s * s);
        assert!(got.is_finite());
        worst = worst.max((got / want - 1.0).abs());
    }
    println!("worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
}

/// The clearcoat alone against the oracle, which has it at a quarter and beside a highlight of nothing.
#[test]
fn case_02_the_sharpest_clearcoat_keeps_its_digits() {
    let coat = Disney { base_color: [0.0; 3], clearcoat: 1.0, clearcoat_gloss: 1.0, ..Disney::PLAIN };
    let bsdf = Bsdf::Principled(Principled::with_lobes(
        &parameters(&coat),
        Lobes { clearcoat: 0.25, ..Lobes::default() },
    ));
    // All that the oracle adds to it: the metal lobe, which these parameters leave (1 − h·ωi)⁵ of.
    let without = Disney { clearcoat: 0.0, ..coat };
    let mut random = Random::new(2);
    let mut worst: f64 = 0.0;
    for _ in 0..100_000 {
        let wo = view(f64::from(random.between(0.0, 80.0)), f64::from(random.between(0.0, 6.0)));
        let wi = (Vec3::new(-wo.x, -wo.y, wo.z) + random.direction() * random.between(0.0, 0.01)).normalize();
        if wi.z <= 0.0 {
            continue;
        }
        let (o, i) = (wo.to_array().map(f64::from), wi.to_array().map(f64::from));
        let want = coat.value(o, i)[0] - without.value(o, i)[0];
        let got = f64::from(bsdf.eval(wo, wi).x);
        worst = worst.max((got / want - 1.0).abs());
    }
    println!("worst relative error {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
    let outcome = run(&bsdf, view(30.0, 1.0), Effort { seed: 2, ..Effort::SHORT });
    assert!(outcome.verdict.p > 1e-5, "{outcome:?}");
}

#[test]
fn case_03_metal_at_a_grazing_view_sends_back_what_quadrature_says() {
    for roughness in [0.05, 0.2, 0.5, 1.0] {
        let metal = Disney { metallic: 1.0, roughness, ..WHITE };
        let wo = view(libm::acos(1e-4).to_degrees(), 0.3);
        let outcome = run(&principled(&metal), wo, Effort { seed: 3, ..Effort::SHORT });
        let want = albedo(&metal, wo);
        println!(
            "roughness {roughness}: {:?}, quadrature {want:.5}, greatest weight {:.3}",
            outcome.mean, outcome.largest
        );
        assert!(outcome.broken == 0 && outcome.largest.is_finite());
        assert!(
            (outcome.mean.0 / want - 1.0).abs() < 5e-3,
            "roughness {roughness}: {:?} against {want}",
            outcome.mean
        );
    }
}

#[test]
fn case_04_the_most_brushed_metal_has_its_density() {
    let metal = Disney { metallic: 1.0, roughness: 0.01, anisotropic: 1.0, ..WHITE };
    // Turning the view about the normal is turning the frame.
    for azimuth in [0.0, 0.3, std::f64::consts::FRAC_PI_2, 4.0] {
        let outcome = run(&principled(&metal), view(50.0, azimuth), Effort { seed: 4, ..Effort::SHORT });
        println!(
            "azimuth {azimuth:.2}: p {:.2e}, mean {:?}, integral {:.5}",
            outcome.verdict.p, outcome.mean, outcome.albedo
        );
        assert!(outcome.broken == 0 && outcome.verdict.p > 1e-5 && outcome.albedo_p() > 1e-5, "{outcome:?}");
    }
}

/// Mean colour that a surface lets through to directions near straight on, and all it scatters.
fn passed(bsdf: &Bsdf, wo: Vec3) -> (Vec3, Vec3) {
    let mut random = Random::new(5);
    let (mut straight, mut all) = (Vec3::ZERO, Vec3::ZERO);
    let n = 1 << 14;
    for _ in 0..n {
        let lobe = random.unit();
        if let Some(s) = bsdf.sample(wo, lobe, random.pair()) {
            assert!(s.wi.is_finite() && s.weight.is_finite());
            all += s.weight * s.eta2;
            if s.wi.dot(-wo) > 0.9999 {
                straight += s.weight * s.eta2;
            }
        }
    }
    (straight / n as f32, all / n as f32)
}

/// Where there is no contrast light passes unchanged but for the tint, and the step to where refraction is computed is
/// not seen. Rough facets still mask each other there, by the model: the step is what they mask and no more.
#[test]
fn case_05_glass_of_no_contrast_is_not_there() {
    let wo = view(40.0, 0.8);
    let at = |eta: f32, roughness: f32| {
        principled(&Disney {
            base_color: [0.81, 0.49, 0.25],
            specular_transmission: 1.0,
            eta,
            roughness,
            ..Disney::PLAIN
        })
    };
    let tint = Vec3::new(0.9, 0.7, 0.5);
    for roughness in [0.0_f32, 0.1, 0.3, 1.0] {
        let masked =
            1.0 - Microfacets::new(Distribution::Ggx, Vec2::splat(roughness * roughness)).unmasked(wo);
        for eta in [1.0, 1.0 + 1e-6, 1.0 - 1e-6, 1.0 + 1e-4, 1.0 - 1e-4] {
            let (straight, all) = passed(&at(eta, roughness), wo);
            assert!(
                (straight - tint).abs().max_element() < 1e-3,
                "eta {eta}, roughness {roughness}: {straight}"
            );
            assert!((all - tint).abs().max_element() < 1e-3, "eta {eta}, roughness {roughness}: {all}");
        }
        let (below, above) =
            (passed(&at(1.000_999, roughness), wo).1, passed(&at(1.001_001, roughness), wo).1);
        let step = (below - above).abs().max_element();
        println!(
            "roughness {roughness}: step {step:.5}, masked {masked:.5}; at index 1.01 {}",
            passed(&at(1.01, roughness), wo).1
        );
        assert!(step < 1e-3 + masked, "roughness {roughness}: {below} {above}");
        assert!(roughness > 0.1 || step < 1e-3, "roughness {roughness}: {below} {above}");
    }
}

/// From inside beyond the critical angle everything is reflected, at it nothing is lost or undefined.
#[test]
fn case_07_total_reflection() {
    let critical = libm::asin(1.0 / 1.5).to_degrees();
    let smooth = Bsdf::Dielectric(Dielectric::new(1.5, None, Vec3::ONE, Vec3::ONE));
    let sharp = principled(&Disney { specular_transmission: 1.0, roughness: 0.0, ..WHITE });
    let rough = principled(&Disney { specular_transmission: 1.0, roughness: 0.3, ..WHITE });
    for degrees in
        [89.99, 60.0, critical + 1e-3, critical, critical + 1e-6, critical - 1e-6, critical - 1e-3, 0.0]
    {
        let wo = -view(degrees, 0.2);
        for (name, bsdf) in [("smooth", &smooth), ("sharp", &sharp), ("rough", &rough)] {
            let mut random = Random::new(7);
            let mut sum = 0.0;
            for _ in 0..4096 {
                let lobe = random.unit();
                let Some(s) = bsdf.sample(wo, lobe, random.pair()) else { continue };
                assert!(
                    s.wi.is_finite() && s.weight.is_finite() && s.pdf > 0.0,
                    "{name} at {degrees}: {s:?}"
                );
                let (f, pdf) = bsdf.scatter(wo, s.wi);
                assert!(f.is_finite() && pdf.is_finite(), "{name} at {degrees}: {f} {pdf}");
                sum += f64::from(s.weight.x * s.eta2) / 4096.0;
                if degrees > critical + 1e-4 && name == "smooth" {
                    assert!(s.wi.z < 0.0 && s.weight == Vec3::ONE, "{degrees}: {s:?}");
                }
            }
            if name == "smooth" {
                assert!((sum - 1.0).abs() < 1e-3, "{name} at {degrees}: {sum}");
            } else {
                assert!(sum < 1.01 && sum > 0.5, "{name} at {degrees}: {sum}");
            }
        }
    }
}

/// Sheen has a lobe that covers it, so weights have a bound.
#[test]
fn case_08_sheen_on_glass_has_bounded_weights() {
    let p = Disney { specular_transmission: 1.0, sheen: 1.0, roughness: 0.1, ..WHITE };
    for degrees in [0.0, 45.0, 70.0, 85.0] {
        let wo = view(degrees, 0.5);
        let outcome = run(&principled(&p), wo, Effort { seed: 8, ..Effort::SHORT });
        let want = albedo(&p, wo);
        println!(
            "{degrees}°: greatest weight {:.2}, mean {:.4} ± {:.4}, quadrature {want:.4}",
            outcome.largest, outcome.mean.0, outcome.mean.1
        );
        assert!(outcome.largest < 10.0, "{degrees}°: {}", outcome.largest);
        assert!(
            (outcome.mean.0 - want).abs() < 4.9 * outcome.mean.1 + 1e-3,
            "{degrees}°: {:?} against {want}",
            outcome.mean
        );
    }
}

/// Directions that no sum has a length of, and views along the surface: nothing that is not a number.
#[test]
fn opposite_and_grazing_directions_have_values() {
    let mut random = Random::new(9);
    for (_, p) in super::materials::sets() {
        let bsdf = principled(&p);
        for _ in 0..2000 {
            let mut wo = random.direction();
            if random.chance(0.3) {
                wo = DVec3::new(wo.x.into(), wo.y.into(), f64::from(wo.z) * 1e-7).normalize().as_vec3();
            }
            let wi = match random.bits() % 4 {
                0 => -wo,
                1 => wo,
                2 => Vec3::new(-wo.x, -wo.y, wo.z),
                _ => random.direction() * Vec3::new(1.0, 1.0, 1e-7),
            };
            let wi = wi.normalize();
            let (f, pdf) = bsdf.scatter(wo, wi);
            assert!(
                f.is_finite() && f.min_element() >= 0.0 && pdf.is_finite() && pdf >= 0.0,
                "{p:?} {wo:?} {wi:?}: {f} {pdf}"
            );
            let lobe = random.unit();
            if let Some(s) = bsdf.sample(wo, lobe, random.pair()) {
                assert!(s.weight.is_finite() && s.wi.is_finite(), "{p:?} {wo:?}: {s:?}");
            }
        }
    }
}
