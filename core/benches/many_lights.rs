//! Owns the measurement of a scene with 10,000 emissive triangles: its error at equal time, lights chosen by the tree
//! and lights chosen blindly. Run by `cargo bench -p karst-core --bench many_lights`.
#![allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a measurement reads the clock and prints its figures"
)]

#[path = "../tests/support/mod.rs"]
mod support;

use karst_core::film::Picture;
use karst_core::scene::{Scene, Strategy};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;
use support::{render, scene_in};

const TRIANGLES: u32 = 10_000;

/// Samples per pixel by the tree; by blind choice as many as take the same time.
const SPP: u32 = 32;

/// Samples per pixel of the reference, by the tree.
const REFERENCE_SPP: u32 = 8192;

/// Numbers from 0 to 1 in the order of a fixed generator.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn centered(&mut self) -> f64 {
        self.next() - 0.5
    }
}

/// Writes a quarter of the lamps as a mesh: small triangles, turned anyhow, over 16 by 16 units of the ground.
fn write_lamps(path: &Path, numbers: &mut Numbers) {
    let mut text = String::new();
    for lamp in 0..TRIANGLES / 4 {
        let (x, y, z) = (16.0 * numbers.centered(), 0.3 + 2.7 * numbers.next(), 16.0 * numbers.centered());
        for _ in 0..3 {
            let mut off = || 0.04 * numbers.centered();
            let _ = writeln!(text, "v {} {} {}", x + off(), y + off(), z + off());
        }
        let _ = writeln!(text, "f {} {} {}", 3 * lamp + 1, 3 * lamp + 2, 3 * lamp + 3);
    }
    std::fs::write(path, text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}

/// Balls of two materials on a ground, among lamps of four colours.
fn document(spp: u32, seed: u32) -> String {
    let (mut balls, mut meshes, mut lamps) = (String::new(), String::new(), String::new());
    let mut numbers = Numbers(5);
    for ball in 0..60 {
        let radius = 0.2 + 0.5 * numbers.next();
        let (x, z) = (14.0 * numbers.centered(), 14.0 * numbers.centered());
        let material = ["gray", "red"][ball % 2];
        let _ = write!(
            balls,
            r#""ball{ball}": {{"center": [{x}, {radius}, {z}], "radius": {radius}, "material": "{material}"}},"#
        );
    }
    for (lamp, color) in ["[90, 60, 30]", "[30, 60, 90]", "[60, 60, 60]", "[80, 20, 60]"].iter().enumerate() {
        let comma = if lamp == 0 { "" } else { ", " };
        let _ = write!(meshes, r#"{comma}"lamps{lamp}": {{"file": "lamps{lamp}.obj"}}"#);
        let _ = write!(
            lamps,
            r#"{comma}"lamps{lamp}": {{"mesh": "lamps{lamp}", "material": "gray", "emission": {color}}}"#
        );
    }
    format!(
        r#"{{"version": 1,
        "camera": {{"type": "perspective", "vfov": 40,
            "transform": {{"look_at": {{"eye": [0, 5, 13], "target": [0, 0.5, 0]}}}}}},
        "film": {{"width": 96, "height": 64, "filter": {{"type": "box"}}}},
        "sampling": {{"spp": {spp}, "seed": {seed}}},
        "integrator": {{"max_depth": 3}},
        "materials": {{
            "gray": {{"type": "diffuse", "reflectance": [0.6, 0.6, 0.6]}},
            "red": {{"type": "plastic", "alpha": 0.2, "diffuse_reflectance": [0.5, 0.1, 0.1]}}}},
        "meshes": {{{meshes}}},
        "instances": {{{lamps}}},
        "spheres": {{{balls} "ground": {{"center": [0, -5000, 0], "radius": 5000, "material": "gray"}}}}}}"#
    )
}

/// Renders with one thread: the picture and the seconds it took, the building of the scene left out.
fn shot(folder: &Path, spp: u32, seed: u32, strategy: Strategy) -> (Picture, f64) {
    let scene: Scene = scene_in(folder, &document(spp, seed), 1).with_strategy(strategy);
    let begin = Instant::now();
    let film = render(&scene, 32, 1);
    (film.picture(), begin.elapsed().as_secs_f64())
}

/// relMSE of a picture to a reference.
fn error(picture: &Picture, reference: &Picture) -> f64 {
    let values =
        picture.color.iter().zip(&reference.color).flat_map(|(a, b)| [(a.x, b.x), (a.y, b.y), (a.z, b.z)]);
    let squares = values.map(|(a, b)| (f64::from(a - b)).powi(2) / (f64::from(b).powi(2) + 0.01));
    squares.sum::<f64>() / (3 * picture.color.len()) as f64
}

fn main() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("a temporary folder: {e}"));
    let mut numbers = Numbers(1);
    for lamps in 0..4 {
        write_lamps(&folder.path().join(format!("lamps{lamps}.obj")), &mut numbers);
    }
    let folder = folder.path();
    let begin = Instant::now();
    let (reference, seconds) = shot(folder, REFERENCE_SPP, 100, Strategy::Both);
    println!(
        "{TRIANGLES} triangles; built in {:.2} s; reference of {REFERENCE_SPP} spp in {seconds:.0} s",
        begin.elapsed().as_secs_f64() - seconds
    );
    // What was measured can be looked at.
    if let Some(path) = std::env::args().skip_while(|arg| arg != "--picture").nth(1) {
        let scene = scene_in(folder, &document(1, 1), 1);
        let png = karst_core::encode::png(
            &reference.color,
            reference.size.width,
            reference.size.height,
            scene.exposure(),
            scene.view(),
        );
        std::fs::write(&path, png.unwrap_or_else(|e| panic!("{e}")))
            .unwrap_or_else(|e| panic!("{path}: {e}"));
    }
    let (mut gains, mut blind_errors, mut tree_errors) = (Vec::new(), 0.0, 0.0);
    for seed in 0..5 {
        let (tree, tree_seconds) = shot(folder, SPP, seed, Strategy::Both);
        let (_, pilot) = shot(folder, SPP, seed, Strategy::BlindChoice);
        let spp = (f64::from(SPP) * tree_seconds / pilot).round().max(2.0) as u32;
        let (blind, blind_seconds) = shot(folder, spp, seed, Strategy::BlindChoice);
        let (tree_error, blind_error) = (error(&tree, &reference), error(&blind, &reference));
        tree_errors += tree_error / 5.0;
        blind_errors += blind_error / 5.0;
        gains.push(blind_error * blind_seconds / (tree_error * tree_seconds));
        println!(
            "seed {seed}: tree {SPP} spp {tree_seconds:.2} s relMSE {tree_error:.3e}; blind {spp} spp \
            {blind_seconds:.2} s relMSE {blind_error:.3e}; relMSE x time {:.1} times less",
            gains[seed as usize]
        );
    }
    gains.sort_by(f64::total_cmp);
    println!(
        "mean relMSE: blind {blind_errors:.3e}, tree {tree_errors:.3e}; relMSE x time, median: {:.1} times less, error \
        at equal time {:.1} times less",
        gains[2],
        gains[2].sqrt()
    );
}
