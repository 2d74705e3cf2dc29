//! Closed forms where surfaces meet: what a ray leaves, what touches, what is cut off flush.

use glam::{Mat3, Quat, Vec3};

use super::closed::closed;
use super::{Random, exact, hit, moved, object, ray};
use crate::sdf::{NodeId, Sdf, SdfRay, TapeBuilder};

/// Adds a solid or a tree to a builder.
pub(super) type Build = fn(&mut TapeBuilder) -> NodeId;

/// Solids without a hollow, about 1 in size.
pub(super) const CONVEX: [Build; 7] = [
    |t| t.sphere(1.0),
    |t| t.cuboid(Vec3::new(2.0, 1.0, 3.0)),
    |t| t.cylinder(0.7, 1.5),
    |t| t.capsule(0.4, 1.0),
    |t| t.cone(1.0, 0.0, 1.5),
    |t| t.cone(0.4, 1.0, 1.0),
    |t| t.ellipsoid(Vec3::new(1.0, 0.6, 0.8)),
];

pub(super) fn turned(t: &mut TapeBuilder, node: NodeId, to: Vec3, scale: f32) -> NodeId {
    let turn = Mat3::from_quat(Quat::from_scaled_axis(Vec3::new(0.4, -0.7, 0.2)));
    t.transform(node, to, turn, scale)
}

/// Points of the surface, as close to it as f32 allows.
fn surface(sdf: &Sdf, count: usize, random: &mut Random) -> Vec<Vec3> {
    let (middle, size) = (sdf.bounds().center(), 0.5 * sdf.bounds().size().length());
    let mut points = Vec::new();
    while points.len() < count {
        let origin = middle + random.direction() * size * 2.0;
        let target = middle + random.direction() * size * 0.5 * random.next();
        let ray = ray(origin, target - origin);
        let unit = ray.dir.as_dvec3().normalize();
        points.extend(closed(sdf, &ray).map(|t| (ray.origin.as_dvec3() + unit * t).as_vec3()));
    }
    points
}

#[test]
fn rays_that_leave_a_convex_solid_hit_nothing() {
    let (mut random, mut rays) = (Random(31), 0);
    for solid in CONVEX {
        for (scale, away) in [(1.0, 0.0), (1e-4, 0.0), (1e3, 0.0), (1.0, 1e2), (1e3, 1e4), (1e-2, 1.0)] {
            let sdf = object(|t| {
                let node = solid(t);
                turned(t, node, Vec3::new(0.6, -0.5, 0.6) * away, scale)
            });
            for p in surface(&sdf, 1200, &mut random) {
                let n = sdf.normal(p);
                let w = random.direction();
                // Every other ray along the surface; normals are good to a few millionths.
                let w = if rays % 2 == 0 { w } else { n.cross(w) + n * random.within(2e-5, 1e-3) };
                let w = (w * w.dot(n).signum()).normalize();
                if w.dot(n) < 1e-5 {
                    continue;
                }
                for start in [p, p + n * sdf.offset(p)] {
                    rays += 1;
                    let t = hit(&sdf, &ray(start, w));
                    assert_eq!(t, None, "scale {scale}, {away} away, {start} to {w}, normal {n}");
                }
            }
        }
    }
    println!("{rays} rays");
    assert!(rays > 90_000);
}

/// Checks that a ray which enters a solid of a size at `start` hits it from inside.
fn comes_out(sdf: &Sdf, start: Vec3, w: Vec3, size: f32, away: f32) {
    let at = |t: f64| exact(sdf, start.as_dvec3() + w.as_dvec3() * t);
    let least = f64::from(1e-3 * size);
    // Next to an edge it may pass by.
    if at(least) > 0.0 {
        return;
    }
    let t = f64::from(hit(sdf, &ray(start, w)).expect("comes out"));
    assert!(at(0.5 * t) < 0.0 && t > least, "{start} to {w}: {t}, {} half way", at(0.5 * t));
    assert!(at(t).abs() < f64::from(1e-6 * size.max(away)), "{start} to {w}: {t}, {}", at(t));
}

