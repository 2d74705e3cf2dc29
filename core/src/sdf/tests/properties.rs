//! Properties that hold for every tree.

use glam::{DVec3, Mat3, Quat, Vec3};
use proptest::prelude::{Just, Strategy, prop, prop_oneof, proptest};

use super::{Random, pack};
use crate::sdf::{NodeId, NoiseParameters, Point, Sdf, Settings, Tape, TapeBuilder};

/// A tree as data, for proptest to make and shrink.
#[derive(Debug, Clone)]
enum Shape {
    Sphere(f32),
    Cuboid(Vec3),
    RoundedBox(Vec3, f32),
    Torus(f32, f32),
    Cylinder(f32, f32),
    Capsule(f32, f32),
    Cone(f32, f32, f32),
    Ellipsoid(Vec3),
    /// Cut by a ball, so that it ends.
    Plane(f32),
    /// Hard where there is no `k`.
    Operator(Kind, Vec<Self>, Option<f32>),
    Displaced(Box<Self>, NoiseParameters),
    /// Gaps between copies, in units of the child's size, and copies on either side; made only where the child ends.
    Repeated(Box<Self>, Vec3, u32),
    /// Degrees per unit of length.
    Twisted(Box<Self>, f32),
    Bent(Box<Self>, f32),
    Transform(Box<Self>, Vec3, Vec3, f32),
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Union,
    Intersection,
    Difference,
}

fn add(t: &mut TapeBuilder, shape: &Shape) -> NodeId {
    match shape {
        Shape::RoundedBox(size, part) => t.rounded_box(*size, 0.5 * part * size.min_element()),
        Shape::Cylinder(radius, height) => t.cylinder(*radius, *height),
        Shape::Capsule(radius, height) => t.capsule(*radius, *height),
        Shape::Cone(radius, top, height) => t.cone(*radius, *top, *height),
        Shape::Ellipsoid(radii) => t.ellipsoid(*radii),
        Shape::Plane(radius) => {
            let parts = [t.plane(), t.sphere(*radius)];
            t.intersection(&parts)
        }
        Shape::Sphere(radius) => t.sphere(*radius),
        Shape::Cuboid(size) => t.cuboid(*size),
        Shape::Torus(major, minor) => t.torus(*major, *minor),
        Shape::Operator(kind, children, k) => {
            let ids: Vec<_> = children.iter().map(|child| add(t, child)).collect();
            match (kind, k) {
                (Kind::Union, None) => t.union(&ids),
                (Kind::Union, Some(k)) => t.smooth_union(&ids, *k),
                (Kind::Intersection, None) => t.intersection(&ids),
                (Kind::Intersection, Some(k)) => t.smooth_intersection(&ids, *k),
                (Kind::Difference, None) => t.difference(&ids),
                (Kind::Difference, Some(k)) => t.smooth_difference(&ids, *k),
            }
        }
        Shape::Repeated(child, gaps, count) => {
            let hull = compile(child).bounds();
            let reach = hull.max.max(-hull.min);
            let period = if hull.is_empty() { *gaps } else { 2.0 * reach * (Vec3::ONE + *gaps) };
            let child = add(t, child);
            t.repetition(child, period, Some(*count))
        }
        Shape::Twisted(child, degrees) => {
            let child = add(t, child);
            t.twist(child, *degrees)
        }
        Shape::Bent(child, degrees) => {
            let child = add(t, child);
            t.bend(child, *degrees)
        }
        Shape::Displaced(child, parameters) => {
            let child = add(t, child);
            t.fbm_noise(child, *parameters)
        }
        Shape::Transform(child, translate, axis, scale) => {
            let child = add(t, child);
            let turn = Mat3::from_quat(Quat::from_scaled_axis(*axis));
            t.transform(child, *translate, turn, *scale)
        }
    }
}

fn compile(shape: &Shape) -> Tape {
    let mut builder = TapeBuilder::new();
    let root = add(&mut builder, shape);
    builder.finish(root).expect("generated trees are valid")
}

fn vector(reach: f32) -> impl Strategy<Value = Vec3> {
    [-reach..reach, -reach..reach, -reach..reach].prop_map(Vec3::from_array)
}

fn sizes() -> impl Strategy<Value = Vec3> {
    [0.01_f32..2.0, 0.01_f32..2.0, 0.01_f32..2.0].prop_map(Vec3::from_array)
}

