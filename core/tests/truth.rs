//! Owns scenes whose answer is known: furnaces, form factors, estimators that must agree.

mod support;

use glam::Vec3;
use support::{mean_of, pooled_mean, render, scene};

fn furnace(extra: &str) -> String {
    format!(
        r#"{{"version": 1,
        "camera": {{"type": "perspective", "vfov": 70, "transform": {{"look_at": {{"eye": [0.3, 0.2, 0.1], "target": [1, 0, 0], "up": [0, 1, 0]}}}}}},
        "film": {{"width": 48, "height": 32, "filter": {{"type": "box"}}}},
        "sampling": {{"spp": 256, "seed": 1}},
        "integrator": {{"max_depth": 128, "roulette_depth": 5}},
        "materials": {{"gray": {{"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}}}},
        {extra}}}"#
    )
}

/// Radiance in a closed surface of albedo ρ and emission e is e / (1 − ρ) everywhere.
#[test]
fn a_closed_sphere_of_albedo_and_emission_one_half_shows_one() {
    let text = furnace(
        r#""spheres": {"wall": {"center": [0, 0, 0], "radius": 2, "material": "gray", "emission": [0.5, 0.5, 0.5], "flip_normals": true}}"#,
    );
    let film = render(&scene(&text), 32, 2);
    let (mean, error) = pooled_mean(&film);
    assert!((mean - 1.0).abs() < 0.002, "mean {mean} ± {error}");
    assert!(error < 0.0005, "the test has no power: ± {error}");
    let counters = film.summary().counters;
    assert_eq!((counters.nan_samples, counters.infinite_samples), (0, 0));
}

/// A convex diffuse object in a uniform environment shows its albedo, whatever its shape: here a sphere and an
/// SDF torus seen from outside (the torus is not convex, but light that it scatters onto itself stays below).
#[test]
fn a_white_environment_shows_the_albedo() {
    let text = furnace(
        r#""spheres": {"ball": {"center": [4, 0, 0], "radius": 3.5, "material": "gray"}},
           "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}}"#,
    );
    let picture = render(&scene(&text), 32, 2).picture();
    let ball: Vec<Vec3> =
        picture.color.iter().zip(&picture.depth).filter(|(_, d)| d.is_finite()).map(|(c, _)| *c).collect();
    assert!(ball.len() > 500);
    assert!((mean_of(&ball) - 0.5).abs() < 0.003, "{}", mean_of(&ball));
    assert!(ball.iter().all(|c| (c.x - 0.5).abs() < 0.08));
}

/// Irradiance at distance d below a sphere of radius R and radiance L is π L (R/d)²: light found by sampling it and
/// light found by scattering must add up to it.
#[test]
fn a_sphere_light_lights_a_plane_by_its_form_factor() {
    for (radius, tolerance) in [(0.05, 0.004), (0.9, 0.004)] {
        let text = format!(
            r#"{{"version": 1,
            "camera": {{"type": "perspective", "vfov": 0.5, "transform": {{"look_at": {{"eye": [3, 1, 0], "target": [0, 0, 0], "up": [0, 1, 0]}}}}}},
            "film": {{"width": 16, "height": 16, "filter": {{"type": "box"}}}},
            "sampling": {{"spp": 1024, "seed": 3}},
            "integrator": {{"max_depth": 2, "roulette_depth": 5}},
            "materials": {{"white": {{"type": "diffuse", "reflectance": [0.8, 0.8, 0.8]}}}},
            "spheres": {{"lamp": {{"center": [0, 1, 0], "radius": {radius}, "material": "white", "emission": [2, 2, 2]}}}},
            "sdf_objects": {{"floor": {{"material": "white", "tree": {{"type": "transform", "translate": [0, -0.5, 0], "child": {{"type": "box", "size": [4, 1, 4]}}}}}}}}}}"#
        );
        let (mean, error) = pooled_mean(&render(&scene(&text), 16, 2));
        let want = 0.8 * 2.0 * radius * radius;
        assert!((mean / want - 1.0).abs() < tolerance, "radius {radius}: {mean} ± {error}, expected {want}");
    }
}

/// A sphere in closed form and as a distance function: equal pictures within the noise.
#[test]
fn an_sdf_sphere_looks_like_a_sphere() {
    let lit = r#""lights": {"sky": {"type": "environment", "radiance": [0.2, 0.3, 0.4]}}"#;
    let lamp = r#""lamp": {"center": [3, 3, 1], "radius": 0.5, "material": "gray", "emission": [9, 8, 7]}"#;
    let closed = format!(
        r#"{lit}, "spheres": {{{lamp}, "ball": {{"center": [4, 0, 0], "radius": 1.5, "material": "gray"}}}}"#
    );
    let marched = format!(
        r#"{lit}, "spheres": {{{lamp}}}, "sdf_objects": {{"ball": {{"material": "gray",
        "transform": {{"translate": [4, 0, 0]}}, "tree": {{"type": "sphere", "radius": 1.5}}}}}}"#
    );
    let (a, ea) = pooled_mean(&render(&scene(&furnace(&closed)), 32, 2));
    let (b, eb) = pooled_mean(&render(&scene(&furnace(&marched)), 32, 2));
    assert!((a - b).abs() < 4.0 * libm::hypot(ea, eb) + 1e-4, "{a} ± {ea} against {b} ± {eb}");
}

/// Rays that leave a wall do not find it again, and none slips through a corner: a closed box of albedo and emission one
/// half shows one, with walls exactly in the coordinate planes, large against the distance of the camera from its
/// corner, and turned and moved away from the origin.
#[test]
fn a_closed_box_neither_shadows_itself_nor_leaks() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("box.obj"), BOX).unwrap();
    for place in [
        r#"{"scale": 2}"#,
        r#"{"scale": 556}"#,
        r#"{"scale": 30, "rotate": [20, 30, 40], "translate": [-5, -12, -8]}"#,
        r#"{"scale": 4000, "rotate": [20, 30, 40], "translate": [-2000, -1000, -700]}"#,
    ] {
        let text = furnace(&format!(
            r#""meshes": {{"box": {{"file": "box.obj"}}}},
            "instances": {{"box": {{"mesh": "box", "material": "gray", "transform": {place},
            "emission": [0.5, 0.5, 0.5], "flip_normals": true}}}}"#
        ));
        let (mean, error) = pooled_mean(&render(&support::scene_in(folder.path(), &text, 1), 32, 2));
        println!("{place}: {mean} ± {error}");
        assert!((mean - 1.0).abs() < 0.002, "{place}: mean {mean} ± {error}");
    }
}

const BOX: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n";
