//! Rays against closed forms and against a slow reference march in f64.

use glam::{DVec3, Mat3, Vec3, Vec4};

use super::{Random, exact, hit, moved, object, ray};
use crate::sdf::{MarchStats, Sdf, SdfRay};

/// Plain sphere tracing in f64 with quarter steps, then bisection: the first root, or `None`.
pub(super) fn reference(sdf: &Sdf, ray: &SdfRay) -> Option<f64> {
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let (mut t, far) = (0.0, 12.0);
    let mut before = 0.0;
    for _ in 0..200_000 {
        let value = exact(sdf, origin + dir * t);
        if value < 0.0 {
            let (mut low, mut high) = (before, t);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if exact(sdf, origin + dir * middle) < 0.0 {
                    high = middle;
                } else {
                    low = middle;
                }
            }
            return Some(low);
        }
        if t > far {
            return None;
        }
        before = t;
        t += (0.25 * value).max(2e-6);
    }
    None
}

struct Comparison {
    rays: u32,
    hits: u32,
    mismatches: u32,
    /// Depth errors of rays that both hit, ascending.
    errors: Vec<f64>,
    stats: MarchStats,
}

impl Comparison {
    fn percentile(&self, share: f64) -> f64 {
        self.errors[((self.errors.len() - 1) as f64 * share) as usize]
    }
}

/// Rays from a ring around the object towards and past it; a tenth of them graze it from close by.
fn compare(name: &str, sdf: &Sdf, count: u32, footprint: f32) -> Comparison {
    let mut random = Random(7);
    let mut c =
        Comparison { rays: count, hits: 0, mismatches: 0, errors: Vec::new(), stats: MarchStats::default() };
    let bounds = sdf.bounds();
    let (middle, radius) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length() * 0.5);
    for i in 0..count {
        let away = if i % 10 == 0 { 1.05 } else { 2.0 };
        let origin = middle + random.direction() * radius * away;
        let target = middle + random.direction() * radius * 0.8 * random.next();
        let ray = SdfRay { footprint, ..ray(origin, target - origin) };
        let (got, want) = (sdf.intersect(&ray, &mut c.stats), reference(sdf, &ray));
        match (got, want) {
            (Some(got), Some(want)) => {
                c.hits += 1;
                c.errors.push((f64::from(got) - want).abs() / f64::from(radius));
            }
            (None, None) => {}
            _ => c.mismatches += 1,
        }
    }
    c.errors.sort_by(f64::total_cmp);
    println!(
        "{name}: {} rays, {} hits, {} mismatches, depth error p50 {:.1e} p99 {:.1e} max {:.1e}, {:.1} evaluations \
         per ray, {} exhausted, {} overshoots",
        c.rays,
        c.hits,
        c.mismatches,
        c.percentile(0.5),
        c.percentile(0.99),
        c.percentile(1.0),
        c.stats.evaluations as f64 / f64::from(c.rays),
        c.stats.exhausted,
        c.stats.overshoots
    );
    assert!(c.hits > count / 8, "{name}: a test that hits nothing shows nothing");
    c
}

#[test]
fn fractals_agree_with_the_reference() {
    for (name, power, iterations, bailout) in [
        ("bulb 8", 8.0, 10, 4.0),
        ("bulb 8, far bailout", 8.0, 8, 64.0),
        ("bulb 7.3", 7.3, 6, 4.0),
        ("bulb 2", 2.0, 12, 4.0),
    ] {
        let sdf = object(|t| t.mandelbulb(power, iterations, bailout));
        let c = compare(name, &sdf, 1024, 0.0);
        assert!(c.mismatches <= 3, "{name}");
        assert!(c.percentile(0.5) < 1e-6, "{name}");
        assert!(c.stats.exhausted <= 1, "{name}");
        // Powers that are not whole have a seam, where the estimate jumps.
        assert!((c.stats.overshoots as f64) < 2e-3 * c.stats.evaluations as f64, "{name}");
        // Dust that is thinner than the least step may be stepped over: with a fine pixel that is a short one.
        let fine = compare(name, &sdf, 1024, 1e-4);
        assert!(fine.percentile(0.99) < 1e-5, "{name}");
    }
}

