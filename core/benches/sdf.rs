//! Owns the measurements of distance functions: eight lanes against one, large trees in cells against whole, formulas
//! against the march. Run by `cargo bench -p karst-core --bench sdf`.
#![allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    clippy::expect_used,
    reason = "a measurement reads the clock and prints its figures"
)]

use glam::{Mat3, Vec3, Vec4};
use karst_core::math::Aabb;
use karst_core::sdf::{MarchStats, NodeId, NoiseParameters, Point, Sdf, SdfRay, Settings, TapeBuilder};
use std::hint::black_box;
use std::time::Instant;
use wide::f32x8;

const NOISE: NoiseParameters =
    NoiseParameters { amplitude: 0.15, frequency: 2.0, octaves: 5, gain: 0.5, lacunarity: 2.1, seed: 3 };

/// Pairs of runs, of which the fastest of each kind count.
const RUNS: u32 = 7;

fn object(build: impl FnOnce(&mut TapeBuilder) -> NodeId) -> Sdf {
    let mut builder = TapeBuilder::new();
    let root = build(&mut builder);
    let tape = builder.finish(root).expect("valid");
    let bounds = (!tape.bounds().is_finite()).then_some(Aabb { min: Vec3::splat(-1.0), max: Vec3::ONE });
    Sdf::new(tape, Settings::default(), bounds).expect("valid")
}

/// Numbers from 0 to 1 in the order of a fixed generator.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    /// A place in the unit ball.
    fn place(&mut self) -> Vec3 {
        loop {
            let p = Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if p.length() < 1.0 {
                return p;
            }
        }
    }
}

/// Solids of three kinds strewn over a ball, melted together or not.
fn heap(count: u32, k: f32) -> Sdf {
    object(|t| {
        let mut numbers = Numbers(35);
        let size = 2.0 / libm::cbrtf(count as f32);
        let parts: Vec<_> = (0..count)
            .map(|i| {
                let part = match i % 3 {
                    0 => t.sphere(0.3 * size),
                    1 => t.rounded_box(Vec3::splat(0.5 * size), 0.05 * size),
                    _ => t.torus(0.3 * size, 0.1 * size),
                };
                t.transform(part, numbers.place() * 2.0, Mat3::IDENTITY, 1.0)
            })
            .collect();
        t.smooth_union(&parts, k)
    })
}

/// One object of every kind of node.
fn nodes() -> Vec<(&'static str, Sdf)> {
    let pair = |t: &mut TapeBuilder| {
        let (a, b) = (t.sphere(1.0), t.rounded_box(Vec3::splat(1.2), 0.1));
        [a, t.transform(b, Vec3::splat(0.5), Mat3::IDENTITY, 1.0)]
    };
    vec![
        ("sphere", object(|t| t.sphere(1.0)).marching()),
        ("box", object(|t| t.cuboid(Vec3::ONE)).marching()),
        ("rounded_box", object(|t| t.rounded_box(Vec3::new(2.0, 1.0, 0.5), 0.1))),
        ("plane", object(TapeBuilder::plane).marching()),
        ("torus", object(|t| t.torus(1.0, 0.25))),
        ("cylinder", object(|t| t.cylinder(0.7, 1.5)).marching()),
        ("capsule", object(|t| t.capsule(0.3, 1.5)).marching()),
        ("cone", object(|t| t.cone(0.3, 0.8, 1.0)).marching()),
        ("ellipsoid", object(|t| t.ellipsoid(Vec3::new(1.0, 0.5, 0.2))).marching()),
        ("mandelbulb", object(|t| t.mandelbulb(8.0, 10, 4.0))),
        ("mandelbulb, 7.3", object(|t| t.mandelbulb(7.3, 6, 4.0))),
        ("julia", object(|t| t.julia(Vec4::new(-0.2, 0.6, 0.2, 0.2), 10))),
        (
            "fbm_noise",
            object(|t| {
                let ball = t.sphere(1.0);
                t.fbm_noise(ball, NOISE)
            }),
        ),
        (
            "union",
            object(|t| {
                let parts = pair(t);
                t.union(&parts)
            }),
        ),
        (
            "smooth_difference",
            object(|t| {
                let parts = pair(t);
                t.smooth_difference(&parts, 0.1)
            }),
        ),
        (
            "repetition",
            object(|t| {
                let ball = t.sphere(0.2);
                t.repetition(ball, Vec3::new(0.6, 0.8, 1.0), Some(1))
            }),
        ),
        (
            "twist",
            object(|t| {
                let bar = t.cuboid(Vec3::new(0.8, 2.0, 0.4));
                t.twist(bar, 60.0)
            }),
        ),
        (
            "bend",
            object(|t| {
                let bar = t.rounded_box(Vec3::new(2.0, 0.4, 0.4), 0.05);
                t.bend(bar, 40.0)
            }),
        ),
        ("50 solids", heap(50, 0.1).without_cells()),
    ]
}

/// A picture of the object, row by row.
fn picture(sdf: &Sdf, width: u32, height: u32) -> Vec<SdfRay> {
    let (middle, radius) = (sdf.bounds().center(), 0.5 * sdf.bounds().size().length());
    let eye = middle + Vec3::new(0.3, 0.5, 0.8).normalize() * radius * 3.0;
    let (side, up) = (eye - middle).normalize().any_orthonormal_pair();
    (0..width * height)
        .map(|i| {
            let [x, y] = [(i % width) as f32 / width as f32, (i / width) as f32 / height as f32];
            let target = middle + (side * (2.0 * x - 1.0) + up * (2.0 * y - 1.0)) * 0.7 * radius;
            let dir = (target - eye).normalize();
            SdfRay { origin: eye, dir, t_min: 0.0, t_max: f32::INFINITY, footprint: 1e-3 }
        })
        .collect()
}

