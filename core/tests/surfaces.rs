//! What surfaces do to light beside their scattering, against closed forms: bumps, normal maps, holes, and lamps that
//! are there in part or hardly at all.

mod support;

use glam::{Vec2, Vec3};
use karst_core::film::Picture;
use std::f32::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::Path;
use support::{mean_of, render, scene_in};

const SIDE: u32 = 16;

/// Where the sun's light comes from.
const TOWARDS_SUN: Vec3 = Vec3::new(-1.0, 2.0, -0.7);

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"))
}

fn write(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}

/// A square from (−1, 0, −1) to (1, 0, 1), its front upwards, with the texture coordinates `uv` of a place (x, z).
fn square(uv: impl Fn(f32, f32) -> Vec2) -> String {
    let mut text = String::new();
    for (x, z) in [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
        let uv = uv(x, z);
        let _ = writeln!(text, "v {x} 0 {z}\nvt {} {}", uv.x, uv.y);
    }
    text + "f 1/1 2/2 3/3 4/4\n"
}

/// Texture coordinates by x and z.
type Uv = fn(f32, f32) -> Vec2;

/// u to the right (+x), v to the back (−z).
fn plain(x: f32, z: f32) -> Vec2 {
    Vec2::new(0.5 + 0.5 * x, 0.5 - 0.5 * z)
}

/// A picture of what lies around the origin, from straight above, of surfaces lit directly only.
fn above(folder: &Path, spp: u32, members: &str) -> Picture {
    let text = format!(
        r#"{{"version": 1,
        "camera": {{"type": "perspective", "vfov": 20,
            "transform": {{"look_at": {{"eye": [0, 3, 0], "target": [0, 0, 0], "up": [0, 0, -1]}}}}}},
        "film": {{"width": {SIDE}, "height": {SIDE}, "filter": {{"type": "box"}}}},
        "sampling": {{"spp": {spp}, "seed": 4}},
        "integrator": {{"max_depth": 2}},
        {members}}}"#
    );
    render(&scene_in(folder, &text, 1), 16, 2).picture()
}

fn sun() -> String {
    let d = -TOWARDS_SUN;
    format!(
        r#""lights": {{"sun": {{"type": "sun", "direction": [{}, {}, {}], "irradiance": [1, 1, 1], "angular_size": 0}}}}"#,
        d.x, d.y, d.z
    )
}

/// The floor with more members of its material and of its mesh, under the sun.
fn floor(folder: &Path, material: &str, mesh: &str) -> Picture {
    let members = format!(
        r#""materials": {{"m": {{"type": "diffuse", "reflectance": [1, 1, 1] {material}}}}},
        "meshes": {{"floor": {{"file": "floor.obj" {mesh}}}}},
        "instances": {{"floor": {{"mesh": "floor", "material": "m"}}}}, {}"#,
        sun()
    );
    above(folder, 4, &members)
}

/// Every pixel of the picture is what a diffuse surface with this normal sends back.
fn assert_tilted(picture: &Picture, normal: Vec3, what: &str) {
    let expected = normal.normalize().dot(TOWARDS_SUN.normalize()).max(0.0) / PI;
    for (at, color) in picture.color.iter().enumerate() {
        assert!(
            (color.x - expected).abs() < 2.0e-4,
            "{what}: pixel {at} is {}, expected {expected}",
            color.x
        );
    }
}

