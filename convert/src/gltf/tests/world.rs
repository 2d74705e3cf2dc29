//! Owns the tests of lights and cameras.

use karst_core::scene::{Camera, Light};
use serde_json::{Value, json};

use super::{Parts, differs, error, near, ok, square, untranslated};

/// A file with one node that has a light, under a node that is turned, moved and stretched.
fn lit(light: &Value) -> Value {
    Parts::default().file(&json!({
        "nodes": [
            {"children": [1], "translation": [1, 2, 3], "scale": [2, 2, 5]},
            // A quarter turn about x: -z becomes y.
            {"rotation": [0.707_106_77, 0, 0, 0.707_106_77], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "buffers": [],
        "extensions": {"KHR_lights_punctual": {"lights": [light]}},
    }))
}

#[test]
fn lights_keep_their_numbers() {
    let (converted, description) =
        ok(&lit(&json!({"type": "point", "color": [1, 0.5, 0], "intensity": 20, "name": "p"})));
    assert_eq!(
        converted.document["lights"]["p"],
        json!({"type": "point", "position": [1.0, 2.0, 3.0], "intensity": [20.0, 10.0, 0.0]})
    );
    assert_eq!(description.lights.len(), 1);
    let (_, description) = ok(&lit(&json!({"type": "directional", "intensity": 3})));
    let Light::Sun { direction, irradiance, angular_size } = description.lights.values().next().unwrap()
    else {
        panic!("expected a sun");
    };
    near(direction.normalize().to_array(), &[0.0, 1.0, 0.0]);
    assert_eq!((irradiance.to_array(), *angular_size), ([3.0; 3], 0.0));
}

#[test]
fn spots_fall_between_their_cones() {
    let (converted, description) =
        ok(&lit(&json!({"type": "spot", "intensity": 2, "range": 9, "spot": {"innerConeAngle": 0.25}})));
    let Light::Spotlight { direction, intensity, beam_width, cutoff_angle, .. } =
        description.lights.values().next().unwrap()
    else {
        panic!("expected a spotlight");
    };
    near(direction.normalize().to_array(), &[0.0, 1.0, 0.0]);
    assert_eq!(intensity.unwrap().to_array(), [2.0; 3]);
    near([beam_width.unwrap(), cutoff_angle.unwrap()].map(f64::from), &[14.323_945, 45.0]);
    assert_eq!(differs(&converted).len(), 1);
    assert_eq!(
        untranslated(&converted),
        [
            "extensions.KHR_lights_punctual.lights[0]: the range 9: light falls with the squared distance alone"
        ]
    );
}

#[test]
fn lights_that_are_wrong_are_refused() {
    let place = "a.gltf: extensions.KHR_lights_punctual.lights[0]:";
    for (light, expected) in [
        (json!({"type": "area"}), "found the type \"area\", expected directional, point or spot"),
        (json!({"type": "point", "intensity": -1}), "found the intensity -1.0, expected none below 0"),
        (json!({"type": "point", "intensity": 1e300}), "found 1e300, expected at most 3.4028235e38"),
        (
            json!({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0}}),
            "found cones of 57.29577951308232 and 0.0 degrees, expected 0 <= inner < outer <= 90",
        ),
    ] {
        let found = error(&lit(&light));
        assert!(found.starts_with(&format!("{place} {expected}")), "{found}");
    }
}

#[test]
fn a_scene_without_light_gets_a_white_environment() {
    let (converted, _) = ok(&Parts::default().file(&json!({"nodes": [{}], "buffers": []})));
    assert_eq!(
        converted.document["lights"],
        json!({"environment": {"type": "environment", "radiance": [1, 1, 1]}})
    );
    assert!(converted.notes.iter().any(|note| note.text.starts_with("lights: the scene has no light")));
}

#[test]
fn the_first_camera_without_its_nodes_scale() {
    let file = Parts::default().file(&json!({
        "nodes": [
            {"children": [1, 2, 3], "scale": [3, -2, 5], "translation": [0, 0, 1]},
            {"camera": 0},
            {"camera": 1, "translation": [1, 1, 1]},
            {"camera": 1},
        ],
        "cameras": [
            {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 1}},
            {"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.5, "znear": 0.1}},
        ],
        "buffers": [],
    }));
    let (converted, description) = ok(&file);
    let Camera::Perspective { vfov, transform, .. } = description.camera;
    near([f64::from(vfov)], &[45.836_624]);
    near(transform.translation.to_array(), &[3.0, -2.0, 6.0]);
    // y of the node is turned around: the picture is upside down, and not mirrored.
    near(transform.matrix3.to_cols_array(), &[-1., 0., 0., 0., -1., 0., 0., 0., 1.]);
    assert_eq!((description.film.width, description.film.height), (1080, 720));
    assert_eq!(
        untranslated(&converted),
        ["cameras[0]: a camera without perspective", "nodes[3]: a further camera"]
    );
}

#[test]
fn a_scene_without_camera_is_seen_whole() {
    let (parts, primitive) = square();
    let file = parts.file(&json!({
        "nodes": [{"mesh": 0, "scale": [1000, 10, 1], "translation": [5e6, 0, 0]}],
        "meshes": [{"primitives": [primitive]}],
    }));
    let (converted, description) = ok(&file);
    let Camera::Perspective { vfov, transform, .. } = description.camera;
    let view = transform.inverse();
    let half = libm::tan(f64::from(vfov).to_radians() / 2.0);
    for (x, y) in [(0.0, 0.0), (1000.0, 0.0), (1000.0, 10.0), (0.0, 10.0)] {
        let p = view.transform_point3(glam::DVec3::new(5e6 + x, y, 0.0));
        let across = p.truncate().length() / (-p.z * half);
        assert!(p.z < 0.0 && across < 1.0 && across > 0.5, "{p} {across}");
    }
    assert!(converted.notes.iter().any(|note| note.text.starts_with("cameras: the scene has no camera")));
}

#[test]
fn cameras_that_are_wrong_are_refused() {
    let file = |perspective: Value| {
        let cameras = json!([{"type": "perspective", "perspective": perspective}]);
        Parts::default().file(&json!({"nodes": [{"camera": 0}], "cameras": cameras, "buffers": []}))
    };
    let found = error(&file(json!({"yfov": 3.2})));
    assert!(found.starts_with("a.gltf: cameras[0]: found the yfov 3.2"), "{found}");
    let found = error(&file(json!({"yfov": 1, "aspectRatio": 1e30})));
    assert!(found.starts_with("a.gltf: cameras[0]: found the aspectRatio 1e30"), "{found}");
}