#[test]
fn rays_into_a_solid_come_out_on_the_far_side() {
    let mut random = Random(37);
    for solid in CONVEX {
        for (scale, away) in [(1.0, 0.0), (1e-4, 0.0), (1e3, 1e4)] {
            let sdf = object(|t| {
                let node = solid(t);
                turned(t, node, Vec3::splat(away), scale)
            });
            for p in surface(&sdf, 1000, &mut random) {
                let n = sdf.normal(p);
                let w = random.direction();
                let w = w * -w.dot(n).signum();
                if w.dot(n) < -0.05 {
                    comes_out(&sdf, p, w, scale, away);
                    comes_out(&sdf, p - n * sdf.offset(p), w, scale, away);
                }
            }
        }
    }
}

#[test]
fn rays_that_leave_one_solid_still_hit_another_close_by() {
    // A thin wall on a floor, and rays along the floor from where only rounding tells in from out.
    let sdf = object(|t| {
        let (floor, wall) = (t.cuboid(Vec3::new(4.0, 1.0, 4.0)), t.cuboid(Vec3::new(0.01, 1.0, 4.0)));
        let (floor, wall) = (moved(t, floor, Vec3::NEG_Y * 0.5), moved(t, wall, Vec3::X));
        t.union(&[floor, wall])
    });
    for height in [1e-7_f32, 1e-6] {
        for slope in [-1e-7_f32, 0.0, 1e-7, 1e-3] {
            let t =
                hit(&sdf, &ray(Vec3::new(0.3, height, 0.2), Vec3::new(1.0, slope, 0.0))).expect("the wall");
            assert!((t - 0.695).abs() < 1e-6, "height {height}, slope {slope}: {t}");
        }
    }
}

/// Eight boxes with an edge of 0.3 that make up one with an edge of 0.6.
fn eight(t: &mut TapeBuilder) -> NodeId {
    let boxes: Vec<_> = (0..8_u8)
        .map(|i| {
            let part = t.cuboid(Vec3::splat(0.3));
            let bit = |b: u8| f32::from(i >> b & 1);
            moved(t, part, Vec3::new(bit(0), bit(1), bit(2)) * 0.3 + 0.7)
        })
        .collect();
    let all = t.union(&boxes);
    turned(t, all, Vec3::new(0.1, 0.2, -0.3), 1.7)
}

#[test]
fn boxes_that_touch_have_no_seam() {
    let (parts, whole) = (
        object(eight),
        object(|t| {
            let all = t.cuboid(Vec3::splat(0.6));
            let all = moved(t, all, Vec3::splat(0.85));
            // A union of one is no operator: the placement is not multiplied out as that of the parts is not.
            let far = t.sphere(0.01);
            let all = t.union(&[all, far]);
            turned(t, all, Vec3::new(0.1, 0.2, -0.3), 1.7)
        }),
    );
    assert!(parts.is_closed() && whole.is_closed());
    let (mut random, mut hits) = (Random(41), 0);
    let (middle, size) = (parts.bounds().center(), 0.5 * parts.bounds().size().length());
    for i in 0..40_000 {
        // From inside, from outside, and from inside almost along the middle planes.
        let inner = middle + random.direction() * size * 0.3 * random.next();
        let outer = middle + random.direction() * size * 2.0;
        let ray = match i % 4 {
            0 => ray(outer, inner - outer),
            1 => ray(inner, random.direction()),
            _ => {
                let normal = Mat3::from_quat(Quat::from_scaled_axis(Vec3::new(0.4, -0.7, 0.2))).y_axis;
                let along = normal.cross(random.direction()).normalize();
                let start = middle + normal * size * random.within(-1e-3, 1e-3) + along * size * 0.1;
                ray(start, along + normal * random.within(-0.02, 0.02))
            }
        };
        let (got, want) = (hit(&parts, &ray), hit(&whole, &ray));
        assert_eq!(got.is_some(), want.is_some(), "{ray:?}: {got:?} and {want:?}");
        if let (Some(got), Some(want)) = (got, want) {
            hits += 1;
            assert!((got - want).abs() < 2e-5, "{ray:?}: {got} and {want}");
        }
    }
    assert!(hits > 30_000);
}