#[test]
fn a_normal_map_tilts_along_u_and_v() {
    let folder = folder();
    let mirrored = |x: f32, z: f32| Vec2::new(0.5 - 0.5 * x, 0.5 - 0.5 * z);
    let turned = |x: f32, z: f32| Vec2::new(0.5 - 0.5 * z, 0.5 - 0.5 * x);
    // Where u and v point, by the coordinates above and whether v is flipped.
    let cases: [(&str, Uv, &str, Vec3, Vec3); 4] = [
        ("plain", plain, "", Vec3::X, -Vec3::Z),
        ("u mirrored", mirrored, "", -Vec3::X, -Vec3::Z),
        ("turned", turned, "", -Vec3::Z, -Vec3::X),
        ("v flipped", plain, r#", "flip_v": true"#, Vec3::X, Vec3::Z),
    ];
    for (name, uv, mesh, u, v) in cases {
        write(&folder.path().join("floor.obj"), &square(uv));
        for local in [
            Vec3::new(0.0, 0.0, 1.0),
            Vec3::new(0.6, 0.0, 0.8),
            Vec3::new(0.0, 0.6, 0.8),
            Vec3::new(-0.3, 0.4, 0.75),
        ] {
            let texel = local * 0.5 + 0.5;
            let map = format!(r#", "normal_map": [{}, {}, {}]"#, texel.x, texel.y, texel.z);
            let picture = floor(folder.path(), &map, mesh);
            assert_tilted(
                &picture,
                u * local.x + v * local.y + Vec3::Y * local.z,
                &format!("{name}, {local}"),
            );
        }
    }
}

#[test]
fn a_ramp_of_bumps_is_a_slope() {
    let folder = folder();
    write(&folder.path().join("floor.obj"), &square(plain));
    // Heights from 0 to 1 along u, and along v, which runs upwards in the image.
    let image = |name: &str, size: [usize; 2], height: &(dyn Fn(usize, usize) -> f32 + Sync)| {
        exr::prelude::write_rgb_file(folder.path().join(name), size[0], size[1], |x, y| {
            let height = height(x, y);
            (height, height, height)
        })
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    };
    image("u.exr", [64, 1], &|x, _| (x as f32 + 0.5) / 64.0);
    image("v.exr", [1, 64], &|_, y| 1.0 - (y as f32 + 0.5) / 64.0);
    // The square is two units wide: a ramp of half a unit rises by a quarter.
    for (name, uphill) in [("u.exr", Vec3::X), ("v.exr", -Vec3::Z)] {
        let bump =
            format!(r#", "bump": {{"type": "image", "file": "{name}", "wrap": "clamp"}}, "bump_scale": 0.5"#);
        assert_tilted(&floor(folder.path(), &bump, ""), Vec3::Y - uphill * 0.25, name);
    }
}

/// A ball of few flat faces with the normals of a true ball.
fn ball() -> String {
    let (around, down) = (9, 6);
    let mut text = String::new();
    for row in 0..=down {
        for column in 0..=around {
            let (u, v) = (column as f32 / around as f32, row as f32 / down as f32);
            let (sin, cos) = (libm::sinf(PI * v), libm::cosf(PI * v));
            let (x, y, z) = (sin * libm::cosf(TAU * u), -cos, sin * libm::sinf(-TAU * u));
            let _ = writeln!(text, "v {x} {y} {z}\nvn {x} {y} {z}\nvt {u} {v}");
        }
    }
    for row in 0..down {
        for column in 0..around {
            let a = row * (around + 1) + column + 1;
            let [b, c, d] = [a + 1, a + around + 2, a + around + 1];
            let _ = writeln!(
                text,
                "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}\nf {a}/{a}/{a} {c}/{c}/{c} {d}/{d}/{d}"
            );
        }
    }
    text
}

#[test]
fn bumps_of_no_height_leave_smooth_meshes_smooth() {
    let folder = folder();
    write(&folder.path().join("ball.obj"), &ball());
    let with = |more: &str| {
        let members = format!(
            r#""materials": {{"m": {{"type": "diffuse", "reflectance": [1, 1, 1] {more}}}}},
            "meshes": {{"ball": {{"file": "ball.obj"}}}},
            "instances": {{"ball": {{"mesh": "ball", "material": "m", "transform": {{"scale": 0.4}}}}}}, {}"#,
            sun()
        );
        above(folder.path(), 4, &members)
    };
    let smooth = with("");
    let level = r#"{"type": "checkerboard", "color0": [0.5, 0.5, 0.5], "color1": [0.5, 0.5, 0.5]}"#;
    for (name, more) in [
        ("bump", format!(r#", "bump": {level}"#)),
        ("normal map", r#", "normal_map": [0.5, 0.5, 1]"#.to_owned()),
    ] {
        let found = with(&more);
        let far = found.color.iter().zip(&smooth.color).map(|(a, b)| (*a - *b).abs().max_element());
        let far = far.fold(0.0, f32::max);
        assert!(far < 1.0e-4, "{name}: a pixel differs by {far}");
    }
    // The test sees facets: without normals the picture is another one.
    let flat = ball().lines().filter(|line| !line.starts_with("vn")).fold(String::new(), |text, line| {
        let line = line.split(' ').map(|word| word.rsplit_once('/').map_or(word, |(start, _)| start));
        text + &line.collect::<Vec<_>>().join(" ") + "\n"
    });
    write(&folder.path().join("ball.obj"), &flat);
    let facets = with("");
    let far = facets.color.iter().zip(&smooth.color).map(|(a, b)| (*a - *b).abs().max_element());
    assert!(far.fold(0.0, f32::max) > 0.01);
}

#[test]
fn a_surface_that_is_there_in_part_lets_the_rest_through() {
    let folder = folder();
    write(&folder.path().join("floor.obj"), &square(plain));
    // Seen through a black pane: a sky of radiance 1.
    let through = |opacity: &str| {
        let members = format!(
            r#""materials": {{"m": {{"type": "diffuse", "reflectance": [0, 0, 0], "opacity": {opacity}}}}},
            "meshes": {{"floor": {{"file": "floor.obj"}}}},
            "instances": {{"floor": {{"mesh": "floor", "material": "m"}}}},
            "lights": {{"sky": {{"type": "environment"}}}}"#
        );
        above(folder.path(), 256, &members)
    };
    for opacity in ["0", "0.25", "1"] {
        let expected = 1.0 - opacity.parse::<f64>().unwrap_or(f64::NAN);
        let mean = mean_of(&through(opacity).color);
        // 65,536 samples, each of them 0 or 1.
        assert!((mean - expected).abs() < 0.008, "opacity {opacity}: {mean}, expected {expected}");
    }
    // Four fields over the square: opaque where the board is white.
    let board = r#"{"type": "checkerboard", "color0": [1, 1, 1], "color1": [0, 0, 0]}"#;
    let picture = through(board);
    let at = |x: u32, y: u32| picture.color[(y * SIDE + x) as usize].x;
    let (low, high) = (SIDE / 4, 3 * SIDE / 4);
    assert_eq!([at(low, high), at(high, high), at(low, low), at(high, low)], [0.0, 1.0, 1.0, 0.0]);
}

#[test]
fn a_lamp_that_is_there_in_part_shines_in_part() {
    let folder = folder();
    write(&folder.path().join("floor.obj"), &square(plain));
    let lit = |opacity: f32, emission: f32| {
        let members = format!(
            r#""materials": {{"gray": {{"type": "diffuse", "reflectance": [0.8, 0.8, 0.8]}},
                "lamp": {{"type": "diffuse", "reflectance": [0, 0, 0], "opacity": {opacity}}}}},
            "meshes": {{"floor": {{"file": "floor.obj"}}}},
            "instances": {{"floor": {{"mesh": "floor", "material": "gray"}},
                "lamp": {{"mesh": "floor", "material": "lamp", "emission": [{emission}, {emission}, {emission}],
                    "transform": {{"matrix": [[0, 1, 0, -1.2], [-1, 0, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]]}}}}}},
            "spheres": {{"bulb": {{"center": [1.2, 0.8, 0], "radius": 0.4, "material": "lamp",
                "emission": [{emission}, {emission}, {emission}]}}}}"#
        );
        mean_of(&above(folder.path(), 1024, &members).color)
    };
    let (whole, half) = (lit(1.0, 1.0), lit(0.5, 2.0));
    assert!(whole > 0.05, "the lamps light the floor: {whole}");
    // The noise of 262,144 paths, of which some tenths find a lamp.
    assert!((half / whole - 1.0).abs() < 0.015, "half of twice the light: {half}, the whole: {whole}");
}

#[test]
fn lamps_too_small_for_their_place_are_no_light_and_no_harm() {
    // A triangle of a thousandth, so far out that its corners are the same point there.
    let folder = folder();
    write(&folder.path().join("lamp.obj"), "v 0 0 0\nv 0 0 0.001\nv 0.001 0 0\nf 1 2 3\n");
    let text = r#"{"version": 1,
        "camera": {"type": "perspective", "vfov": 0.1,
            "transform": {"look_at": {"eye": [100000, 100001, 100000], "target": [100000, 100000, 100000], "up": [0, 0, -1]}}},
        "film": {"width": 16, "height": 16}, "sampling": {"spp": 4, "seed": 4},
        "materials": {"m": {"type": "diffuse"}},
        "meshes": {"lamp": {"file": "lamp.obj"}},
        "instances": {"lamp": {"mesh": "lamp", "material": "m", "emission": [1, 1, 1],
            "transform": {"translate": [100000, 100000, 100000]}}}}"#;
    let picture = render(&scene_in(folder.path(), text, 1), 16, 2).picture();
    assert!(picture.color.iter().all(|color| color.is_finite()));
}
