//! Owns the measurement of light scattered once along a segment: relative variance of one sample by the tables of karst,
//! by equiangular sampling of the part of the segment in the light's cone, and by plain sampling of distances. Run by
//! `cargo bench -p karst-core --bench along`.
#![allow(clippy::print_stdout, clippy::expect_used, reason = "a measurement prints its figures")]

use glam::{DVec3, Vec2, Vec3};
use karst_core::light::{Light, Lights, Numbers, PointLight, Receiver, Span, SpotFalloff, SpotLight};
use karst_core::math::Aabb;
use karst_core::medium::Medium;

/// Samples of each kind.
const SAMPLES: u32 = 400_000;

/// Steps in which the part of a segment that a light shines on is looked for, and the integral is taken.
const STEPS: u32 = 200_000;

/// A light, a segment along −z from the origin, and a ball between them.
struct Case {
    name: &'static str,
    light: Light,
    /// Where the light is.
    position: Vec3,
    length: f32,
    g: f32,
    /// Middle and radius of what throws a shadow.
    ball: (Vec3, f32),
}

impl Case {
    fn medium(&self) -> Medium {
        Medium::new(Vec3::splat(0.05), Vec3::splat(0.25), self.g)
    }

    fn point(t: f32) -> Vec3 {
        Vec3::NEG_Z * t
    }

    /// What the light brings at a distance, per unit of length; `shadow` says whether the ball is there.
    fn at(&self, medium: &Medium, t: f32, shadow: bool) -> f64 {
        let p = Self::point(t);
        let from = Receiver { p, n: Vec3::ZERO };
        let Some(sample) = self.light.sample(&from, Vec2::ZERO) else { return 0.0 };
        let away = (self.position - p).length();
        let (middle, radius) = self.ball;
        let nearest = (middle - p).dot(sample.wi).clamp(0.0, away);
        if shadow && (p + sample.wi * nearest - middle).length() < radius {
            return 0.0;
        }
        let through = medium.transmittance(t + away).x * medium.sigma_s().x;
        f64::from(through * medium.phase().value(Vec3::NEG_Z, sample.wi) * sample.radiance.x / sample.pdf)
    }
}

/// Mean and variance of one sample.
fn moments(mut sample: impl FnMut(f32) -> f64) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    for _ in 0..SAMPLES {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let value = sample((state >> 40) as f32 / 16_777_216.0);
        sum += value;
        squares += value * value;
    }
    let mean = sum / f64::from(SAMPLES);
    (mean, squares / f64::from(SAMPLES) - mean * mean)
}

/// The first and the last place on a segment that a light shines on.
fn lit(case: &Case, medium: &Medium) -> [f32; 2] {
    let places = (0..STEPS).map(|step| (step as f32 + 0.5) / STEPS as f32 * case.length);
    let mut shines = places.filter(|&t| case.at(medium, t, false) > 0.0);
    let first = shines.next().expect("the light shines on the segment");
    [first, shines.next_back().unwrap_or(first)]
}

