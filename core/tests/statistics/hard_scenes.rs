//! Owns the hard cases of whole scenes: closed rooms, bent normals, sizes far apart, lights in bad places. Each has its
//! number; numbers 1 to 8 are beside the materials, number 6 beside the furnaces.

use super::furnace::{ball, close_up, material};
use super::oracle::Disney;
use super::random::Random;
use super::scenes::{Shot, Shown, list, mean_of};
use glam::{DVec3, Vec3};
use karst_core::bvh::Cast;
use karst_core::bvh::triangle::TriangleBvh;
use karst_core::math::Ray;
use std::path::Path;

const GRAY: &str = r#"{"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}"#;

/// A folder with some files.
pub(crate) fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap_or_else(|e| panic!("{e}"));
    }
    folder
}

/// A white rough room gains light with every reflection: only the depth ends it, and `check` says so.
#[test]
fn case_09_a_closed_room_that_gains_light_stays_finite_and_is_reported() {
    let p = Disney { base_color: [1.0; 3], roughness: 1.0, ..Disney::PLAIN };
    let members = |depth_name: &str| {
        format!(
            r#""materials": {{"{depth_name}": {}}},
            "spheres": {{"wall": {{"center": [0, 0, 0], "radius": 2, "material": "{depth_name}", "emission": [0.1, 0.1, 0.1], "flip_normals": true}}}}"#,
            material(&p)
        )
    };
    let shot = |max_depth| Shot { max_depth, spp: 64, vfov: 60.0, ..Shot::from(DVec3::new(0.3, 0.1, 0.2)) };
    let (short, long) = (shot(8).take(&members("m")), shot(128).take(&members("m")));
    println!("after 8 surfaces {:.3}, after 128 {:.3}", short.mean, long.mean);
    assert!(long.mean.is_finite() && long.mean > 2.0 * short.mean);
    let scene = shot(8).scene_in(Path::new("."), &members("m"));
    let peak = scene.albedo_peaks().into_iter().map(|peak| peak.albedo).fold(0.0, f32::max);
    println!("reported albedo {peak:.3}");
    assert!(peak > 1.2, "the report says {peak}");
}

/// A square whose normals lean 80 degrees.
const LEANING: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0.985 0 0.174\nf 1//1 2//1 3//1 4//1\n";

