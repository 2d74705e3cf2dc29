//! Spheres, triangles and rectangles: their densities and where their samples lie.

use super::{facing_up, points, rectangle, sampled, scattered, solid_angle, triangle, vector_irradiance};
use crate::light::{Light, Lights, RectangleLight, SphereLight, Target, mesh_lights};
use crate::math::Aabb;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

fn sphere(center: Vec3, radius: f32) -> Light {
    Light::Sphere(SphereLight { center, radius, radiance: Vec3::ONE })
}

/// A square of half size 1 in the plane z = 0 that shines towards +z.
const SQUARE: [Vec3; 4] = [
    Vec3::new(-1.0, -1.0, 0.0),
    Vec3::new(1.0, -1.0, 0.0),
    Vec3::new(1.0, 1.0, 0.0),
    Vec3::new(-1.0, 1.0, 0.0),
];

/// Its halves, itself, and their corners.
fn flat_lights() -> Vec<(Light, Vec<Vec3>)> {
    let [a, b, c, d] = SQUARE;
    let odd = [a, b * 0.3, c * 2.0];
    vec![
        (triangle([a, b, c]), vec![a, b, c]),
        (triangle([c, d, a]), vec![c, d, a]),
        (triangle(odd), odd.to_vec()),
        (rectangle(a, [b - a, d - a]), SQUARE.to_vec()),
        (rectangle(b, [c - b, a - b]), SQUARE.to_vec()),
    ]
}

/// Irradiance of a sphere above a plane is (R/d)² · cos θ · π · L.
#[test]
fn a_sphere_brings_its_form_factor() {
    for (center, radius) in [(Vec3::new(0.3, 0.4, 2.0), 0.5), (Vec3::new(30.0, 0.0, 40.0), 0.01)] {
        let irradiance = sampled(&sphere(center, radius), Vec3::ZERO, 4096).0.z;
        let want = f64::from(radius / center.length()).powi(2) * f64::from(center.normalize().z) * PI;
        assert!((irradiance / want - 1.0).abs() < 1e-3, "{irradiance} {want}");
    }
}

/// Where the receivers of flat lights are: far, near, at grazing angles, before an edge, almost touching.
const RECEIVERS: [Vec3; 10] = [
    Vec3::new(0.1, 0.2, 1.0),
    Vec3::new(0.1, 0.2, 0.1),
    Vec3::new(0.2, -0.3, 1e-2),
    Vec3::new(0.2, -0.3, 1e-4),
    Vec3::new(3.0, 2.0, 0.5),
    Vec3::new(3.0, 2.0, 1e-3),
    Vec3::new(1.001, 0.0, 0.01),
    Vec3::new(7.0, -50.0, 30.0),
    Vec3::new(700.0, -5000.0, 3000.0),
    Vec3::new(0.0, 0.0, 50_000.0),
];

/// The integral of the direction over the solid angle tests the density and the places of the samples at once.
#[test]
fn flat_lights_equal_lamberts_formula() {
    for (light, corners) in flat_lights() {
        for p in RECEIVERS {
            let (sum, angle) = sampled(&light, p, 4096);
            let want = vector_irradiance(&corners, p);
            assert!((sum - want).length() < 2e-3 * want.length(), "{p}: {sum}, expected {want}");
            let want = solid_angle(&corners, p);
            // Girard's formula loses digits in small angles.
            assert!((angle / want - 1.0).abs() < 1e-3 + 1e-14 / want, "{p}: {angle} sr, expected {want}");
        }
    }
}

#[test]
fn a_wrong_density_does_not_pass_for_lamberts_formula() {
    let (light, corners) = &flat_lights()[0];
    let p = RECEIVERS[1];
    let want = vector_irradiance(corners, p);
    let from = facing_up(p);
    // By area instead of by solid angle, the cosine at the light forgotten.
    let sum: DVec3 = points(1, 4096)
        .filter_map(|u| light.sample(&from, u))
        .map(|s| s.wi.as_dvec3() / f64::from(s.pdf * -s.wi.z))
        .sum();
    assert!((sum / 4096.0 - want).length() > 0.1 * want.length());
}

#[test]
fn solid_angles_from_a_speck_to_a_hemisphere() {
    let [a, b, c] = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(2.0, -1.0, 0.0), Vec3::new(-1.0, 2.0, 0.0)];
    let light = triangle([a, b, c]);
    // From 6.27 sr and more down to 1e-10 sr.
    for height in [1e-5, 1e-3, 2e-3, 0.1, 1.0, 100.0, 1e4, 2.1e5] {
        let p = Vec3::new(-0.2, -0.3, height);
        let angle = sampled(&light, p, 1024).1;
        let far = 4.5 / f64::from(height).powi(2);
        let want = if height > 1e3 { far } else { solid_angle(&[a, b, c], p) };
        assert!((angle / want - 1.0).abs() < 1e-2, "{height}: {angle}, expected {want}");
    }
    assert!(sampled(&light, Vec3::new(-0.2, -0.3, 2e-3), 64).1 > 6.26);
    assert!(sampled(&light, Vec3::new(-0.2, -0.3, 2.1e5), 64).1 < 1.1e-10);
}

