//! Normals, offsets, and rays that start on or inside objects.

use glam::Vec3;

use super::{Random, exact, hit, melted, object, ray};
use crate::sdf::{MarchStats, Sdf, SdfRay};

/// Random points of the surface, found by rays from outside.
fn surface_points(sdf: &Sdf, count: usize) -> Vec<Vec3> {
    let mut random = Random(11);
    let bounds = sdf.bounds();
    let (middle, radius) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length() * 0.5);
    let mut points = Vec::new();
    while points.len() < count {
        let origin = middle + random.direction() * radius * 1.5;
        let ray = ray(origin, middle + random.direction() * radius * 0.5 * random.next() - origin);
        if let Some(t) = hit(sdf, &ray) {
            points.push(ray.origin + ray.dir * t);
        }
    }
    points
}

/// Shares of rays, leaving convex surfaces outwards, that hit at all: every hit is a false one.
fn false_hits(sdf: &Sdf, count: usize) -> usize {
    let mut random = Random(13);
    let mut wrong = 0;
    for p in surface_points(sdf, count) {
        let n = sdf.normal(p);
        let w = random.direction();
        let w = if w.dot(n) < 0.0 { -w } else { w };
        let start = p + n * sdf.offset(p);
        wrong += usize::from(hit(sdf, &ray(start, w)).is_some());
    }
    wrong
}

#[test]
fn leaving_a_convex_surface_hits_nothing() {
    for radius in [1e-3_f32, 1e-2, 1.0, 30.0, 1e3] {
        assert_eq!(
            false_hits(&object(|t| t.sphere(radius)).marching(), 4000),
            0,
            "sphere of radius {radius}"
        );
        assert_eq!(
            false_hits(&object(|t| t.cuboid(Vec3::new(2.0, 1.0, 3.0) * radius)).marching(), 4000),
            0,
            "box {radius}"
        );
        let offset_ball = object(|t| {
            let ball = t.sphere(radius);
            t.transform(ball, Vec3::new(100.0, 50.0, 0.0) * radius, glam::Mat3::IDENTITY, 1.0)
        });
        assert_eq!(false_hits(&offset_ball.marching(), 4000), 0, "moved sphere of radius {radius}");
    }
}

#[test]
fn leaving_inwards_comes_out_at_the_far_side() {
    let mut random = Random(17);
    for radius in [1e-3_f32, 1.0, 1e3] {
        let sdf = object(|t| t.sphere(radius)).marching();
        for p in surface_points(&sdf, 2000) {
            let n = sdf.normal(p);
            let w = random.direction();
            let w = if w.dot(n) > 0.0 { -w } else { w };
            if w.dot(n) > -0.02 {
                continue;
            }
            let t = hit(&sdf, &ray(p - n * sdf.offset(p), w)).expect("comes out");
            let want = -2.0 * radius * w.dot(n);
            assert!((t - want).abs() < 1e-4 * radius, "radius {radius}: {t} and {want}");
        }
    }
}

#[test]
fn starting_exactly_on_the_surface_leaves_it() {
    let sdf = object(|t| t.cuboid(Vec3::splat(2.0)));
    let start = Vec3::new(0.3, 1.0, -0.2);
    assert_eq!(hit(&sdf, &ray(start, Vec3::new(0.3, 1.0, 0.1))), None);
    let t = hit(&sdf, &ray(start, Vec3::NEG_Y)).expect("through the box");
    assert!((t - 2.0).abs() < 1e-6, "{t}");
    // Along the face itself: no hit, and no hang.
    assert_eq!(hit(&sdf, &ray(start, Vec3::X)), None);
}

#[test]
fn shadow_rays_of_fractals_leave_their_surface() {
    let sdf = object(|t| t.mandelbulb(8.0, 10, 4.0));
    let (mut close, mut total, mut stats) = (0, 0, MarchStats::default());
    for p in surface_points(&sdf, 4000) {
        let n = sdf.normal(p);
        let start = p + n * sdf.offset(p);
        if exact(&sdf, start.as_dvec3()) <= 0.0 {
            continue;
        }
        total += 1;
        let t = sdf.intersect(&ray(start, n), &mut stats);
        close += u32::from(t.is_some_and(|t| t < 1e-4));
    }
    println!("{total} rays along normals: {close} hit within 1e-4, {stats:?}");
    assert!(total > 3000, "{total}");
    assert!(close < total / 50, "{close} of {total}");
}

