//! Owns the measurement of scenes with meshes and distance functions together: rays against both, beside the sum of rays
//! against each alone. Run by `cargo bench -p karst-core --bench mixture`.
#![allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a measurement reads the clock and prints its figures"
)]

#[path = "../tests/support/mod.rs"]
mod support;

use glam::Vec3;
use karst_core::math::Ray;
use karst_core::scene::{Marching, Scene};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use support::scene_in;

/// Objects along each of three axes.
const EDGE: u32 = 4;

/// Rays of a batch, about as many as a wave has.
const WAVE: usize = 4096;

/// Batches of one measurement.
const WAVES: usize = 8;

/// Interleaved runs of each of the three scenes.
const RUNS: usize = 15;

/// Numbers from 0 to 1 in the order of a fixed generator.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    /// A direction, all as likely.
    fn direction(&mut self) -> Vec3 {
        loop {
            let p = Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&p.length()) {
                return p.normalize();
            }
        }
    }
}

/// A torus of 20,000 triangles, as an OBJ file.
fn torus() -> String {
    let (around, across) = (200_u32, 50_u32);
    let mut text = String::new();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (TAU * f64::from(i) / f64::from(around), TAU * f64::from(j) / f64::from(across));
            let radius = 0.3 + 0.1 * v.cos();
            let _ = writeln!(text, "v {} {} {}", radius * u.cos(), 0.1 * v.sin(), radius * u.sin());
        }
    }
    for i in 0..around {
        for j in 0..across {
            let at = |i: u32, j: u32| (i % around) * across + j % across + 1;
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            let _ = writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}");
        }
    }
    text
}

/// What stands at a place of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Mesh,
    Function,
}

/// The objects of the grid that `wanted` takes, every `share`-th of eight a distance function.
fn grid(folder: &Path, share: u32, wanted: &[Kind]) -> Scene {
    let (mut instances, mut functions) = (Vec::new(), Vec::new());
    for number in 0..EDGE.pow(3) {
        let kind = if number * 5 % 8 < share { Kind::Function } else { Kind::Mesh };
        if !wanted.contains(&kind) {
            continue;
        }
        let [x, y, z] =
            [number % EDGE, number / EDGE % EDGE, number / EDGE.pow(2)].map(|at| f64::from(at) - 1.5);
        let turn = 360.0 * f64::from(number) / f64::from(EDGE.pow(3));
        let place =
            format!(r#""transform": {{"translate": [{x}, {y}, {z}], "rotate": [{turn}, 0, {}]}}"#, turn * PI);
        match kind {
            Kind::Mesh => {
                instances.push(format!(r#""m{number}": {{"mesh": "torus", "material": "grey", {place}}}"#));
            }
            Kind::Function => functions.push(format!(
                r#""f{number}": {{"material": "grey", {place},
                    "tree": {{"type": "torus", "major_radius": 0.3, "minor_radius": 0.1}}}}"#
            )),
        }
    }
    let text = format!(
        r#"{{"version": 1, "film": {{"width": 64, "height": 64}}, "camera": {{"type": "perspective", "vfov": 30, "transform": {{"translate": [0, 0, 9]}}}},
            "materials": {{"grey": {{"type": "diffuse"}}}}, "meshes": {{"torus": {{"file": "torus.obj"}}}},
            "instances": {{{}}}, "sdf_objects": {{{}}},
            "lights": {{"sky": {{"type": "environment", "radiance": [1, 1, 1]}}}}}}"#,
        instances.join(", "),
        functions.join(", ")
    );
    scene_in(folder, &text, 1)
}

/// Seconds that all rays take.
fn seconds(scene: &Scene, rays: &[Ray], marching: &mut Marching) -> f64 {
    let active: Vec<u32> = (0..WAVE as u32).collect();
    let start = Instant::now();
    for wave in rays.chunks_exact(WAVE) {
        let mut hits = vec![None; WAVE];
        scene.intersect_all(wave, &active, 0.0, &mut hits, marching);
        black_box(hits);
    }
    start.elapsed().as_secs_f64()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mixture");
    let written =
        std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(folder.join("torus.obj"), torus()));
    if let Err(error) = written {
        println!("{}: {error}", folder.display());
        return;
    }
    let mut numbers = Numbers(7);
    // Along paths: from places between the objects, in all directions.
    let rays: Vec<Ray> = (0..WAVE * WAVES)
        .map(|_| {
            let o = Vec3::new(numbers.next(), numbers.next(), numbers.next()) * 4.0 - 2.0;
            Ray::new(o, numbers.direction())
        })
        .collect();
    println!("{} objects, {} rays, {RUNS} interleaved runs, one thread", EDGE.pow(3), rays.len());
    println!(
        "| distance functions | meshes alone, ms | functions alone, ms | together, ms | together over sum |"
    );
    println!("|---|---|---|---|---|");
    for share in [1, 2, 4, 6, 7] {
        let scenes = [&[Kind::Mesh][..], &[Kind::Function], &[Kind::Mesh, Kind::Function]]
            .map(|wanted| grid(&folder, share, wanted));
        let mut marching = Marching::default();
        let (mut times, mut ratios) = ([const { Vec::new() }; 3], Vec::new());
        for _ in 0..RUNS {
            let run = scenes.each_ref().map(|scene| seconds(scene, &rays, &mut marching));
            for (all, time) in times.iter_mut().zip(run) {
                all.push(time);
            }
            ratios.push(run[2] / (run[0] + run[1]));
        }
        let [meshes, functions, both] = times.map(|all| median(all) * 1e3);
        println!("| {share} of 8 | {meshes:.2} | {functions:.2} | {both:.2} | {:.3} |", median(ratios));
    }
}
