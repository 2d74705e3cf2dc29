//! One definition of every node serves all kinds of numbers: they agree, and lanes do not know of each other.

use glam::{DVec3, Vec3};
use proptest::prelude::{Just, prop, prop_oneof, proptest};
use wide::f32x8;

use super::objects::{fractals, solids, trees};
use super::{Random, pack, ray};
use crate::sdf::real::{Dual, Real};
use crate::sdf::{MarchStats, Point, Sdf, SdfRay};

fn objects() -> Vec<(&'static str, Sdf)> {
    [solids(), trees(), fractals()].into_iter().flatten().map(|(name, sdf)| (name, sdf.marching())).collect()
}

/// Eight random points around an object.
fn points(random: &mut Random, sdf: &Sdf) -> [Vec3; 8] {
    let (bounds, reach) = (sdf.bounds(), 0.7 * sdf.bounds().size().length());
    std::array::from_fn(|_| bounds.center() + random.direction() * reach * random.next())
}

#[test]
fn a_lane_has_the_bits_of_its_number_alone() {
    let mut random = Random(31);
    for (name, sdf) in objects() {
        for _ in 0..2000 {
            let points = points(&mut random, &sdf);
            let lanes = sdf.tape().distance(pack(points)).to_array();
            for (lane, p) in points.into_iter().enumerate() {
                let alone: f32 = sdf.tape().distance(Point::splat(p));
                assert_eq!(lanes[lane].to_bits(), alone.to_bits(), "{name} at {p}: {} {alone}", lanes[lane]);
            }
        }
    }
}

proptest! {
    #[test]
    fn elementary_functions_know_one_lane_only(
        x in prop::array::uniform8(prop_oneof![-30.0_f32..30.0, prop::num::f32::ANY]),
        y in prop::array::uniform8(prop_oneof![-30.0_f32..30.0, Just(0.0_f32)]),
        exponent in prop_oneof![-9.0_f32..9.0, Just(7.0_f32)],
    ) {
        let (xs, ys) = (f32x8::new(x), f32x8::new(y));
        let (sines, cosines) = Real::sin_cos(xs);
        let lanes = [
            Real::ln(xs), Real::sqrt(xs), sines, cosines, Real::acos(ys), Real::atan2(ys, xs), Real::powf(ys.abs(), exponent),
            Real::floor(xs), Real::min(xs, ys), Real::max(xs, ys), <f32x8 as Real>::select(Real::less(xs, ys), xs, ys),
            f32x8::gradient_noise(Point::new(xs, ys, xs), 77),
        ];
        for i in 0..8 {
            let (x, y) = (x[i], y[i]);
            let (sine, cosine) = Real::sin_cos(x);
            let alone = [
                Real::ln(x), Real::sqrt(x), sine, cosine, Real::acos(y), Real::atan2(y, x), Real::powf(y.abs(), exponent),
                Real::floor(x), Real::min(x, y), Real::max(x, y), <f32 as Real>::select(Real::less(x, y), x, y),
                f32::gradient_noise(Point::new(x, y, x), 77),
            ];
            for (function, (lanes, alone)) in lanes.iter().zip(alone).enumerate() {
                let lane = lanes.to_array()[i];
                assert!(
                    lane.to_bits() == alone.to_bits() || lane.is_nan() && alone.is_nan(),
                    "function {function} of {x} and {y}: {lane} among others, {alone} alone"
                );
            }
        }
    }
}

#[test]
fn elementary_functions_are_close_to_those_of_f64() {
    let mut random = Random(32);
    // In units of 2⁻²⁴ of the result, or of 1 where that is more.
    let mut worst = [0.0_f64; 6];
    for _ in 0..200_000 {
        let (x, y) = (random.within(-20.0, 20.0), random.within(-20.0, 20.0));
        let (c, n) = (random.within(-1.0, 1.0), random.within(1.0, 12.0));
        let (base, wide) = (random.within(0.01, 4.0), [x, y, c, n].map(f64::from));
        let pairs = [
            (Real::ln(x.abs()), libm::log(wide[0].abs())),
            (Real::sin_cos(x).0, libm::sin(wide[0])),
            (Real::sin_cos(x).1, libm::cos(wide[0])),
            (Real::acos(c), libm::acos(wide[2])),
            (Real::atan2(y, x), libm::atan2(wide[1], wide[0])),
            (Real::powf(base, n), libm::pow(f64::from(base), wide[3])),
        ];
        for (worst, (found, exact)) in worst.iter_mut().zip(pairs) {
            *worst = worst.max((f64::from(found) - exact).abs() / exact.abs().max(1.0) * 16_777_216.0);
        }
    }
    println!("ln, sin, cos, acos, atan2, pow: {worst:.2?} units of 2⁻²⁴");
    assert!(worst.iter().all(|&units| units < 8.0), "{worst:?}");
}