fn noises() -> impl Strategy<Value = NoiseParameters> {
    (0.0_f32..0.5, 0.2_f32..5.0, 1_u32..6, 0.0_f32..=1.0, 1.0_f32..3.0, 0_u32..9).prop_map(
        |(amplitude, frequency, octaves, gain, lacunarity, seed)| NoiseParameters {
            amplitude,
            frequency,
            octaves,
            gain,
            lacunarity,
            seed,
        },
    )
}

fn kind() -> impl Strategy<Value = Kind> {
    prop_oneof![Just(Kind::Union), Just(Kind::Intersection), Just(Kind::Difference)]
}

fn shapes() -> impl Strategy<Value = Shape> {
    let leaf = prop_oneof![
        (0.01_f32..2.0).prop_map(Shape::Sphere),
        sizes().prop_map(Shape::Cuboid),
        (0.1_f32..2.0, 0.0_f32..0.5).prop_map(|(major, minor)| Shape::Torus(major, minor)),
        (sizes(), 0.0_f32..=1.0).prop_map(|(size, part)| Shape::RoundedBox(size, part)),
        (0.01_f32..2.0, 0.01_f32..2.0).prop_map(|(radius, height)| Shape::Cylinder(radius, height)),
        (0.01_f32..2.0, 0.0_f32..2.0).prop_map(|(radius, height)| Shape::Capsule(radius, height)),
        (0.01_f32..2.0, prop_oneof![Just(0.0_f32), 0.01_f32..2.0], 0.01_f32..2.0)
            .prop_map(|(radius, top, height)| Shape::Cone(radius, top, height)),
        sizes().prop_map(Shape::Ellipsoid),
        (0.01_f32..2.0).prop_map(Shape::Plane),
    ];
    leaf.prop_recursive(5, 24, 4, move |inner| {
        prop_oneof![
            (kind(), prop::collection::vec(inner.clone(), 1..4))
                .prop_map(|(kind, children)| Shape::Operator(kind, children, None)),
            (kind(), prop::collection::vec(inner.clone(), 1..4), prop_oneof![Just(0.0_f32), 1e-3_f32..3.0])
                .prop_map(|(kind, children, k)| Shape::Operator(kind, children, Some(k))),
            (inner.clone(), [0.1_f32..2.0, 0.1_f32..2.0, 0.1_f32..2.0], 1_u32..4).prop_map(
                |(child, gaps, count)| Shape::Repeated(Box::new(child), Vec3::from_array(gaps), count)
            ),
            (inner.clone(), -200.0_f32..200.0)
                .prop_map(|(child, degrees)| Shape::Twisted(Box::new(child), degrees)),
            (inner.clone(), -200.0_f32..200.0)
                .prop_map(|(child, degrees)| Shape::Bent(Box::new(child), degrees)),
            (inner.clone(), noises())
                .prop_map(|(child, parameters)| Shape::Displaced(Box::new(child), parameters)),
            (inner, vector(2.0), vector(3.0), 0.1_f32..4.0)
                .prop_map(|(child, t, axis, scale)| Shape::Transform(Box::new(child), t, axis, scale)),
        ]
    })
}

fn at(tape: &Tape, p: Vec3) -> f64 {
    let p = p.as_dvec3();
    tape.distance(Point::new(p.x, p.y, p.z))
}

