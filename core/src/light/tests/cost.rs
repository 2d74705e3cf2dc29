//! What the tree over many lights costs and what it brings; run by hand, because it reads a clock (that of the
//! processor, from Linux):
//! `cargo test --release -p karst-core light::tests::cost -- --ignored --nocapture`.

use super::{facing_up, numbers, points, scattered, triangle};
use crate::light::{Light, Lights, Receiver};
use crate::math::Aabb;
use glam::{Vec2, Vec3};

/// Time that this thread has run.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split_whitespace().next().unwrap().parse::<f64>().unwrap() * 1e-9
}

/// Direct light of many receivers: the mean over them of variance over squared mean, and seconds per sample.
fn measure(
    lights: &[Light],
    receivers: &[Receiver],
    samples: u32,
    choose: impl Fn(&Receiver, f32) -> Option<(usize, f32)>,
) -> (f64, f64) {
    let mut spread = 0.0;
    let us: Vec<(f32, Vec2)> = numbers(0, samples).zip(points(1, samples)).collect();
    let start = cpu_seconds();
    for from in receivers {
        let (mut sum, mut square) = (0.0, 0.0);
        for &(u, point) in &us {
            let brought = choose(from, u)
                .and_then(|(i, p)| Some((lights[i].sample(from, point)?, p)))
                .map_or(0.0, |(s, p)| f64::from(s.radiance.x * s.wi.dot(from.n).max(0.0) / (s.pdf * p)));
            sum += brought;
            square += brought * brought;
        }
        let mean = sum / f64::from(samples);
        spread += (square / f64::from(samples) - mean * mean) / (mean * mean);
    }
    let taken = (cpu_seconds() - start) / (receivers.len() as f64 * f64::from(samples));
    (spread / receivers.len() as f64, taken)
}

#[test]
#[ignore = "a measurement"]
fn ten_thousand_triangles_by_the_tree_against_uniform_choice() {
    let count = 10_000_u32;
    let random: Vec<Vec3> = scattered(count * 3).collect();
    let lights: Vec<Light> = random
        .chunks(3)
        .map(|at| {
            let center = at[0] * Vec3::new(5.0, 5.0, 1.5) + Vec3::Z * 1.5;
            triangle([center, center + at[1] * 0.02, center + at[2] * 0.02])
        })
        .collect();
    let start = cpu_seconds();
    let all = Lights::new(lights.clone(), &Aabb { min: Vec3::splat(-5.0), max: Vec3::splat(5.0) });
    println!("built in {:.3} s", cpu_seconds() - start);
    let receivers: Vec<Receiver> =
        scattered(64).map(|p| facing_up(Vec3::new(p.x * 5.0, p.y * 5.0, -0.1))).collect();
    let uniform = |_: &Receiver, u: f32| Some(((u * count as f32) as usize, 1.0 / count as f32));
    let (uniform_spread, uniform_time) = measure(&lights, &receivers, 1 << 14, uniform);
    let (tree_spread, tree_time) = measure(&lights, &receivers, 1 << 14, |from, u| all.choose(from, u));
    let (_, pdf_time) = measure(&lights, &receivers, 1 << 12, |from, u| {
        let (i, p) = all.choose(from, u)?;
        Some((i, p + 0.0 * all.choice_pdf(from, i)))
    });
    println!("relative variance: uniform {uniform_spread:.2}, tree {tree_spread:.4}");
    println!("ns a sample: uniform {:.0}, tree {:.0}", uniform_time * 1e9, tree_time * 1e9);
    println!("ns of choice_pdf: {:.0}", (pdf_time - tree_time) * 1e9);
    // A shadow ray and the shading of its surface take about a microsecond.
    for other in [0.0, 1e-6] {
        let gain = uniform_spread * (uniform_time + other) / (tree_spread * (tree_time + other));
        println!("variance times time, with {other} s besides: {gain:.1} times better");
        assert!(gain > 5.0);
    }
}
