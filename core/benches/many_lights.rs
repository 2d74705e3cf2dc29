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

/// Of a lantern, which is some two pixels wide in the middle of the picture: what is measured is how lights are chosen,
/// not how pixels find lamps far smaller than they are.
const RADIUS: f64 = 0.12;

/// Samples per pixel by the tree; by blind choice as many as take the same time.
const SPP: u32 = 32;

/// Samples per pixel of the reference, by the tree.
const REFERENCE_SPP: u32 = 2048;

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

/// The corners of an icosahedron of radius 1 are (0, ±1, ±φ) and its turns, times this, with the golden ratio φ.
const ICOSAHEDRON: f64 = 0.525_731_112_119_133_6;

/// The triangles of an icosahedron, seen from outside counterclockwise.
const FACES: [[usize; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// Writes a quarter of the lanterns as a mesh: icosahedra over 24 by 24 units of the ground.
fn write_lanterns(path: &Path, numbers: &mut Numbers) {
    let (one, phi) = (ICOSAHEDRON, ICOSAHEDRON * 1.618_033_988_749_895);
    let corners = [
        [-one, phi, 0.0],
        [one, phi, 0.0],
        [-one, -phi, 0.0],
        [one, -phi, 0.0],
        [0.0, -one, phi],
        [0.0, one, phi],
        [0.0, -one, -phi],
        [0.0, one, -phi],
        [phi, 0.0, -one],
        [phi, 0.0, one],
        [-phi, 0.0, -one],
        [-phi, 0.0, one],
    ];
    let mut text = String::new();
    for lantern in 0..TRIANGLES as usize / 4 / FACES.len() {
        let center = [24.0 * numbers.centered(), 0.4 + 2.6 * numbers.next(), 24.0 * numbers.centered()];
        for corner in corners {
            let [x, y, z] = [0, 1, 2].map(|axis| center[axis] + RADIUS * corner[axis]);
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for face in FACES {
            let [a, b, c] = face.map(|corner| corners.len() * lantern + corner + 1);
            let _ = writeln!(text, "f {a} {b} {c}");
        }
    }
    std::fs::write(path, text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}

/// Balls of two materials on a ground, among lamps of four colours.
fn document(spp: u32, seed: u32, depth: u32) -> String {
    let (mut balls, mut meshes, mut lamps) = (String::new(), String::new(), String::new());
    let mut numbers = Numbers(5);
    for ball in 0..90 {
        let radius = 0.2 + 0.5 * numbers.next();
        let (x, z) = (20.0 * numbers.centered(), 20.0 * numbers.centered());
        let material = ["gray", "red"][ball % 2];
        let _ = write!(
            balls,
            r#""ball{ball}": {{"center": [{x}, {radius}, {z}], "radius": {radius}, "material": "{material}"}},"#
        );
    }
    for (lamp, color) in ["[9, 6, 3]", "[3, 6, 9]", "[6, 6, 6]", "[8, 2, 6]"].iter().enumerate() {
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
        "integrator": {{"max_depth": {depth}}},
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
    let scene: Scene = scene_in(folder, &document(spp, seed, 3), 1).with_strategy(strategy);
    let begin = Instant::now();
    let film = render(&scene, 32, 1);
    (film.picture(), begin.elapsed().as_secs_f64())
}

/// relMSE of a picture to a reference, over the pixels that count.
fn error(picture: &Picture, reference: &Picture, counts: &[bool]) -> f64 {
    let pixels = picture.color.iter().zip(&reference.color).zip(counts).filter(|(_, counts)| **counts);
    let squares = pixels.map(|((a, b), _)| {
        [(a.x, b.x), (a.y, b.y), (a.z, b.z)]
            .map(|(a, b)| f64::from(a - b).powi(2) / (f64::from(b).powi(2) + 0.01))
            .iter()
            .sum::<f64>()
    });
    squares.sum::<f64>() / (3 * counts.iter().filter(|counts| **counts).count()) as f64
}

/// The pixels in which no lantern is seen: those with one have the noise of its edges, however lights are chosen.
fn lit(folder: &Path) -> Vec<bool> {
    let emission = render(&scene_in(folder, &document(256, 7, 1), 1), 32, 1).picture();
    emission.color.iter().map(|color| color.max_element() == 0.0).collect()
}

/// What one comparison at equal time found.
struct Found {
    /// relMSE times seconds, lights chosen blindly, over the same with the tree: of the pixels without lanterns.
    lit: f64,
    /// The same of all pixels.
    all: f64,
}

/// Renders by the tree and, in the same time, by blind choice.
fn compare(folder: &Path, seed: u32, reference: &Picture, lit: &[bool]) -> Found {
    let (tree, tree_seconds) = shot(folder, SPP, seed, Strategy::Both);
    let (_, pilot) = shot(folder, SPP, seed, Strategy::BlindChoice);
    let spp = (f64::from(SPP) * tree_seconds / pilot).round().max(2.0) as u32;
    let (blind, blind_seconds) = shot(folder, spp, seed, Strategy::BlindChoice);
    let all = vec![true; lit.len()];
    let [lit, all] = [lit, &all].map(|counts| {
        let (tree, blind) = (error(&tree, reference, counts), error(&blind, reference, counts));
        (tree, blind, blind * blind_seconds / (tree * tree_seconds))
    });
    println!(
        "seed {seed}: tree {SPP} spp {tree_seconds:.2} s, blind {spp} spp {blind_seconds:.2} s; relMSE of lit surfaces \
         {:.2e}, {:.2e}: x time {:.1} times less; of all pixels {:.2e}, {:.2e}: {:.1} times less",
        lit.0, lit.1, lit.2, all.0, all.1, all.2
    );
    Found { lit: lit.2, all: all.2 }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("a temporary folder: {e}"));
    let mut numbers = Numbers(1);
    for lamps in 0..4 {
        write_lanterns(&folder.path().join(format!("lamps{lamps}.obj")), &mut numbers);
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
        let scene = scene_in(folder, &document(1, 1, 3), 1);
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
    let lit = lit(folder);
    let found: Vec<Found> = (0..5).map(|seed| compare(folder, seed, &reference, &lit)).collect();
    println!(
        "relMSE x time, median: lit surfaces ({:.0} % of the pixels) {:.1} times less, all pixels {:.1} times less",
        100.0 * lit.iter().filter(|lit| **lit).count() as f64 / lit.len() as f64,
        median(found.iter().map(|found| found.lit).collect()),
        median(found.iter().map(|found| found.all).collect())
    );
}