proptest! {
    #[test]
    fn values_change_no_faster_than_the_bound(shape in shapes(), p in vector(6.0), q in vector(6.0), near in 1e-4_f32..1.0) {
        let tape = compile(&shape);
        for q in [q, p + (q - p) * near] {
            let change = (at(&tape, p) - at(&tape, q)).abs();
            let allowed = f64::from(tape.lipschitz()) * (p.as_dvec3() - q.as_dvec3()).length();
            // Rotations rounded to f32 stretch by up to about 3e-7 each.
            assert!(change <= allowed * (1.0 + 1e-5) + 1e-12, "{change} over {allowed}");
        }
    }

    #[test]
    fn f32_values_are_close_to_f64_values(shape in shapes(), p in vector(6.0)) {
        let tape = compile(&shape);
        let (short, long) = (f64::from(tape.distance::<f32>(Point::splat(p))), at(&tape, p));
        let magnitude = f64::from(p.abs().max_element().max(tape.reach())).max(long.abs());
        assert!((short - long).abs() <= 16.0 * magnitude / 16_777_216.0 + 1e-6 * magnitude, "{short} and {long}");
    }

    #[test]
    fn outside_the_bounds_values_are_positive(shape in shapes(), p in vector(12.0), near in 0.0_f32..1.0) {
        let tape = compile(&shape);
        let bounds = tape.bounds();
        if bounds.is_empty() {
            assert!(at(&tape, p) > 0.0);
            return Ok(());
        }
        // Anywhere, and close to the box.
        for p in [p, bounds.center() + (p - bounds.center()).normalize() * bounds.size().length() * near] {
            let gap = (p - p.clamp(bounds.min, bounds.max)).abs().max_element();
            // The box itself is rounded.
            if gap > 1e-5 {
                assert!(at(&tape, p) > 0.0, "{} at {p}, {gap} outside", at(&tape, p));
            }
        }
    }

    #[test]
    fn cells_leave_out_nothing_that_matters(
        parts in prop::collection::vec(shapes(), 34..38), places in prop::collection::vec(vector(4.0), 38),
        kinds in prop::collection::vec((kind(), prop_oneof![Just(None), (1e-3_f32..1.0).prop_map(Some)]), 8),
        seed in 0_u64..99,
    ) {
        // Operators of operators, so that what is left out is in all places of the list.
        let mut parts: Vec<_> = parts
            .into_iter()
            .zip(places)
            .map(|(part, place)| Shape::Transform(Box::new(part), place, Vec3::ZERO, 0.5))
            .collect();
        for (kind, k) in kinds {
            let some = parts.split_off(parts.len().saturating_sub(4));
            parts.insert(0, Shape::Operator(kind, some, k));
        }
        let tape = compile(&Shape::Operator(Kind::Union, parts, None));
        if tape.bounds().is_empty() {
            return Ok(());
        }
        let sdf = Sdf::new(tape, Settings::default(), None).expect("bounds hold");
        let mut random = Random(seed);
        let bounds = sdf.bounds();
        for _ in 0..200 {
            let points: [Vec3; 8] = std::array::from_fn(|_| {
                let share = Vec3::new(random.next(), random.next(), random.next());
                bounds.min + bounds.size() * share
            });
            let found = sdf.distances(pack(points), 0xff).to_array();
            for (p, found) in points.into_iter().zip(found) {
                let whole: f32 = sdf.tape().distance(Point::splat(p));
                assert_eq!(found.to_bits(), whole.to_bits(), "{found} instead of {whole} at {p}");
            }
        }
    }

    #[test]
    fn smooth_union_is_within_a_quarter_k_of_the_union(a in vector(1.0), p in vector(3.0), k in 0.0_f32..5.0) {
        let two = |k: f32| {
            let mut t = TapeBuilder::new();
            let (left, right) = (t.sphere(0.7), t.sphere(0.4));
            let right = t.transform(right, a, Mat3::IDENTITY, 1.0);
            let root = t.smooth_union(&[left, right], k);
            t.finish(root).expect("valid")
        };
        let (smooth, hard) = (at(&two(k), p), at(&two(0.0), p));
        assert!(smooth <= hard + 1e-12 && smooth >= hard - 0.25 * f64::from(k) - 1e-6);
    }

    #[test]
    fn fractals_are_outside_out_of_their_bounds(
        power in 2.0_f32..12.0, whole in 2_u8..12, iterations in 1_u32..14, bailout in 2.0_f32..32.0, d in vector(1.0),
        away in 1.0_f32..4.0,
    ) {
        for power in [power, f32::from(whole)] {
            let mut t = TapeBuilder::new();
            let root = t.mandelbulb(power, iterations, bailout);
            let tape = t.finish(root).expect("valid");
            let p = d.as_dvec3().normalize_or(DVec3::Y) * f64::from(tape.bounds().max.x * away);
            let value = tape.distance(Point::new(p.x, p.y, p.z));
            assert!(value > 0.0, "power {power}: {value} at {p}");
        }
    }

    #[test]
    fn whole_powers_equal_the_trigonometric_form(whole in 2_u8..12, p in vector(1.2)) {
        // One iteration: a power next to the whole one takes the other path.
        let bulb = |power: f32| {
            let mut t = TapeBuilder::new();
            let root = t.mandelbulb(power, 1, 2.0);
            t.finish(root).expect("valid")
        };
        let (a, b) = (at(&bulb(f32::from(whole)), p), at(&bulb(f32::from(whole).next_up()), p));
        // Close to the bailout radius one of the two may stop an iteration earlier.
        if a.signum() == b.signum() {
            assert!((a - b).abs() < 1e-3 * a.abs().max(0.01), "{a} and {b}");
        }
    }
}