#[test]
fn julia_sets_agree_with_the_reference() {
    for (name, c, iterations) in [
        ("julia", Vec4::new(-0.2, 0.6, 0.2, 0.2), 10),
        ("julia of a disk", Vec4::new(-0.125, -0.256, 0.847, 0.0895), 9),
        ("julia, thin", Vec4::new(-1.0, 0.2, 0.0, 0.0), 8),
    ] {
        let sdf = object(|t| t.julia(c, iterations));
        let compared = compare(name, &sdf, 1024, 0.0);
        assert!(compared.mismatches <= 3, "{name}");
        assert!(compared.percentile(0.5) < 1e-6, "{name}");
        assert!(compared.stats.exhausted <= 1, "{name}");
        assert!((compared.stats.overshoots as f64) < 2e-3 * compared.stats.evaluations as f64, "{name}");
    }
}

#[test]
fn spheres_agree_with_the_quadratic() {
    let mut random = Random(3);
    for radius in [1e-3_f32, 0.1, 1.0, 30.0, 1e3] {
        let sdf = object(|t| t.sphere(radius)).marching();
        let mut worst = 0.0_f64;
        for _ in 0..2000 {
            let origin = random.direction() * radius * random.within(1.2, 20.0);
            let target = random.direction() * radius * 1.3 * random.next();
            let ray = ray(origin, target - origin);
            let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
            let closest = -o.dot(d) / d.length_squared();
            let gap = f64::from(radius).powi(2) - (o + d * closest).length_squared();
            let got = hit(&sdf, &ray);
            // Within rounding of the silhouette either answer is right.
            if (gap / f64::from(radius).powi(2)).abs() < 1e-6 {
                continue;
            }
            assert_eq!(got.is_some(), gap > 0.0 && closest > 0.0, "radius {radius} {ray:?}");
            if let Some(t) = got {
                let p = o + d * f64::from(t);
                worst = worst.max((p.length() - f64::from(radius)).abs() / f64::from(radius));
            }
        }
        println!("radius {radius}: largest distance of a hit from the sphere {worst:.1e} radii");
        assert!(worst < 2e-6, "radius {radius}: {worst}");
    }
}

#[test]
fn boxes_agree_with_slabs() {
    let sdf = object(|t| t.cuboid(Vec3::new(1.0, 2.0, 3.0))).marching();
    let half = DVec3::new(0.5, 1.0, 1.5);
    let mut random = Random(4);
    for _ in 0..4000 {
        let origin = random.direction() * random.within(2.0, 9.0);
        let ray = SdfRay { footprint: 1e-5, ..ray(origin, random.direction() * 1.5 - origin) };
        let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let (a, b) = ((-half - o) / d, (half - o) / d);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        // Chords of corners shorter than the least step may be skipped.
        if (near - far).abs() < 1e-4 {
            continue;
        }
        let got = hit(&sdf, &ray);
        assert_eq!(got.is_some(), near < far, "{ray:?}");
        if let Some(t) = got {
            assert!((f64::from(t) - near).abs() < 4e-6 * near, "{ray:?}: {t} and {near}");
        }
    }
}

#[test]
fn torus_hits_solve_the_quartic() {
    let sdf = object(|t| t.torus(1.0, 0.25));
    let mut random = Random(5);
    for _ in 0..4000 {
        let origin = random.direction() * random.within(1.5, 6.0);
        let ray = ray(origin, random.direction() - origin);
        let Some(t) = hit(&sdf, &ray) else { continue };
        let p = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t);
        // (|p|² + R² - r²)² = 4 R² (x² + z²)
        let left = (p.length_squared() + 1.0 - 0.0625).powi(2);
        let right = 4.0 * (p.x * p.x + p.z * p.z);
        assert!((left - right).abs() < 1e-5, "{ray:?}: {left} and {right}");
    }
}

