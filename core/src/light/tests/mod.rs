//! Tests of the lights against closed forms and quadrature.

mod choice;
mod delta;
mod environment;
mod surface;

use super::{Light, Receiver, RectangleLight, TriangleLight};
use crate::sampler::{Decision, Replicate, Sampler, Stream};
use glam::{DVec3, Vec2, Vec3};

/// Points of a Sobol sequence; sequences differ by pixel.
fn points(pixel: u32, n: u32) -> impl Iterator<Item = Vec2> {
    (0..n).map(move |i| sampler(pixel, i).get_2d(Decision::LightPoint(0)))
}

/// Numbers of a Sobol sequence, independent of [`points`].
fn numbers(pixel: u32, n: u32) -> impl Iterator<Item = f32> {
    (0..n).map(move |i| sampler(pixel, i).get_1d(Decision::LightChoice(0)))
}

fn sampler(pixel: u32, index: u32) -> Sampler {
    Sampler::new(Stream::new(7, 0), [pixel, 0], Replicate::A, index)
}

/// Numbers without structure, each coordinate in [-1, 1).
fn scattered(count: u32) -> impl Iterator<Item = Vec3> {
    (0..count).map(|i| {
        let u = sampler(i, 0);
        let (xy, z) = (u.get_2d(Decision::Filter), u.get_1d(Decision::Lens));
        xy.extend(z) * 2.0 - 1.0
    })
}

fn facing_up(p: Vec3) -> Receiver {
    Receiver { p, n: Vec3::Z }
}

fn triangle(corners: [Vec3; 3]) -> Light {
    Light::Triangle(TriangleLight::new(corners, Vec3::ONE).unwrap())
}

fn rectangle(corner: Vec3, edges: [Vec3; 2]) -> Light {
    Light::Rectangle(RectangleLight::new(corner, edges, Vec3::ONE).unwrap())
}

/// Lambert's formula: the integral of the direction over the solid angle of a polygon, whose product with a normal is
/// the irradiance by radiance 1 where all of it is above the horizon. Corners counter-clockwise seen from the front.
fn vector_irradiance(corners: &[Vec3], p: Vec3) -> DVec3 {
    let relative: Vec<DVec3> = corners.iter().map(|c| c.as_dvec3() - p.as_dvec3()).collect();
    (0..relative.len()).fold(DVec3::ZERO, |sum, i| {
        let (a, b) = (relative[i], relative[(i + 1) % relative.len()]);
        let cross = b.cross(a);
        sum + cross.normalize_or_zero() * (0.5 * libm::atan2(cross.length(), a.dot(b)))
    })
}

/// Girard's formula: the solid angle of a polygon from the angles between the planes through its edges.
fn solid_angle(corners: &[Vec3], p: Vec3) -> f64 {
    let n = corners.len();
    let relative: Vec<DVec3> = corners.iter().map(|c| c.as_dvec3() - p.as_dvec3()).collect();
    let plane = |i: usize| relative[i % n].cross(relative[(i + 1) % n]);
    let angles = (0..n).map(|i| {
        let (a, b) = (plane(i), plane(i + 1));
        std::f64::consts::PI - libm::atan2(a.cross(b).length(), a.dot(b))
    });
    angles.sum::<f64>() - (n as f64 - 2.0) * std::f64::consts::PI
}

/// The integral of the direction over what a light fills of the sphere, by sampling it, and the solid angle.
fn sampled(light: &Light, p: Vec3, n: u32) -> (DVec3, f64) {
    let samples = points(1, n).filter_map(|u| light.sample(&facing_up(p), u));
    let (sum, angle) = samples.fold((DVec3::ZERO, 0.0), |(sum, angle), s| {
        (sum + s.wi.as_dvec3() / f64::from(s.pdf), angle + 1.0 / f64::from(s.pdf))
    });
    (sum / f64::from(n), angle / f64::from(n))
}