#[test]
fn case_10_normals_that_lean_far_create_no_light() {
    let folder = folder(&[("leaning.obj", LEANING)]);
    for (name, material) in [
        ("diffuse", r#"{"type": "diffuse", "reflectance": [1, 1, 1]}"#.to_owned()),
        ("mirror", r#"{"type": "mirror"}"#.to_owned()),
        ("conductor", r#"{"type": "conductor", "alpha": 0.3}"#.to_owned()),
        ("glass", r#"{"type": "dielectric", "alpha": 0.2}"#.to_owned()),
        ("smooth glass", r#"{"type": "dielectric"}"#.to_owned()),
    ] {
        let members = format!(
            r#""materials": {{"m": {material}}}, "meshes": {{"leaning": {{"file": "leaning.obj"}}}},
            "instances": {{"square": {{"mesh": "leaning", "material": "m"}}}},
            "lights": {{"sky": {{"type": "environment", "radiance": [1, 1, 1]}}}}"#
        );
        // From the side that the normals lean away from, nearly along them, and from behind.
        for eye in [
            DVec3::new(-4.0, 0.0, 1.0),
            DVec3::new(4.0, 0.0, 1.0),
            DVec3::new(0.0, 0.0, 4.0),
            DVec3::new(1.0, 2.0, -3.0),
        ] {
            let shown = Shot { vfov: 8.0, spp: 256, ..Shot::from(eye) }.take_in(folder.path(), &members);
            let greatest = shown.picture.color.iter().map(|c| c.max_element()).fold(0.0, f32::max);
            println!(
                "{name} from {eye}: mean {:.4} ± {:.4}, greatest pixel {greatest:.3}",
                shown.mean, shown.error
            );
            // Radiance of a sky of 1 seen through glass is at most 1 on this side, 1 everywhere else; in the leaning
            // normal's glass the other side is denser by 1.5².
            let most = if name.contains("glass") { 1.5 * 1.5 } else { 1.0 };
            assert!(shown.mean <= most + 4.9 * shown.error + 1e-4, "{name} from {eye}: {}", shown.mean);
        }
    }
}

/// Balls of all sizes far from the origin: a convex diffuse ball in a white sky shows its albedo, so a ray that finds its
/// own start darkens it; and the ball covers what a disk of its size covers.
#[test]
fn case_11_sizes_and_places_far_apart() {
    for (center, radius) in [(1e4, 1.0), (1e6, 1.0), (0.0, 1e-4), (0.0, 1e5), (100.0, 1e-2)] {
        let at = DVec3::new(center, 0.0, 0.0);
        let other = if radius < 1.0 { 1e5 } else { 1e-4 };
        // The other ball stays behind the camera, so far away that it takes nothing from the sky.
        let members = format!(
            r#""materials": {{"m": {GRAY}}}, "spheres": {{"ball": {{"center": {}, "radius": {radius:?}, "material": "m"}},
            "other": {{"center": {}, "radius": {other:?}, "material": "m"}}}},
            "lights": {{"sky": {{"type": "environment", "radiance": [1, 1, 1]}}}}"#,
            list(at),
            list(DVec3::new(center, 0.0, 200.0 * other + 100.0 * radius)),
        );
        let distance = 4.0;
        let shot = Shot {
            side: 64,
            spp: 16,
            vfov: 40.0,
            eye: at + DVec3::new(0.0, 0.0, distance * radius),
            target: at,
            ..Shot::from(DVec3::Z)
        };
        let shown = shot.take(&members);
        let hit: Vec<usize> = (0..64 * 64).filter(|i| shown.picture.depth[*i].is_finite()).collect();
        // A pixel's angle: half the picture is tan 20°; the ball's edge is at asin(1/4).
        let edge = 1.0 / (distance * distance - 1.0).sqrt() / libm::tan(20.0_f64.to_radians()) * 32.0;
        let covered = hit.len() as f64;
        let (least, most) =
            (std::f64::consts::PI * (edge - 1.0).powi(2), std::f64::consts::PI * (edge + 1.5).powi(2));
        println!("center {center:e}, radius {radius:e}: {covered} pixels of {least:.0} to {most:.0}");
        assert!((least..most).contains(&covered), "center {center}, radius {radius}: {covered}");
        if center < 1e5 * radius {
            let inner: Vec<Vec3> =
                hit.iter().filter(|i| inside(**i, edge - 2.0)).map(|i| shown.picture.color[*i]).collect();
            let darkest = inner.iter().map(|c| c.x).fold(9.0, f32::min);
            println!("  mean {:.5}, darkest {darkest}", mean_of(&inner));
            // The sky is lit evenly, and weights of cosine sampling are exact: a lost sample is the only error but for
            // that of sampling the light.
            assert!(
                (mean_of(&inner) - 0.5).abs() < 2e-3,
                "center {center}, radius {radius}: {}",
                mean_of(&inner)
            );
        }
    }
}

/// Whether a pixel of a picture of 64 × 64 is within so many pixels of the middle.
fn inside(pixel: usize, radius: f64) -> bool {
    let (x, y) = ((pixel % 64) as f64 - 31.5, (pixel / 64) as f64 - 31.5);
    libm::hypot(x, y) < radius
}

/// Rays aimed at the very edges and corners of closed meshes: from outside each meets one, from inside none gets out.
#[test]
fn case_12_no_ray_slips_between_triangles() {
    let mut random = Random::new(12);
    let (mut rays, mut missed) = (0_u32, 0_u32);
    for _ in 0..20_000 {
        // A tetrahedron of any shape and place; its corners are shared, so its faces are closed.
        let center = random.direction() * random.between(0.0, 100.0);
        let size = libm::exp2f(random.between(-6.0, 6.0));
        let corners: [Vec3; 4] = std::array::from_fn(|_| center + random.direction() * size);
        let faces =
            [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]].map(|face: [usize; 3]| face.map(|i| corners[i]));
        let volume = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[3] - corners[0]);
        if volume.abs() < 1e-3 * size.powi(3) {
            continue;
        }
        let tree = TriangleBvh::build(faces.into_iter()).unwrap();
        let middle = corners.iter().sum::<Vec3>() * 0.25;
        for _ in 0..50 {
            let (a, b) = ((random.bits() % 4) as usize, (random.bits() % 4) as usize);
            let target = corners[a].lerp(corners[b], if random.chance(0.2) { 0.0 } else { random.unit() });
            // From within a closed surface every ray meets it, wherever it is aimed.
            let ray = Ray::new(middle, target - middle);
            rays += 1;
            let cast = Cast::new(ray.o, ray.d);
            if tree.intersect(&cast, ray.t_max).is_none() || !tree.occluded(&cast, ray.t_max) {
                missed += 1;
            }
        }
    }
    println!("{rays} rays at edges and corners from inside, {missed} got out");
    assert!(rays > 900_000);
    assert_eq!(missed, 0);
}

#[test]
fn case_13_broken_triangles_are_dropped_or_named() {
    use karst_core::mesh::read;
    let read = |text: &str| read(text.as_bytes(), "mesh.obj", 1000);
    let good = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let flat = read(&format!("{good}v 0.5 0 0\nf 1 2 4\nf 1 2 3\nf 1 1 2\n")).unwrap();
    assert_eq!(
        (flat.triangles.len(), flat.dropped),
        (1, 2),
        "triangles without area are left out and counted"
    );
    let needle = read(&format!("{good}v 0.5 1e-7 0\nf 1 2 4\nf 1 2 3\n")).unwrap();
    assert!(needle.triangles.len() + needle.dropped as usize == 2);
    let twice = read(&format!("{good}f 1 2 3\nf 1 2 3\n")).unwrap();
    assert_eq!(twice.triangles.len(), 2, "the same triangle twice is no error");
    let error = read("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n").unwrap_err().to_string();
    assert!(error.contains("vertex 1") || error.contains("vertex 2") || error.contains("line 2"), "{error}");
    // What is left renders: needle, twins and a lonely triangle in one scene.
    let folder = folder(&[
        ("needle.obj", &format!("{good}v 0.5 1e-7 0\nf 1 2 4\nf 1 2 3\n")),
        ("twins.obj", &format!("{good}f 1 2 3\nf 1 2 3\n")),
        ("one.obj", &format!("{good}f 1 2 3\n")),
    ]);
    let files = ["needle", "twins", "one"];
    let meshes = files.map(|n| format!(r#""{n}": {{"file": "{n}.obj"}}"#)).join(", ");
    let instances = files
        .map(|n| format!(r#""{n}": {{"mesh": "{n}", "material": "m", "emission": [0.1, 0.1, 0.1]}}"#))
        .join(", ");
    let members = format!(
        r#""materials": {{"m": {GRAY}}}, "meshes": {{{meshes}}}, "instances": {{{instances}}},
        "lights": {{"sky": {{"type": "environment", "radiance": [1, 1, 1]}}}}"#
    );
    let shown =
        Shot { vfov: 40.0, target: DVec3::new(0.3, 0.3, 0.0), ..Shot::from(DVec3::new(0.3, 0.3, 2.0)) }
            .take_in(folder.path(), &members);
    assert!(shown.mean > 0.4 && shown.mean < 1.2, "{}", shown.mean);
}

const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";

/// A lamp that lies in a wall, a lamp inside a ball, a wall that begins a hair from a lamp: finite, and no brighter than
/// the lamp.
#[test]
fn case_14_lights_in_bad_places() {
    let folder = folder(&[("square.obj", SQUARE)]);
    for (name, lamp, wall) in [
        ("in the wall", r#"{"scale": 0.5}"#, r#"{"scale": 2}"#),
        ("a hair before the wall", r#"{"scale": 0.5, "translate": [0, 0, 1e-4]}"#, r#"{"scale": 2}"#),
        ("across the wall", r#"{"scale": 0.5, "rotate": [0, 90, 0]}"#, r#"{"scale": 2}"#),
    ] {
        let members = format!(
            r#""materials": {{"m": {GRAY}}}, "meshes": {{"square": {{"file": "square.obj"}}}},
            "instances": {{"lamp": {{"mesh": "square", "material": "m", "transform": {lamp}, "emission": [1, 1, 1]}},
            "wall": {{"mesh": "square", "material": "m", "transform": {wall}}}}}"#
        );
        let shown = Shot { vfov: 60.0, spp: 64, ..Shot::from(DVec3::new(0.5, 0.3, 3.0)) }
            .take_in(folder.path(), &members);
        let greatest = shown.picture.color.iter().map(|c| c.max_element()).fold(0.0, f32::max);
        println!("lamp {name}: mean {:.4}, greatest pixel {greatest:.3}", shown.mean);
        // Facing walls of albedo 1/2 can at most double a radiance of 1.
        assert!(greatest < 2.5, "{name}: {greatest}");
        assert!(shown.mean > 0.0, "{name}: black");
    }
    for body in [GRAY, r#"{"type": "dielectric", "alpha": 0.2}"#] {
        let members = format!(
            r#""materials": {{"m": {body}, "g": {GRAY}}}, "spheres": {{"ball": {{"center": [0, 0, 0], "radius": 1, "material": "m"}},
            "lamp": {{"center": [0.2, 0, 0], "radius": 0.3, "material": "g", "emission": [1, 1, 1]}}}}"#
        );
        let shown = close_up(64, 1).take(&members);
        let dark = body == GRAY;
        println!("lamp in a ball: {:.4}", shown.mean);
        assert!(
            if dark { shown.mean == 0.0 } else { shown.mean > 0.01 && shown.mean < 1.5 },
            "{}",
            shown.mean
        );
    }
}

/// A sky with one bright pixel, a black sky, a sun that sets: pictures agree with closed forms.
#[test]
fn case_16_skies() {
    // Black: nothing, and no division by nothing.
    let black = ball(GRAY).replace("[1, 1, 1]", "[0, 0, 0]");
    assert_eq!(close_up(16, 1).take(&black).mean, 0.0);
    // A sun at the horizon of a floor, half of it below: irradiance of the upper half of a disk is E · 2 sin α · …, small
    // and finite; from above it is the irradiance itself.
    let folder = folder(&[("square.obj", SQUARE)]);
    let under = |direction: DVec3, size: f64| -> Shown {
        let members = format!(
            r#""materials": {{"m": {GRAY}}}, "meshes": {{"square": {{"file": "square.obj"}}}},
            "instances": {{"floor": {{"mesh": "square", "material": "m"}}}},
            "lights": {{"sun": {{"type": "sun", "direction": {}, "irradiance": [3, 3, 3], "angular_size": {size}}}}}"#,
            list(direction)
        );
        Shot { vfov: 5.0, spp: 256, ..Shot::from(DVec3::new(1.0, 0.5, 3.0)) }.take_in(folder.path(), &members)
    };
    for size in [0.0, 0.5, 10.0] {
        let above = under(DVec3::NEG_Z, size);
        let want = 0.5 * 3.0 / std::f64::consts::PI;
        println!("sun of {size}° above: {:.5} ± {:.5}, expected {want:.5}", above.mean, above.error);
        assert!((above.mean / want - 1.0).abs() < 1e-3 + 4.9 * above.error / want, "{size}: {}", above.mean);
        let setting = under(DVec3::X, size);
        // ∫ max(cos, 0) over a disk whose middle is at the horizon, by radius a: 2/3 a³ of a solid angle of π a².
        let radius = libm::sin((0.5 * size).to_radians());
        let want = 0.5 * 3.0 / std::f64::consts::PI * 2.0 / (3.0 * std::f64::consts::PI) * radius;
        println!("sun of {size}° setting: {:.6} ± {:.6}, expected {want:.6}", setting.mean, setting.error);
        assert!(
            (setting.mean - want).abs() < 0.02 * want + 4.9 * setting.error + 1e-6,
            "{size}: {} against {want}",
            setting.mean
        );
    }
}
