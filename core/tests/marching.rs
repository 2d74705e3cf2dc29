//! What rays against distance functions cost is counted by object and by pixel, the same however the work is cut.

mod support;

use karst_core::encode::object_statistics;
use karst_core::film::Film;
use support::{render, scene};

/// A torus and a rounded box that are marched, a ball that is met by formula, and a wall with a hole pattern in front.
const SCENE: &str = r#"{
    "version": 1,
    "camera": {"type": "perspective", "vfov": 40, "transform": {"look_at": {"eye": [0, 1, 6], "target": [0, 0, 0]}}},
    "film": {"width": 40, "height": 33},
    "sampling": {"spp": 12},
    "materials": {
        "matte": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]},
        "sieve": {"type": "diffuse", "opacity": {"type": "solid_checkerboard", "color0": 1, "color1": 0}},
        "orbits": {"type": "diffuse", "reflectance": {"type": "orbit_trap", "far": 0.5}}
    },
    "sdf_objects": {
        "ring": {"material": "matte", "transform": {"rotate": [70, 0, 0]},
                 "tree": {"type": "torus", "major_radius": 1, "minor_radius": 0.3}},
        "ball": {"material": "matte", "transform": {"translate": [1.5, 0, 0]}, "tree": {"type": "sphere", "radius": 0.5}},
        "screen": {"material": "sieve", "transform": {"translate": [-1.2, 0, 1]},
                   "tree": {"type": "rounded_box", "size": [1.5, 2, 0.1], "radius": 0.02}},
        "bulb": {"material": "orbits", "transform": {"translate": [0, 1.5, -1], "scale": 0.6},
                 "tree": {"type": "mandelbulb"}}
    },
    "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}}
}"#;

fn without_functions() -> String {
    let start = SCENE.find("\"sdf_objects\"").expect("there are some");
    let end = SCENE.find("\"lights\"").expect("there are some");
    let ball = r#""spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "matte"}}, "#;
    format!("{}{ball}{}", &SCENE[..start], &SCENE[end..])
}

#[test]
fn evaluations_are_counted_once_by_object_and_by_pixel() {
    let scene = scene(SCENE);
    let film = render(&scene, 16, 2);
    let (summary, objects, picture) = (film.summary(), film.objects(), film.picture());
    assert_eq!(scene.function_names(), ["ring", "ball", "screen", "bulb"]);
    assert_eq!(objects.len(), 4);
    for (name, object) in scene.function_names().iter().zip(objects) {
        println!("{name}: {object:?}");
        assert!(object.rays > 1000 && object.brackets > 100 && object.brackets <= object.rays, "{name}");
    }
    let total: u64 = objects.iter().map(|object| object.evaluations).sum();
    assert_eq!(total, summary.counters.sdf_evaluations);
    assert_eq!(objects.iter().map(|object| object.exhausted).sum::<u64>(), summary.counters.exhausted_rays);
    let by_pixel: f64 = picture.evaluations.iter().map(|&mean| (f64::from(mean) * 12.0).round()).sum();
    assert_eq!(by_pixel, total as f64, "every evaluation belongs to a pixel");
    // A ball alone is met by formula, so that only its box costs.
    let statistics = object_statistics(scene.function_names(), objects);
    let ball = statistics.as_array().and_then(|all| all.iter().find(|object| object["object"] == "ball"));
    let per_ray = ball.and_then(|ball| ball["evaluations_per_ray"].as_f64()).expect("it is named");
    assert!(per_ray < 1.0, "{per_ray}");
    assert!(statistics[0]["evaluations_per_ray"].as_f64().expect("a number") > 10.0, "{statistics}");
}

#[test]
fn counts_do_not_depend_on_how_the_work_is_cut() {
    let scene = scene(SCENE);
    let (one, other) = (render(&scene, 16, 1), render(&scene, 64, 2));
    assert_eq!(one.objects(), other.objects());
    assert_eq!(one.picture().evaluations, other.picture().evaluations);
    assert_eq!(one.summary().counters, other.summary().counters);
}

#[test]
fn counts_survive_being_stored() {
    let film = render(&scene(SCENE), 32, 2);
    let bytes = film.to_bytes();
    let read = Film::from_bytes(&bytes).expect("a film");
    assert_eq!(read, film);
    for length in [0, 3, 31, 90, bytes.len() / 2, bytes.len() - 1] {
        assert!(Film::from_bytes(&bytes[..length]).is_err(), "{length} bytes of {}", bytes.len());
    }
    // A number of objects that the bytes cannot hold is not allocated: it stands behind the counters.
    let mut hostile = bytes;
    let at = 4 + 6 * 4 + 4 + 7 * 8;
    assert_eq!(hostile[at..at + 4], 4_u32.to_le_bytes());
    hostile[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(Film::from_bytes(&hostile).is_err());
}

#[test]
fn scenes_without_distance_functions_have_no_such_layer() {
    let film = render(&scene(&without_functions()), 32, 2);
    assert_eq!(film.objects(), []);
    assert!(film.picture().evaluations.is_empty());
    assert_eq!(film.summary().counters.sdf_evaluations, 0);
}
