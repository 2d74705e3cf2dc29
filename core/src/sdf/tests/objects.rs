//! Owns the objects that several tests look at: one of every kind of node, and trees of them.

use glam::{Mat3, Quat, Vec3, Vec4};

use super::{Random, melted, moved, object, tape};
use crate::math::Aabb;
use crate::sdf::{NoiseParameters, Sdf, Settings, TapeBuilder};

const NOISE: NoiseParameters =
    NoiseParameters { amplitude: 0.15, frequency: 2.0, octaves: 5, gain: 0.5, lacunarity: 2.1, seed: 3 };

/// Every solid but the fractals.
pub(super) fn solids() -> Vec<(&'static str, Sdf)> {
    vec![
        ("sphere", object(|t| t.sphere(1.0))),
        ("box", object(|t| t.cuboid(Vec3::new(2.0, 1.0, 0.5)))),
        ("slab", object(|t| t.cuboid(Vec3::new(4.0, 0.02, 4.0)))),
        ("rounded box", object(|t| t.rounded_box(Vec3::new(2.0, 1.0, 0.5), 0.1))),
        ("torus", object(|t| t.torus(1.0, 0.25))),
        ("cylinder", object(|t| t.cylinder(0.7, 1.5))),
        ("capsule", object(|t| t.capsule(0.3, 1.5))),
        ("cone", object(|t| t.cone(0.8, 0.0, 1.6))),
        ("cut cone", object(|t| t.cone(0.3, 0.8, 1.0))),
        ("ellipsoid", object(|t| t.ellipsoid(Vec3::new(1.0, 0.5, 0.2)))),
        (
            "plane",
            Sdf::new(
                tape(TapeBuilder::plane),
                Settings::default(),
                Some(Aabb { min: Vec3::new(-2.0, -0.5, -2.0), max: Vec3::new(2.0, 0.5, 2.0) }),
            )
            .expect("cut"),
        ),
    ]
}

/// Every way to make one object of others.
pub(super) fn trees() -> Vec<(&'static str, Sdf)> {
    let pair = |t: &mut TapeBuilder, apart: f32| {
        let (a, b) = (t.sphere(1.0), t.sphere(0.8));
        [moved(t, a, Vec3::X * -apart), moved(t, b, Vec3::X * apart)]
    };
    vec![
        ("melted", object(melted)),
        (
            "lens",
            object(|t| {
                let parts = pair(t, 0.5);
                t.intersection(&parts)
            }),
        ),
        (
            "soft lens",
            object(|t| {
                let parts = pair(t, 0.5);
                t.smooth_intersection(&parts, 0.3)
            }),
        ),
        (
            "bitten ball",
            object(|t| {
                let parts = pair(t, 0.5);
                t.difference(&parts)
            }),
        ),
        (
            "drilled box",
            object(|t| {
                let (cube, hole) = (t.rounded_box(Vec3::splat(1.6), 0.1), t.cylinder(0.4, 3.0));
                t.smooth_difference(&[cube, hole], 0.2)
            }),
        ),
        (
            "stone",
            object(|t| {
                let ball = t.sphere(1.0);
                t.fbm_noise(ball, NOISE)
            }),
        ),
        (
            "lattice",
            object(|t| {
                let ball = t.sphere(0.2);
                t.repetition(ball, Vec3::new(0.6, 0.8, 1.0), Some(1))
            }),
        ),
        (
            "screw",
            object(|t| {
                let bar = t.rounded_box(Vec3::new(0.8, 2.0, 0.4), 0.05);
                t.twist(bar, 60.0)
            }),
        ),
        (
            "bow",
            object(|t| {
                let bar = t.rounded_box(Vec3::new(2.0, 0.4, 0.4), 0.05);
                let bow = t.bend(bar, 40.0);
                t.transform(bow, Vec3::Y, Mat3::from_quat(Quat::from_rotation_x(0.6)), 0.7)
            }),
        ),
        (
            "heap",
            object(|t| {
                let mut random = Random(35);
                let parts: Vec<_> = (0..60)
                    .map(|i| {
                        let part = if i % 2 == 0 { t.sphere(0.2) } else { t.torus(0.2, 0.06) };
                        moved(t, part, random.direction() * random.within(0.2, 1.2))
                    })
                    .collect();
                t.smooth_union(&parts, 0.05)
            }),
        ),
    ]
}

/// Solids that are estimates.
pub(super) fn fractals() -> Vec<(&'static str, Sdf)> {
    vec![
        ("bulb 8", object(|t| t.mandelbulb(8.0, 10, 4.0))),
        ("bulb 7.3", object(|t| t.mandelbulb(7.3, 6, 4.0))),
        ("julia", object(|t| t.julia(Vec4::new(-0.2, 0.6, 0.2, 0.2), 10))),
    ]
}