#[test]
fn rays_along_a_plane_end_and_are_right() {
    // A floor seen at angles down to 5e-4, a pixel of a small picture: the worst that sphere tracing can meet.
    let sdf = object(|t| t.cuboid(Vec3::new(8.0, 1.0, 8.0))).marching();
    let mut stats = MarchStats::default();
    for i in 1..200_u16 {
        let slope = 5e-4 * f32::from(i);
        let height = 3.5 * slope;
        let ray = ray(Vec3::new(-4.5, 0.5 + height, 0.1), Vec3::new(1.0, -slope, 0.0));
        let t = sdf
            .intersect(&ray, &mut stats)
            .unwrap_or_else(|| panic!("the floor is long enough, {slope} {stats:?}"));
        let p = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t);
        assert!((p.y - 0.5).abs() < 1e-6, "slope {slope}: hit at {p}");
    }
    println!("grazing: {:.0} evaluations per ray", stats.evaluations as f64 / 199.0);
    assert_eq!(stats.exhausted, 0);
}

#[test]
fn touching_balls_have_no_hole_and_no_bridge() {
    let sdf = object(|t| {
        let (a, b) = (t.sphere(1.0), t.sphere(1.0));
        let (a, b) = (moved(t, a, -Vec3::X), moved(t, b, Vec3::X));
        t.union(&[a, b])
    });
    for i in 1..100_u8 {
        // Past the point of contact, at distance y: the gap is y² wide there, so straight rays miss ...
        let y = 0.01 * f32::from(i);
        let through = ray(Vec3::new(0.0, y, 4.0), Vec3::NEG_Z);
        assert_eq!(hit(&sdf, &through), None, "y = {y}");
        // ... and rays through the centres' line hit.
        let across = ray(Vec3::new(-4.0, 0.0, y * 0.5), Vec3::X);
        let t = hit(&sdf, &across).expect("hits the first ball");
        let want = 3.0 - f64::from((1.0 - 0.25 * y * y).sqrt());
        assert!((f64::from(t) - want).abs() < 3e-6, "{t} and {want}");
    }
}

#[test]
fn unnormalised_directions_and_limits_count_in_units_of_dir() {
    let sdf = object(|t| t.sphere(1.0));
    let long = SdfRay { dir: Vec3::NEG_Z * 4.0, ..ray(Vec3::Z * 5.0, Vec3::NEG_Z) };
    assert!((hit(&sdf, &long).unwrap() - 1.0).abs() < 1e-6);
    assert_eq!(hit(&sdf, &SdfRay { t_max: 0.99, ..long }), None);
    // From inside, after the first hit: out at the far side.
    assert!((hit(&sdf, &SdfRay { t_min: 1.2, ..long }).unwrap() - 1.5).abs() < 1e-6);
}

#[test]
fn far_origins_keep_precision() {
    let sdf = object(|t| t.sphere(1.0));
    let far = ray(Vec3::new(1e6, 0.3, 0.2), Vec3::NEG_X);
    let t = hit(&sdf, &far).unwrap();
    assert!((t - 999_999.06).abs() < 0.1, "{t}");
}

#[test]
fn large_offsets_that_cancel_cost_nothing() {
    let sdf = object(|t| {
        let ball = t.sphere(1.0);
        let there = t.transform(ball, Vec3::splat(1e6), Mat3::IDENTITY, 1.0);
        t.transform(there, Vec3::splat(-1e6), Mat3::IDENTITY, 1.0)
    });
    assert_eq!(sdf.tape().reach(), 0.0);
    assert!((hit(&sdf, &ray(Vec3::Z * 3.0, Vec3::NEG_Z)).unwrap() - 2.0).abs() < 1e-6);
}