/// A way to march rays.
type Run<'a> = &'a dyn Fn(&[SdfRay], &mut MarchStats);

/// Seconds of the fastest run of each of two kinds, run in turns, and what the last run of the second counted.
fn race(rays: &[SdfRay], runs: [Run<'_>; 2]) -> ([f64; 2], MarchStats) {
    let (mut best, mut stats) = ([f64::INFINITY; 2], MarchStats::default());
    for _ in 0..RUNS {
        for (best, run) in best.iter_mut().zip(runs) {
            stats = MarchStats::default();
            let start = Instant::now();
            run(rays, &mut stats);
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    (best, stats)
}

fn together(sdf: &Sdf, rays: &[SdfRay], stats: &mut MarchStats) {
    let mut hits = 0;
    sdf.intersect_all(rays.iter().copied().enumerate(), stats, |_, hit, _| hits += u32::from(hit.is_some()));
    black_box(hits);
}

fn alone(sdf: &Sdf, rays: &[SdfRay], stats: &mut MarchStats) {
    for ray in rays {
        black_box(sdf.intersect(ray, stats));
    }
}

/// Million evaluations per second at random places around an object, eight lanes at a time.
fn rate(sdf: &Sdf) -> f64 {
    let mut numbers = Numbers(7);
    let (middle, reach) = (sdf.bounds().center(), 0.5 * sdf.bounds().size().length());
    let points: Vec<Point<f32x8>> = (0..2048)
        .map(|_| {
            let places: [Vec3; 8] = std::array::from_fn(|_| middle + numbers.place() * reach);
            let [x, y, z] = std::array::from_fn(|axis| f32x8::new(places.map(|p| p[axis])));
            Point::new(x, y, z)
        })
        .collect();
    let seconds = (0..RUNS).map(|_| {
        let start = Instant::now();
        for p in &points {
            black_box(sdf.tape().distance(*p));
        }
        start.elapsed().as_secs_f64()
    });
    8.0 * points.len() as f64 / seconds.fold(f64::INFINITY, f64::min) * 1e-6
}

fn main() {
    println!(
        "node: million evaluations per second and core; marching a picture, one lane and eight, and the ratio"
    );
    for (name, sdf) in nodes() {
        let rays = picture(&sdf, 256, 64);
        let runs: [Run<'_>; 2] =
            [&|rays, stats| alone(&sdf, rays, stats), &|rays, stats| together(&sdf, rays, stats)];
        let ([one, eight], stats) = race(&rays, runs);
        let millions = stats.evaluations as f64 * 1e-6;
        println!(
            "{name:>18}: {:7.1}; {:.1} evaluations per ray, {:6.2} and {:6.2} million per second, {:.2} times",
            rate(&sdf),
            stats.evaluations as f64 / rays.len() as f64,
            millions / one,
            millions / eight,
            one / eight
        );
    }
    println!(
        "solids: cells and steps in them, made in; marching a picture whole and in cells, and the ratio"
    );
    for (count, k) in [(32, 0.0), (50, 0.05), (100, 0.05), (500, 0.0), (500, 0.02), (5000, 0.0)] {
        let start = Instant::now();
        let sdf = heap(count, k);
        let made = start.elapsed().as_secs_f64();
        let whole = sdf.clone().without_cells();
        let rays = picture(&sdf, 128, 64);
        let runs: [Run<'_>; 2] =
            [&|rays, stats| together(&whole, rays, stats), &|rays, stats| together(&sdf, rays, stats)];
        let ([slow, fast], stats) = race(&rays, runs);
        let (cells, steps) = sdf.cells().unwrap_or_default();
        let millions = stats.evaluations as f64 * 1e-6;
        println!(
            "{count:>18}, k {k}: {cells} cells of {steps:.1} steps, {:.0} ms; {:6.2} and {:6.2} million per second, \
             {:.1} times",
            made * 1e3,
            millions / slow,
            millions / fast,
            slow / fast
        );
    }
    println!("by formula: nanoseconds per ray marched eight at a time and by formula, and the ratio");
    for (name, sdf) in [
        ("sphere", object(|t| t.sphere(1.0))),
        ("box", object(|t| t.cuboid(Vec3::ONE))),
        ("16 balls", {
            object(|t| {
                let mut numbers = Numbers(35);
                let balls: Vec<_> = (0..16)
                    .map(|_| {
                        let ball = t.sphere(0.4);
                        t.transform(ball, numbers.place(), Mat3::IDENTITY, 1.0)
                    })
                    .collect();
                t.union(&balls)
            })
        }),
    ] {
        let marched = sdf.clone().marching();
        let rays = picture(&sdf, 256, 64);
        let runs: [Run<'_>; 2] =
            [&|rays, stats| together(&marched, rays, stats), &|rays, stats| together(&sdf, rays, stats)];
        let (seconds, _) = race(&rays, runs);
        let [march, formula] = seconds.map(|seconds| seconds * 1e9 / rays.len() as f64);
        println!("{name:>18}: {march:5.0} and {formula:5.0}, {:.2} times", march / formula);
    }
}
