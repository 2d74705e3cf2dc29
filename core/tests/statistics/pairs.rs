//! Owns estimators that must agree: light found by scattering, by sampling lights, by both; with and without roulette.

use super::FAMILY;
use super::chi2::{limit_of, sidak};
use super::furnace::material;
use super::materials::everything;
use super::oracle::Disney;
use super::report::table;
use super::scenes::{Shot, Shown};
use glam::DVec3;
use karst_core::scene::Strategy;
use std::fmt::Write as _;
use std::path::Path;

/// A ball of a material on a floor, lit by what `lights` adds.
fn still(material: &str, lamp: &str, lights: &str) -> String {
    format!(
        r#""materials": {{"m": {material}, "gray": {{"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]}}}},
        "spheres": {{"ball": {{"center": [0, 0, 0], "radius": 1, "material": "m"}},
        "floor": {{"center": [0, -51, 0], "radius": 50, "material": "gray"}}{lamp}}},
        "lights": {{{lights}}}"#
    )
}

const LAMP: &str =
    r#", "lamp": {"center": [-2, 3, 2.5], "radius": 0.9, "material": "gray", "emission": [6, 5, 4]}"#;
const SKY: &str = r#""sky": {"type": "environment", "radiance": [0.5, 0.6, 0.7]}"#;
const SUN: &str =
    r#""sun": {"type": "sun", "direction": [1, -2, -1.5], "irradiance": [2, 2, 1.8], "angular_size": 20}"#;

