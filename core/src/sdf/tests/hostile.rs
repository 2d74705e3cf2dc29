//! Bad and extreme input: an error that says so, or an answer; never a panic or a hang.

use glam::{Mat3, Vec3};

use super::{hit, object, ray, tape};
use crate::math::Aabb;
use crate::sdf::{
    MAX_DEPTH, MAX_NODES, MarchStats, NodeId, Point, Sdf, SdfError, SdfRay, Settings, TapeBuilder,
};

fn refused(build: impl FnOnce(&mut TapeBuilder) -> NodeId) -> String {
    let mut builder = TapeBuilder::new();
    let root = build(&mut builder);
    builder.finish(root).expect_err("must be refused").to_string()
}

#[test]
fn bad_parameters_are_named() {
    let cases = [
        (refused(|t| t.sphere(0.0)), "sphere.radius: found 0,"),
        (refused(|t| t.sphere(f32::NAN)), "sphere.radius: found NaN,"),
        (refused(|t| t.cuboid(Vec3::new(1.0, -2.0, 1.0))), "box.size: found -2,"),
        (refused(|t| t.torus(1.0, -0.5)), "torus.minor_radius: found -0.5,"),
        (refused(|t| t.torus(f32::INFINITY, 0.5)), "torus.major_radius: found inf,"),
        (refused(|t| t.mandelbulb(0.5, 8, 4.0)), "mandelbulb.power: found 0.5,"),
        (refused(|t| t.mandelbulb(f32::NAN, 8, 4.0)), "mandelbulb.power: found NaN,"),
        (refused(|t| t.mandelbulb(8.0, 0, 4.0)), "mandelbulb.iterations: found 0,"),
        (refused(|t| t.mandelbulb(8.0, 8, 1.0)), "mandelbulb.bailout: found 1,"),
        (refused(|t| t.mandelbulb(32.0, 8, 100.0)), "mandelbulb.bailout: found 100,"),
        (refused(|t| t.union(&[])), "union: found no children"),
        (refused(|t| t.smooth_union(&[], 0.1)), "smooth_union: found no children"),
        (
            refused(|t| {
                let a = t.sphere(1.0);
                t.smooth_union(&[a], -0.1)
            }),
            "smooth_union.k: found -0.1,",
        ),
        (
            refused(|t| {
                let a = t.sphere(1.0);
                t.transform(a, Vec3::ZERO, Mat3::IDENTITY, 0.0)
            }),
            "transform.scale: found 0,",
        ),
        (
            refused(|t| {
                let a = t.sphere(1.0);
                t.transform(a, Vec3::ZERO, Mat3::from_diagonal(Vec3::new(1.0, 2.0, 1.0)), 1.0)
            }),
            "transform.rotation: found 3,",
        ),
        (
            refused(|t| {
                let a = t.sphere(1.0);
                t.union(&[a, a])
            }),
            "node 0 is used twice",
        ),
    ];
    for (message, start) in cases {
        assert!(message.starts_with(start), "{message}\nshould start with {start}");
    }
}

#[test]
fn the_first_error_wins_and_later_nodes_do_no_harm() {
    let message = refused(|t| {
        let bad = t.sphere(-1.0);
        let worse = t.cuboid(Vec3::ZERO);
        t.union(&[bad, worse])
    });
    assert!(message.starts_with("sphere.radius: found -1,"), "{message}");
}

#[test]
fn ten_thousand_nodes_work() {
    let sdf = object(|t| {
        let balls: Vec<_> = (0..5000_u16)
            .map(|i| {
                let ball = t.sphere(0.4);
                t.transform(
                    ball,
                    Vec3::new(f32::from(i % 17), f32::from(i / 17 % 17), f32::from(i / 289)),
                    Mat3::IDENTITY,
                    1.0,
                )
            })
            .collect();
        t.union(&balls)
    });
    assert_eq!(sdf.tape().nodes(), 10_001);
    let t = hit(&sdf, &ray(Vec3::new(3.0, 4.0, -5.0), Vec3::Z)).expect("a ball");
    assert!((t - 4.6).abs() < 1e-5, "{t}");
}

