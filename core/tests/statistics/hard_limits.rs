//! Owns the hard cases of limits: a triangle light seen under any angle, a sky with a glaring pixel, one pixel, one sample,
//! no light, very many samples.

use super::furnace::{ball, close_up};
use super::hard_scenes::folder;
use super::random::Random;
use super::scenes::{Shot, Shown};
use super::support::{fingerprint, render, scene_in};
use glam::{DVec3, Vec3};
use karst_core::light::{Receiver, mesh_lights};
use karst_core::scene::{Assets, Document, Folder, Limits};
use std::path::Path;

const GRAY: &str = r#"{"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}"#;

/// Solid angle of a triangle from the origin (Van Oosterom and Strackee 1983).
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (a, b, c) = (a.normalize(), b.normalize(), c.normalize());
    2.0 * libm::atan2(a.dot(b.cross(c)).abs(), 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// The mean of 1 / density over samples is the solid angle, from 1e-10 to nearly half of the sphere.
#[test]
fn case_15_a_triangle_light_of_any_solid_angle() {
    let corner =
        |angle: f64, distance: f64| DVec3::new(libm::cos(angle), libm::sin(angle), 0.0) + DVec3::Z * distance;
    let third = std::f64::consts::TAU / 3.0;
    for distance in [1.2e5, 1e3, 30.0, 3.0, 1.0, 0.3, 0.01, 1.3e-3] {
        // Counter-clockwise as seen from below, where the receiver is.
        let triangle = [corner(0.0, distance), corner(2.0 * third, distance), corner(third, distance)];
        let want = solid_angle(triangle);
        let (lights, _) = mesh_lights(&[triangle.map(DVec3::as_vec3)], Vec3::ONE);
        let from = Receiver { p: Vec3::ZERO, n: Vec3::ZERO };
        let mut random = Random::new(15);
        let (mut sum, n) = (0.0, 1 << 16);
        for _ in 0..n {
            let Some(s) = lights[0].sample(&from, random.pair()) else { continue };
            assert!(s.pdf > 0.0 && s.pdf.is_finite() && (s.wi.length() - 1.0).abs() < 1e-5, "{s:?}");
            sum += 1.0 / f64::from(s.pdf);
        }
        let got = sum / f64::from(n);
        println!("distance {distance:e}: solid angle {want:.4e}, mean of 1 / pdf {got:.4e}");
        assert!((got / want - 1.0).abs() < 0.01, "distance {distance}: {got} against {want}");
    }
}

/// A sky of dim texels and one that is a million times brighter, on a diffuse floor: the irradiance is a sum over texels.
#[test]
fn case_16_a_sky_with_a_glaring_pixel() {
    const WIDTH: usize = 64;
    const HEIGHT: usize = 32;
    let glaring = (40, 9);
    let folder = folder(&[("square.obj", "v -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nf 1 2 3 4\n")]);
    let radiance = |x: usize, y: usize| if (x, y) == glaring { 1e4_f32 } else { 1e-2 };
    let path = folder.path().join("sky.exr");
    exr::prelude::write_rgb_file(&path, WIDTH, HEIGHT, |x, y| {
        (radiance(x, y), radiance(x, y), radiance(x, y))
    })
    .unwrap();
    let mut irradiance = 0.0;
    for y in 0..HEIGHT {
        // Rows run over equal angles from +y down: cos θ sin θ dθ dφ by the midpoint of the row.
        let theta = (y as f64 + 0.5) / HEIGHT as f64 * std::f64::consts::PI;
        let solid =
            libm::sin(theta) * std::f64::consts::PI / HEIGHT as f64 * std::f64::consts::TAU / WIDTH as f64;
        irradiance +=
            (0..WIDTH).map(|x| f64::from(radiance(x, y)) * libm::cos(theta).max(0.0) * solid).sum::<f64>();
    }
    let members = format!(
        r#""materials": {{"m": {GRAY}}}, "meshes": {{"square": {{"file": "square.obj"}}}},
        "instances": {{"floor": {{"mesh": "square", "material": "m"}}}},
        "lights": {{"sky": {{"type": "environment", "image": "sky.exr"}}}}"#
    );
    let shown = Shot { vfov: 5.0, spp: 256, ..Shot::from(DVec3::new(1.0, 3.0, 0.5)) }
        .take_in(folder.path(), &members);
    let want = 0.5 * irradiance / std::f64::consts::PI;
    println!("{:.5} ± {:.5}, expected {want:.5}", shown.mean, shown.error);
    // Texels are blended into their neighbours, over which the cosine bends a little.
    assert!(
        (shown.mean / want - 1.0).abs() < 0.01 + 4.9 * shown.error / want,
        "{} against {want}",
        shown.mean
    );
    assert!(shown.error < 0.01 * want, "the texel is not found: ± {}", shown.error);
}

#[test]
fn case_25_the_smallest_pictures() {
    let one = |spp| Shot { side: 1, spp, ..close_up(1, 3) }.take(&ball(GRAY));
    let single = one(1);
    assert!(single.mean.is_finite() && single.film.summary().rmse.is_none(), "one sample knows no error");
    // So many samples that sums in f32 alone would drift by a thousandth.
    let many = one(65_536);
    println!("65536 samples: {:.6} ± {:.6}", many.mean, many.error);
    assert!((many.mean - 0.5).abs() < 1e-4, "{}", many.mean);
    let dark = Shot { side: 1, ..close_up(16, 3) }.take(&format!(r#""materials": {{"m": {GRAY}}}, "spheres": {{"ball": {{"center": [0, 0, 0], "radius": 1, "material": "m"}}}}"#));
    assert_eq!(dark.mean, 0.0, "no light, no picture");
    assert!(dark.picture.depth[0].is_finite());
}

/// The message of a document whose assets do not load.
fn refusal(folder: &Path, members: &str) -> String {
    let text = close_up(1, 1).document(members);
    let limits = Limits::default();
    let document = Document::parse(&text, "test.json", &limits).unwrap_or_else(|p| panic!("{p}"));
    let source = Folder::new(folder).unwrap_or_else(|e| panic!("{e}"));
    Assets::load(&document, &source, &limits).map(|_| ()).expect_err("loads").to_string()
}

fn textured(file: &str) -> String {
    ball(&format!(r#"{{"type": "diffuse", "reflectance": {{"type": "image", "file": "{file}"}}}}"#))
}

#[test]
fn case_25_textures_without_numbers_and_very_wide_ones() {
    let folder = folder(&[]);
    let at = |x, y| if (x, y) == (3, 1) { f32::NAN } else { 0.5_f32 };
    exr::prelude::write_rgb_file(folder.path().join("holes.exr"), 8, 4, |x, y| (at(x, y), 0.5_f32, 0.5_f32))
        .unwrap();
    let message = refusal(folder.path(), &textured("holes.exr"));
    println!("{message}");
    assert!(message.contains("holes.exr") && message.contains('3') && message.contains('1'), "{message}");
    image::RgbImage::from_pixel(16_384, 2, image::Rgb([188, 188, 188]))
        .save(folder.path().join("wide.png"))
        .unwrap();
    let Shown { mean, error, .. } = close_up(64, 1).take_in(folder.path(), &textured("wide.png"));
    // 188 of 255 in sRGB is 0.5029 of the light.
    assert!((mean - 0.5029).abs() < 1e-3 + 4.9 * error, "{mean}");
}

/// A frame is the same whether others came before it or not.
#[test]
fn case_25_a_frame_after_others_and_alone() {
    let text = close_up(8, 1).document(&ball(GRAY)).replacen(
        r#""version": 1,"#,
        r#""version": 1, "animation": {"fps": 25, "frames": [0, 200], "tracks": {"spheres.ball.center": {"keys": [{"frame": 0, "value": [0, 0, 0]}, {"frame": 200, "value": [0.5, 0, 0]}]}}},"#,
        1,
    );
    let picture = |frame| fingerprint(&render(&scene_in(Path::new("."), &text, frame), 16, 2).picture());
    let (first, after) = (picture(0), picture(137));
    assert_ne!(first, after);
    assert_eq!(picture(137), after);
}