/// Relative variance of one sample by tables, by the angle at the light within its cone, and by distance.
fn variances(case: &Case, shadow: bool) -> [f64; 3] {
    let medium = case.medium();
    let everything = Aabb { min: Vec3::splat(-10.0), max: Vec3::splat(10.0) };
    let lights = Lights::new(vec![case.light.clone()], &everything);
    let span = Span { o: Vec3::ZERO, d: Vec3::NEG_Z, near: 0.0, far: case.length };
    let by_table = moments(|u| {
        let numbers = Numbers { light: 0.5, place: u, view: 0.5 };
        let along = lights.along(span, &medium, Vec3::ONE, numbers);
        along.map_or(0.0, |along| case.at(&medium, along.t, shadow) / f64::from(along.pdf))
    });
    let nearest = f64::from(-case.position.z);
    let apart = f64::from(case.position.truncate().length()).max(1e-4 * f64::from(case.length));
    let [first, last] = lit(case, &medium).map(|t| libm::atan2(f64::from(t) - nearest, apart));
    let by_angle = moments(|u| {
        let angle = first + (last - first) * f64::from(u);
        let off = apart * libm::tan(angle);
        let pdf = apart / ((last - first) * (off * off + apart * apart));
        case.at(&medium, (nearest + off) as f32, shadow) / pdf
    });
    let sigma = f64::from(medium.sigma_t().x);
    let by_distance = moments(|u| {
        let t = -libm::log1p(-f64::from(u)) / sigma;
        let value = if t < f64::from(case.length) { case.at(&medium, t as f32, shadow) } else { 0.0 };
        value / (sigma * libm::exp(-sigma * t))
    });
    let all = [by_table, by_angle, by_distance];
    let mean = (0..STEPS).map(|step| {
        case.at(&medium, (step as f32 + 0.5) / STEPS as f32 * case.length, shadow) * f64::from(case.length)
    });
    let mean = mean.sum::<f64>() / f64::from(STEPS);
    for (found, variance) in all {
        // Five standard errors, and what the lattice misses at edges.
        let error = 5.0 * (variance / f64::from(SAMPLES)).sqrt() + 2e-3 * mean;
        assert!((found - mean).abs() < error, "{}: {found} instead of {mean}", case.name);
    }
    all.map(|(found, variance)| variance / (found * found))
}

fn cases() -> Vec<Case> {
    let spot = |position: Vec3, towards: DVec3, beam_width: f32, cutoff_angle: f32| {
        let falloff = SpotFalloff::Linear { beam_width, cutoff_angle };
        Light::Spotlight(SpotLight::new(position, towards, Vec3::ONE, falloff))
    };
    let point = |position: Vec3| Light::Point(PointLight { position, intensity: Vec3::ONE });
    let case = |name, place: [f32; 3], light: &dyn Fn(Vec3) -> Light, g: f32, ball: ([f32; 3], f32)| {
        let position = Vec3::from(place);
        Case { name, light: light(position), position, length: 8.0, g, ball: (Vec3::from(ball.0), ball.1) }
    };
    vec![
        case(
            "narrow beam across",
            [2.0, 0.0, -4.0],
            &|p| spot(p, DVec3::new(-1.0, 0.0, 0.05), 5.0, 10.0),
            0.5,
            ([1.0, 0.0, -4.1], 0.12),
        ),
        case(
            "wide beam across",
            [2.0, 0.5, -4.0],
            &|p| spot(p, DVec3::new(-1.0, -0.2, 0.0), 30.0, 45.0),
            0.5,
            ([1.0, 0.25, -4.4], 0.3),
        ),
        case(
            "beam towards the eye",
            [0.4, 0.1, -7.0],
            &|p| spot(p, DVec3::new(-0.06, 0.0, 1.0), 8.0, 15.0),
            0.8,
            ([0.3, 0.1, -5.5], 0.1),
        ),
        case(
            "headlight",
            [0.3, -0.2, 0.2],
            &|p| spot(p, DVec3::new(-0.03, 0.02, -1.0), 9.0, 14.0),
            0.5,
            ([0.2, -0.15, -1.0], 0.1),
        ),
        case("lamp beside", [0.8, 0.3, -3.0], &point, 0.0, ([0.4, 0.15, -3.3], 0.15)),
        case("lamp close, g 0.85", [0.05, 0.0, -3.0], &point, 0.85, ([0.02, 0.0, -3.02], 0.01)),
    ]
}

fn main() {
    println!(
        "| light and segment | shadow | table | angle in the cone | distance | angle over table | distance over table |"
    );
    println!("|---|---|---|---|---|---|---|");
    for case in cases() {
        for shadow in [false, true] {
            let [table, angle, distance] = variances(&case, shadow);
            println!(
                "| {} | {} | {table:.2e} | {angle:.2e} | {distance:.2e} | {:.1} | {:.0} |",
                case.name,
                if shadow { "yes" } else { "no" },
                angle / table,
                distance / table
            );
        }
    }
}