/// A path that finds a light by itself must weigh it with the density that sampling has there.
#[test]
fn the_density_of_a_sample_is_the_density_of_finding_it() {
    let mut lights = flat_lights();
    lights.push((sphere(Vec3::new(0.2, -0.1, -0.5), 0.3), Vec::new()));
    for (light, _) in lights {
        let all = Lights::new(vec![light.clone()], &Aabb::EMPTY);
        for (p, pixel) in RECEIVERS.into_iter().chain(scattered(50).map(|p| p * 3.0)).zip(0..) {
            for s in points(pixel, 64).filter_map(|u| light.sample(&facing_up(p), u)) {
                let Target::Point(q, _, n) = s.target else { panic!("a surface has points") };
                let d = (q.as_dvec3() - p.as_dvec3()).normalize().as_vec3();
                let (radiance, pdf) = all.emitted(0, p, q, n, s.wi).unwrap();
                assert_eq!(radiance, s.radiance);
                assert!((pdf / s.pdf - 1.0).abs() < 1e-5, "{p} {q}: {pdf}, sampled {}", s.pdf);
                // The point is where the direction leads, as far as its coordinates can say.
                let slack = 1e-5 + 1e-6 / q.distance(p);
                assert!((d - s.wi).length() < slack, "{p} {q}: {d} {}", s.wi);
                assert!(all.emitted(0, p, q, n, -s.wi).is_none(), "the back is dark");
            }
        }
    }
}

/// No sample weighs more than a hemisphere of its light.
#[test]
fn weights_are_bounded_wherever_the_receiver_is() {
    let mut lights = flat_lights();
    lights.push((sphere(Vec3::Z, 1.0), Vec::new()));
    let hostile = [
        Vec3::ZERO,               // in the plane, on the light; touching the sphere
        Vec3::new(5.0, 0.0, 0.0), // in the plane, beside the light
        Vec3::new(1.0, 1.0, 0.0), // at a corner
        Vec3::new(1.0, 1.0, 1e-4),
        Vec3::new(1.0, 0.5, 1e-7), // above an edge
        Vec3::new(0.0, 0.0, f32::MIN_POSITIVE),
        Vec3::new(0.0, 0.0, 1.0),  // inside the sphere, at its centre
        Vec3::new(0.0, 0.0, -1.0), // behind
        Vec3::new(0.0, 0.0, -1e-4),
        Vec3::new(1e15, 0.0, 1e15),
        Vec3::new(0.0, 0.0, 1e18),
        Vec3::splat(f32::MAX),
        Vec3::splat(f32::NAN),
    ];
    for (light, _) in &lights {
        let all = Lights::new(vec![light.clone()], &Aabb::EMPTY);
        for p in hostile.into_iter().chain(scattered(200)) {
            let from = facing_up(p);
            for s in points(3, 64).filter_map(|u| light.sample(&from, u)) {
                assert!(s.wi.is_normalized() && s.pdf.is_finite(), "{p}: {s:?}");
                assert!(1.0 / f64::from(s.pdf) < 2.0 * PI * 1.000_01, "{p}: weight {}", 1.0 / s.pdf);
            }
            let choice = all.choice_pdf(&from, 0);
            assert!(choice == 0.0 || choice == 1.0, "{p}: {choice}");
        }
    }
}

#[test]
fn from_inside_or_behind_nothing_is_sampled() {
    for (light, p) in [
        (sphere(Vec3::Z, 1.0), Vec3::new(0.1, 0.0, 1.0)),
        (sphere(Vec3::Z, 1.0), Vec3::ZERO),
        (flat_lights()[0].0.clone(), Vec3::new(0.3, 0.2, -0.1)),
        (flat_lights()[3].0.clone(), Vec3::new(0.3, 0.2, -0.1)),
        (flat_lights()[3].0.clone(), Vec3::new(0.3, 0.2, 0.0)),
    ] {
        assert!(points(0, 64).all(|u| light.sample(&facing_up(p), u).is_none()), "{light:?} from {p}");
    }
}

#[test]
fn halves_of_rectangles_become_one_light() {
    // A box: every side of two triangles that share a diagonal; the last one is split the other way.
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32 * 2.0, (i >> 2 & 1) as f32 * 3.0);
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut triangles = Vec::new();
    for side in sides {
        let [a, b, c, d] = side.map(corner);
        triangles.extend([[a, b, c], [d, a, c]]);
    }
    triangles.insert(3, [Vec3::ONE; 3]);
    triangles.push([Vec3::ZERO, Vec3::X, Vec3::new(0.3, 1.0, 0.0)]);
    let (lights, numbers) = mesh_lights(&triangles, Vec3::ONE);
    assert_eq!(lights.len(), 7);
    assert_eq!(numbers, [0, 0, 1, u32::MAX, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6]);
    assert!(lights[..6].iter().all(|l| matches!(l, Light::Rectangle(_))), "{lights:?}");
    let p = Vec3::new(4.0, 5.0, -6.0);
    for (light, side) in lights.iter().zip(sides) {
        let corners = side.map(corner);
        let want = vector_irradiance(&corners, p);
        let in_front = (corners[1] - corners[0]).cross(corners[3] - corners[0]).dot(p - corners[0]) > 0.0;
        let sum = sampled(light, p, 1024).0;
        let want = if in_front { want } else { DVec3::ZERO };
        assert!((sum - want).length() < 1e-3, "{side:?}: {sum}, expected {want}");
    }
}

#[test]
fn almost_rectangles_stay_triangles() {
    let [a, b, c, d] = SQUARE;
    for odd in [d + Vec3::X * 1e-3, d + Vec3::Z * 1e-3] {
        assert_eq!(mesh_lights(&[[a, b, c], [odd, a, c]], Vec3::ONE).0.len(), 2);
    }
    // Two halves with the same diagonal, but back to back.
    assert_eq!(mesh_lights(&[[a, b, c], [d, c, a]], Vec3::ONE).1, [0, 1]);
    assert!(RectangleLight::new(a, [Vec3::X, Vec3::X], Vec3::ONE).is_none());
}