#[test]
fn derivatives_are_those_of_differences() {
    let mut random = Random(33);
    for (name, sdf) in objects().iter().filter(|(_, sdf)| sdf.tape().level().is_none()) {
        let (mut kinks, count, h) = (0, 4000, 1e-6);
        for _ in 0..count / 8 {
            for p in points(&mut random, sdf) {
                let p = p.as_dvec3();
                let dual = sdf.tape().distance(Dual::place(p));
                let value = |q: DVec3| sdf.tape().distance(Point::new(q.x, q.y, q.z));
                assert!((dual.value - value(p)).abs() <= 1e-12 * (1.0 + dual.value.abs()), "{name} at {p}");
                let slope = |axis: DVec3| (value(p + axis * h) - value(p - axis * h)) / (2.0 * h);
                let difference = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
                kinks += u32::from((dual.gradient - difference).length() > 1e-4);
            }
        }
        println!("{name}: {kinks} kinks of {count}");
        assert!(kinks * 200 < count, "{name}: {kinks} of {count}");
    }
}

#[test]
fn rays_in_company_hit_what_they_hit_alone() {
    for (name, sdf) in objects() {
        let mut random = Random(34);
        let (middle, radius) = (sdf.bounds().center(), 0.5 * sdf.bounds().size().length());
        let rays: Vec<_> = (0..1003)
            .map(|i| {
                let origin = middle + random.direction() * radius * random.within(0.2, 3.0);
                let target = middle + random.direction() * radius * random.next();
                SdfRay { footprint: [0.0, 1e-3][i & 1], ..ray(origin, target - origin) }
            })
            .collect();
        let (mut alone, mut together) = (MarchStats::default(), MarchStats::default());
        let mut hits = vec![None; rays.len()];
        let mut evaluations = 0;
        sdf.intersect_all(rays.iter().copied().enumerate(), &mut together, |i, t, taken| {
            hits[i] = t;
            evaluations += u64::from(taken);
        });
        assert_eq!(evaluations, together.evaluations, "{name}");
        for (ray, hit) in rays.iter().zip(&hits) {
            assert_eq!(
                sdf.intersect(ray, &mut alone).map(f32::to_bits),
                hit.map(f32::to_bits),
                "{name}: {ray:?}"
            );
        }
        assert_eq!(alone, together, "{name}");
        assert!(hits.iter().flatten().count() > 200, "{name}: a test that hits nothing shows nothing");
    }
}

#[test]
fn rays_are_blocked_where_they_hit_something() {
    let (mut whole, mut looked) = (0, 0);
    for (name, sdf) in objects() {
        let mut random = Random(35);
        let (middle, radius) = (sdf.bounds().center(), 0.5 * sdf.bounds().size().length());
        // From outside, from within, and from the surface.
        let mut rays = Vec::new();
        while rays.len() < 1003 {
            let origin = middle + random.direction() * radius * random.within(0.0, 2.0);
            let start = ray(origin, middle + random.direction() * radius * random.next() - origin);
            rays.push(start);
            if let Some(t) = sdf.intersect(&start, &mut MarchStats::default()) {
                let p = start.origin + start.dir * t;
                let normal = sdf.normal(p);
                let from = p + normal * sdf.offset(p);
                let away = random.direction();
                rays.push(ray(from, if away.dot(normal) < 0.0 { -away } else { away }));
            }
        }
        let (mut nearest, mut any) = (MarchStats::default(), MarchStats::default());
        let mut blocked = vec![false; rays.len()];
        let mut evaluations = 0;
        sdf.occluded_all(rays.iter().copied().enumerate(), &mut any, |i, is_hit, taken| {
            blocked[i] = is_hit;
            evaluations += u64::from(taken);
        });
        assert_eq!(evaluations, any.evaluations, "{name}");
        for (ray, blocked) in rays.iter().zip(&blocked) {
            assert_eq!(sdf.intersect(ray, &mut nearest).is_some(), *blocked, "{name}: {ray:?}");
        }
        let hits = blocked.iter().filter(|blocked| **blocked).count();
        assert!(hits > 200 && hits < rays.len(), "{name}: {hits} of {}", rays.len());
        whole += nearest.evaluations;
        looked += any.evaluations;
    }
    println!("evaluations: {whole} to the nearest hit, {looked} to any");
    assert!(looked < whole, "{looked} {whole}");
}