/// Scenes whose light is found in every way with a bearable noise.
fn scenes() -> Vec<(&'static str, String)> {
    let brown = Disney { base_color: [0.7, 0.4, 0.2], ..Disney::PLAIN };
    let metal = material(&Disney { metallic: 1.0, roughness: 0.4, ..brown });
    let glass = material(&Disney { specular_transmission: 1.0, roughness: 0.5, ..brown });
    let cloth = material(&Disney { specular_transmission: 1.0, sheen: 1.0, roughness: 0.5, ..brown });
    let coat = material(&Disney { clearcoat: 1.0, clearcoat_gloss: 0.2, roughness: 0.8, ..brown });
    let all = format!("{SKY}, {SUN}");
    vec![
        ("diffuse, sphere", still(r#"{"type": "diffuse"}"#, LAMP, "")),
        ("metal, sphere and sky", still(&metal, LAMP, SKY)),
        ("clearcoat, sun", still(&coat, "", SUN)),
        ("rough glass, sky and sun", still(&glass, "", &all)),
        ("sheen on glass, sphere", still(&cloth, LAMP, SKY)),
        ("everything, all lights", still(&material(&everything()), LAMP, &all)),
        ("rough plastic, sky", still(r#"{"type": "plastic", "alpha": 0.3}"#, "", SKY)),
        ("rough conductor, sun", still(r#"{"type": "conductor", "alpha": 0.3}"#, "", SUN)),
        ("rough dielectric, sphere", still(r#"{"type": "dielectric", "alpha": 0.4}"#, LAMP, "")),
    ]
}

fn shot() -> Shot {
    Shot {
        side: 24,
        spp: 512,
        max_depth: 8,
        roulette_depth: 64,
        vfov: 34.0,
        ..Shot::from(DVec3::new(2.0, 1.5, 4.0))
    }
}

/// Largest distance of two pictures' tiles of 8 × 8 pixels in standard errors, each error from all pixels of both tiles.
fn farthest_tile(a: &Shown, b: &Shown) -> f64 {
    let side = a.picture.size.width as usize;
    let mut farthest: f64 = 0.0;
    for tile in 0..(side / 8) * (side / 8) {
        let (x, y) = (tile % (side / 8) * 8, tile / (side / 8) * 8);
        let pixels = (0..64).map(|i| (y + i / 8) * side + x + i % 8);
        let (mut difference, mut variance) = (0.0, 0.0);
        for pixel in pixels {
            let mean = |s: &Shown| f64::from(s.picture.color[pixel].element_sum()) / 3.0;
            difference += mean(a) - mean(b);
            variance += f64::from(a.picture.error[pixel]).powi(2) + f64::from(b.picture.error[pixel]).powi(2);
        }
        farthest = farthest.max(difference.abs() / variance.sqrt().max(1e-9));
    }
    farthest
}

/// Light of meshes (two triangles that make a rectangle, one that does not), of an image of the sky, through holes, and
/// on normals that lean.
fn scenes_with_files() -> Vec<(&'static str, String)> {
    let stage = |material: &str, ball: &str, lamp: &str, lights: &str| {
        format!(
            r#""materials": {{"m": {material}, "gray": {{"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]}},
                "leaf": {{"type": "diffuse", "opacity": {{"type": "checkerboard", "color0": [1, 1, 1], "color1": [0.2, 0.2, 0.2]}}}}}},
            "meshes": {{"square": {{"file": "square.obj"}}, "triangle": {{"file": "triangle.obj"}}}},
            "instances": {{{ball} "lamp": {{"mesh": "{lamp}", "material": "gray", "emission": [9, 8, 6],
                "transform": {{"scale": 1.5, "rotate": [-90, 0, 20], "translate": [-1, 2.5, 1.5]}}}}}},
            "spheres": {{"ball": {{"center": [0, 0, 0], "radius": 1, "material": "m"}},
                "floor": {{"center": [0, -51, 0], "radius": 50, "material": "gray"}}}},
            "lights": {{{lights}}}"#
        )
    };
    let plastic = r#"{"type": "plastic", "alpha": 0.3}"#;
    let map = r#""sky": {"type": "environment", "image": "sky.exr"}"#;
    let leaf = r#""leaf": {"mesh": "square", "material": "leaf",
        "transform": {"scale": 3, "rotate": [-90, 0, 0], "translate": [-2, 1.8, 2]}},"#;
    let bumps = r#"{"type": "plastic", "alpha": 0.3, "bump_scale": 0.4,
        "bump": {"type": "fbm", "frequency": 8, "octaves": 2}}"#;
    vec![
        ("plastic, rectangle", stage(plastic, "", "square", "")),
        ("plastic, triangle and constant sky", stage(plastic, "", "triangle", SKY)),
        ("plastic, image of the sky", stage(plastic, "", "triangle", map)),
        ("holes between lamp and floor", stage(plastic, leaf, "square", map)),
        ("bumps, rectangle and image", stage(bumps, "", "square", map)),
    ]
}

/// The files that they name.
fn write_files(folder: &Path) {
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).unwrap_or_else(|e| panic!("{name}: {e}"));
    };
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    write("square.obj", &format!("{square}f 1/1 4/4 3/3 2/2\n"));
    write("triangle.obj", "v 0 0 0\nv 0.3 1 0\nv 1 0.1 0\nf 1 2 3\n");
    let texel = |x: usize, y: usize| {
        let bright = if (x, y) == (5, 1) { 30.0_f32 } else { 0.3 };
        (bright, bright * 0.8, 0.2 + 0.1 * x as f32)
    };
    exr::prelude::write_rgb_file(folder.join("sky.exr"), 8, 4, texel)
        .unwrap_or_else(|e| panic!("sky.exr: {e}"));
}

#[test]
fn light_by_scattering_by_sampling_and_by_both_is_the_same() {
    compare_strategies(Path::new("."), &scenes(), &[Strategy::Scattering, Strategy::Lights]);
}

#[test]
fn light_of_meshes_and_images_by_scattering_by_sampling_and_by_both_is_the_same() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    write_files(folder.path());
    // The dim parts of an image are never sampled as light: they are left to scattering (MIS compensation).
    let (images, others): (Vec<_>, Vec<_>) =
        scenes_with_files().into_iter().partition(|(_, body)| body.contains("sky.exr"));
    compare_strategies(folder.path(), &images, &[Strategy::Scattering]);
    compare_strategies(folder.path(), &others, &[Strategy::Scattering, Strategy::Lights]);
}

/// Renders every scene by both ways and by each of some alone, and holds the means, and those of nine tiles, against each
/// other.
fn compare_strategies(folder: &Path, scenes: &[(&str, String)], ways: &[Strategy]) {
    // The mean and nine tiles of each.
    let limit = limit_of(sidak(FAMILY, scenes.len() * ways.len() * 10));
    let (mut rows, mut wrong) = (Vec::new(), Vec::new());
    for (at, (name, body)) in scenes.iter().enumerate() {
        let by = |strategy, seed| {
            let shot = Shot { seed, ..shot() };
            Shown::of(&shot.scene_in(folder, body).with_strategy(strategy))
        };
        let both = by(Strategy::Both, 10 * at as u32);
        for (seed, strategy) in (1..).zip(ways.iter().copied()) {
            let alone = by(strategy, 10 * at as u32 + seed);
            let (apart, tile) = (alone.apart(&both), farthest_tile(&alone, &both));
            let part = alone.mean / both.mean - 1.0;
            rows.push(vec![
                format!("{name}: {strategy:?}"),
                format!("{:+.2} %", part * 100.0),
                format!("{:.2} %", libm::hypot(alone.error, both.error) / both.mean * 100.0),
                format!("{apart:+.1}"),
                format!("{tile:.1}"),
            ]);
            if apart.abs() > limit || tile > limit {
                wrong.push(format!(
                    "{name}, {strategy:?}: {:+.2} %, {apart:+.1} errors, a tile {tile:.1}",
                    part * 100.0
                ));
            }
        }
    }
    println!(
        "limit {limit:.1} standard errors\n{}",
        table(&["against both", "mean", "±", "in errors", "farthest tile"], &rows)
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn lights_chosen_by_the_tree_and_blindly_bring_the_same() {
    // More lights than are weighed one by one and than a receiver looks at together, of many sizes, out of sight over a
    // ball of two lobes, and two at infinity.
    let mut lamps = String::new();
    for lamp in 0..1200 {
        let turn = f64::from(lamp) * 2.4;
        let (x, y, z) = (2.5 * libm::cos(turn), 2.5 + f64::from(lamp) * 0.002, 2.5 * libm::sin(turn));
        let (radius, red) = (0.01 + 0.004 * f64::from(lamp % 7), 20 + lamp % 5 * 16);
        let _ = write!(
            lamps,
            r#", "lamp{lamp}": {{"center": [{x}, {y}, {z}], "radius": {radius}, "material": "gray", "emission": [{red}, 40, 18]}}"#
        );
    }
    let body = still(r#"{"type": "plastic", "alpha": 0.3}"#, &lamps, &format!("{SKY}, {SUN}"));
    let limit = limit_of(sidak(FAMILY, 10));
    let by = |strategy, spp, seed| {
        let shot = Shot { seed, spp, max_depth: 2, ..shot() };
        Shown::of(&shot.scene_in(Path::new("."), &body).with_strategy(strategy))
    };
    let (tree, blind) = (by(Strategy::Both, 512, 1), by(Strategy::BlindChoice, 4096, 2));
    let (apart, tile) = (tree.apart(&blind), farthest_tile(&tree, &blind));
    let part = |error: f64| error / blind.mean * 100.0;
    println!(
        "tree ± {:.2} % against blind ± {:.2} %: {apart:+.1} errors, farthest tile {tile:.1}, limit {limit:.1}",
        part(tree.error),
        part(blind.error)
    );
    assert!(apart.abs() < limit && tile < limit);
    // Variance at the same number of samples.
    let gain = (blind.error / tree.error).powi(2) * 4096.0 / 512.0;
    assert!(gain > 4.0, "the tree's variance is {gain} times less");
}

#[test]
fn roulette_changes_noise_only() {
    let scenes: Vec<_> = scenes().into_iter().skip(3).take(3).collect();
    let limit = limit_of(sidak(FAMILY, scenes.len() * 10));
    for (at, (name, body)) in scenes.iter().enumerate() {
        let with = |roulette_depth, seed| Shot { seed, roulette_depth, max_depth: 16, ..shot() }.take(body);
        let (on, off) = (with(1, 3 * at as u32), with(64, 3 * at as u32 + 1));
        let (apart, tile) = (on.apart(&off), farthest_tile(&on, &off));
        println!(
            "{name}: {:+.3} %, {apart:+.1} errors, farthest tile {tile:.1}, limit {limit:.1}",
            (on.mean / off.mean - 1.0) * 100.0
        );
        assert!(apart.abs() < limit && tile < limit, "{name}");
        let (rays_on, rays_off) = (on.film.summary().counters.rays, off.film.summary().counters.rays);
        assert!(rays_on < rays_off, "{name}: roulette ended no path: {rays_on} rays against {rays_off}");
    }
}