#[test]
fn too_many_nodes_are_refused_with_the_figure() {
    let message = refused(|t| {
        let ids: Vec<_> = (0..MAX_NODES).map(|_| t.sphere(1.0)).collect();
        t.union(&ids)
    });
    assert!(message.contains("65537 nodes, allowed are 65536"), "{message}");
}

/// Unions nested to the right: every level holds one value back.
fn staircase(t: &mut TapeBuilder, levels: usize, k: f32) -> NodeId {
    let mut node = t.sphere(1.0);
    for i in 1..levels {
        let step = t.sphere(0.5);
        let step = t.transform(step, Vec3::X * (0.1 * i as f32), Mat3::IDENTITY, 1.0);
        node = t.smooth_union(&[step, node], k);
    }
    node
}

#[test]
fn sixty_four_levels_work_and_a_thousand_say_so() {
    let sdf = object(|t| staircase(t, 64, 0.1));
    assert!(hit(&sdf, &ray(Vec3::new(-4.0, 0.0, 0.0), Vec3::X)).is_some());
    let message = refused(|t| staircase(t, 1000, 0.1));
    assert!(message.starts_with("the tree is nested 1000 deep, allowed are 128"), "{message}");
    assert_eq!(MAX_DEPTH, 128);
}

#[test]
fn chains_of_transforms_collapse() {
    let deep = tape(|t| {
        let mut node = t.sphere(1.0);
        for _ in 0..10_000 {
            node = t.transform(node, Vec3::X * 0.001, Mat3::IDENTITY, 1.0);
        }
        node
    });
    let value: f32 = deep.distance(Point::splat(Vec3::new(12.0, 0.0, 0.0)));
    assert!((value - 1.0).abs() < 1e-5, "{value}");
}

#[test]
fn scales_that_leave_the_range_of_f32_are_refused() {
    let message = refused(|t| {
        let mut node = t.sphere(1.0);
        for _ in 0..40 {
            node = t.transform(node, Vec3::ZERO, Mat3::IDENTITY, 0.1);
        }
        node
    });
    assert!(message.starts_with("transform.scale: found"), "{message}");
}

#[test]
fn blends_of_no_width_and_of_huge_width_are_finite() {
    for k in [0.0, 1e-42, 1e-38, 1e-3, 1e3, 1e12] {
        let sdf = object(|t| {
            let (a, b) = (t.sphere(0.5), t.cuboid(Vec3::splat(0.5)));
            let b = t.transform(b, Vec3::X, Mat3::IDENTITY, 1.0);
            t.smooth_union(&[a, b], k)
        });
        let value: f32 = sdf.tape().distance(Point::splat(Vec3::new(0.3, 2.0, 0.1)));
        assert!(value.is_finite(), "k = {k}: {value}");
        let far = 2.0 * sdf.bounds().max.y;
        let t = hit(&sdf, &ray(Vec3::Y * far, Vec3::NEG_Y));
        assert!(t.is_some(), "k = {k}");
    }
}

#[test]
fn hostile_rays_end() {
    let bulb = object(|t| t.mandelbulb(8.0, 12, 4.0));
    let good = ray(Vec3::Z * 3.0, Vec3::NEG_Z);
    let closed = object(|t| {
        let (lens, cone) = (t.sphere(1.0), t.cone(0.8, 0.3, 3.0));
        t.difference(&[lens, cone])
    });
    assert!(closed.is_closed());
    for sdf in [&bulb, &closed] {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            for axis in 0..3 {
                let (mut origin, mut dir) = (good, good);
                origin.origin[axis] = bad;
                dir.dir[axis] = bad;
                for r in [origin, dir] {
                    assert!(hit(sdf, &r).is_none_or(f32::is_finite), "{r:?}");
                }
            }
            hit(sdf, &SdfRay { t_max: bad, ..good });
            hit(sdf, &SdfRay { t_min: bad, ..good });
            assert!(hit(sdf, &SdfRay { footprint: bad, ..good }).is_some());
        }
        assert_eq!(hit(sdf, &SdfRay { dir: Vec3::ZERO, ..good }), None);
        assert_eq!(hit(sdf, &SdfRay { t_min: 2.0, t_max: 1.0, ..good }), None);
    }
}