/// Rays through and past everything within 2 of the origin.
pub(super) fn around(count: u32) -> impl Iterator<Item = SdfRay> {
    let mut random = Random(43);
    (0..count).map(move |_| {
        let origin = random.direction() * random.within(0.0, 3.0);
        ray(origin, random.direction() * 0.8 - origin)
    })
}

#[test]
fn solids_less_themselves_are_nothing() {
    for solid in CONVEX {
        // Placed at once, and in two steps that are rounded apart from each other.
        let (first, then) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(-0.3, 0.7, 0.1));
        for nested in [false, true] {
            let sdf = object(|t| {
                let (whole, part) = (solid(t), solid(t));
                let whole = moved(t, whole, first + then);
                let part = if nested {
                    let (part, all) = (moved(t, part, then), t.sphere(100.0));
                    let part = t.intersection(&[part, all]);
                    moved(t, part, first)
                } else {
                    moved(t, part, first + then)
                };
                t.difference(&[whole, part])
            });
            for ray in around(3000) {
                assert_eq!(hit(&sdf, &ray), None, "{ray:?}");
            }
        }
    }
    // A cone of equal radii is a cylinder by another formula.
    let sdf = object(|t| {
        let parts = [t.cylinder(0.7, 1.5), t.cone(0.7, 0.7, 1.5)];
        t.difference(&parts)
    });
    for ray in around(3000) {
        assert_eq!(hit(&sdf, &ray), None, "{ray:?}");
    }
}

#[test]
fn holes_that_end_flush_are_open() {
    let drilled = |height: f32| {
        object(|t| {
            let (cube, hole) = (t.cuboid(Vec3::splat(1.2)), t.cylinder(0.4, height));
            // Turned and moved one by one: the ends are flush but for rounding.
            let (cube, hole) = (moved(t, cube, Vec3::splat(0.1)), moved(t, hole, Vec3::splat(0.1)));
            let parts = [turned(t, cube, Vec3::ONE, 0.9), turned(t, hole, Vec3::ONE, 0.9)];
            let all = t.difference(&parts);
            moved(t, all, Vec3::NEG_ONE)
        })
    };
    let (flush, through) = (drilled(1.2), drilled(2.0));
    for ray in around(20_000) {
        let (got, want) = (hit(&flush, &ray), hit(&through, &ray));
        assert_eq!(got.is_some(), want.is_some(), "{ray:?}: {got:?} and {want:?}");
        let apart = got.zip(want).map_or(0.0, |(got, want)| (got - want).abs());
        assert!(apart < 2e-6, "{ray:?}: {got:?} and {want:?}");
    }
}

#[test]
fn rays_in_faces_and_through_tips_end() {
    let two = object(|t| {
        let (a, b) = (t.cuboid(Vec3::ONE), t.cuboid(Vec3::ONE));
        let b = moved(t, b, Vec3::X);
        t.union(&[a, b])
    });
    // In the plane where two boxes touch there is no way between them.
    let t = hit(&two, &ray(Vec3::new(0.5, 0.1, 3.0), Vec3::NEG_Z)).expect("no seam");
    assert!((t - 2.5).abs() < 1e-6, "{t}");
    let cone = object(|t| t.cone(1.0, 0.0, 2.0));
    for (origin, dir, want) in [
        (Vec3::Y * 3.0, Vec3::NEG_Y, Some(2.0)),
        (Vec3::Y * -3.0, Vec3::Y, Some(2.0)),
        (Vec3::new(0.5, 3.0, 0.0), Vec3::NEG_Y, Some(3.0)),
        (Vec3::new(0.0, 0.0, 0.0), Vec3::Y, Some(1.0)),
        // Along the slant, a little inside and a little outside.
        (Vec3::new(-1.0, 2.9, 0.0), Vec3::new(1.0, -2.0, 0.0), Some(0.975 * 5.0_f32.sqrt())),
        (Vec3::new(-1.0, 3.1, 0.0), Vec3::new(1.0, -2.0, 0.0), None),
    ] {
        let got = hit(&cone, &ray(origin, dir));
        assert_eq!(got.is_some(), want.is_some(), "{origin} {dir}: {got:?}");
        let apart = got.zip(want).map_or(0.0, |(got, want)| (got - want).abs());
        assert!(apart < 1e-5, "{origin} {dir}: {got:?} and {want:?}");
    }
}