#[test]
fn normals_are_exact_on_smooth_objects() {
    let sdf = object(|t| t.torus(1.0, 0.25));
    for p in surface_points(&sdf, 2000) {
        let ring = Vec3::new(p.x, 0.0, p.z).normalize();
        let want = (p - ring).normalize();
        let cross = sdf.normal(p).cross(want).length();
        assert!(cross < 3e-6, "{p}: {cross}");
    }
}

#[test]
fn normals_of_cones_are_perpendicular_to_the_slant() {
    // The slant of the one falls by 1.5 per unit outwards, that of the other rises by 1 / 0.6.
    for (bottom, top, height, slope) in [(1.0_f32, 0.0, 1.5, 1.0 / 1.5), (0.4, 1.0, 1.0, -0.6)] {
        for sdf in
            [object(|t| t.cone(bottom, top, height)), object(|t| t.cone(bottom, top, height)).marching()]
        {
            for p in surface_points(&sdf, 2000) {
                if p.y.abs() < 0.49 * height {
                    let want = Vec3::new(p.x, Vec3::new(p.x, 0.0, p.z).length() * slope, p.z).normalize();
                    let cross = sdf.normal(p) - want;
                    assert!(cross.length() < 1e-5, "{p}: {cross}");
                }
            }
        }
    }
}

#[test]
fn normals_are_unit_and_point_out_of_melted_and_fractal_objects() {
    for sdf in [object(melted), object(|t| t.mandelbulb(8.0, 10, 4.0))] {
        let mut outwards = 0;
        for p in surface_points(&sdf, 1000) {
            let n = sdf.normal(p);
            assert!((n.length() - 1.0).abs() < 1e-5, "{n}");
            let step = 0.01;
            outwards +=
                u32::from(exact(&sdf, (p + n * step).as_dvec3()) > exact(&sdf, (p - n * step).as_dvec3()));
        }
        assert!(outwards > 950, "{outwards} of 1000");
    }
}

#[test]
fn a_normal_exists_where_the_gradient_vanishes() {
    let sdf = object(|t| t.sphere(1.0));
    assert!((sdf.normal(Vec3::ZERO).length() - 1.0).abs() < 1e-6);
}

#[test]
fn thin_circles_are_never_hit_and_thin_shells_are() {
    let circle = object(|t| t.torus(1.0, 0.0));
    let shell = object(|t| t.cuboid(Vec3::new(4.0, 1e-4, 4.0)));
    let mut random = Random(19);
    for _ in 0..500 {
        let origin = random.direction() * 3.0 + Vec3::Y * 4.0;
        let target = Vec3::new(random.within(-1.0, 1.0), 0.0, random.within(-1.0, 1.0));
        let ray = SdfRay { footprint: 1e-5, ..ray(origin, target - origin) };
        assert_eq!(hit(&circle, &ray), None);
        assert!(hit(&shell, &ray).is_some(), "{ray:?}");
    }
}

#[test]
fn normals_of_fractals_face_the_ray_that_hits_them() {
    let valley = object(|t| t.mandelbulb(8.0, 12, 4.0));
    let thin = object(|t| t.julia(glam::Vec4::new(-0.2, 0.6, 0.2, 0.2), 10));
    for sdf in [valley, thin] {
        let (mut random, mut away, mut hits) = (Random(61), 0, 0);
        let radius = 0.5 * sdf.bounds().size().length();
        for _ in 0..20_000 {
            let origin = random.direction() * 2.0 * radius;
            let ray = ray(origin, random.direction() * 0.4 * radius - origin);
            let Some(t) = hit(&sdf, &ray) else { continue };
            hits += 1;
            away += u32::from(sdf.normal(ray.origin + ray.dir * t).dot(ray.dir) > 0.0);
        }
        println!("{away} of {hits} normals point away from the ray");
        assert!(hits > 5000 && away * 2000 <= hits, "{away} of {hits}");
    }
}