#[test]
fn steps_are_limited_and_counted() {
    let settings = Settings { max_steps: Some(3), ..Settings::default() };
    let sdf = Sdf::new(tape(|t| t.cuboid(Vec3::new(8.0, 1.0, 8.0))), settings, None).unwrap().marching();
    let mut stats = MarchStats::default();
    let grazing = ray(Vec3::new(-4.01, 0.51, 0.1), Vec3::new(1.0, -1e-3, 0.0));
    sdf.intersect(&grazing, &mut stats);
    assert_eq!(stats.exhausted, 1);
    assert!(stats.evaluations <= 8, "{stats:?}");
}

#[test]
fn rays_inside_a_fractal_end() {
    let bulb = object(|t| t.mandelbulb(8.0, 12, 4.0));
    let mut stats = MarchStats::default();
    for d in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE] {
        bulb.intersect(&ray(Vec3::new(0.1, 0.05, 0.02), d), &mut stats);
    }
    assert!(stats.evaluations < 4 * 4200, "{stats:?}");
}

#[test]
fn the_polar_axis_has_no_holes() {
    // Rays straight down at the pole and around it, where the estimate is least reliable.
    for power in [2.0, 8.0] {
        let bulb = object(|t| t.mandelbulb(power, 10, 4.0));
        for i in 0..200_u8 {
            let x = 0.0005 * f32::from(i);
            let r = ray(Vec3::new(x, 0.3 * x, 3.0), Vec3::NEG_Z);
            assert!(hit(&bulb, &r).is_some(), "power {power}, x = {x}");
        }
    }
}

#[test]
fn given_bounds_are_checked() {
    let make = |min: f32, max: f32| {
        let bounds = Aabb { min: Vec3::splat(min), max: Vec3::splat(max) };
        Sdf::new(tape(|t| t.sphere(1.0)), Settings::default(), Some(bounds))
    };
    assert!(make(-1.0, 1.0).is_ok());
    assert!(make(-50.0, 50.0).unwrap().bounds().max.x < 1.1, "bounds that are too large are tightened");
    match make(-1.0, 0.5) {
        Err(SdfError::BoundsTooSmall { amount, needed_max, .. }) => {
            assert!((0.4..=0.5).contains(&amount), "{amount}");
            assert_eq!(needed_max, Vec3::ONE);
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(make(5.0, 6.0), Err(SdfError::BoundsTooSmall { .. })));
    assert!(matches!(make(1.0, -1.0), Err(SdfError::Parameter { name: "bounds.max", .. })));
    assert!(matches!(make(f32::NAN, 1.0), Err(SdfError::Parameter { name: "bounds.min", .. })));
}

#[test]
fn bad_settings_are_named() {
    let make = |settings| Sdf::new(tape(|t| t.sphere(1.0)), settings, None).expect_err("refused").to_string();
    let zero = Some(0.0);
    assert!(
        make(Settings { hit_epsilon: zero, ..Settings::default() })
            .starts_with("settings.hit_epsilon: found 0,")
    );
    assert!(
        make(Settings { step_clamp: zero, ..Settings::default() })
            .starts_with("settings.step_clamp: found 0,")
    );
    let nan = Some(f32::NAN);
    assert!(
        make(Settings { normal_epsilon: nan, ..Settings::default() }).starts_with("settings.normal_epsilon")
    );
    assert!(
        make(Settings { max_steps: Some(0), ..Settings::default() })
            .starts_with("settings.max_steps: found 0,")
    );
}
