//! Time per ray with and without the closed form: figures to look at, not a check.

use std::hint::black_box;
use std::time::Instant;

use glam::Vec3;

use super::closed_seams::{Build, CONVEX, around, turned};
use super::{hit, object};
use crate::sdf::Sdf;

#[test]
#[ignore = "prints figures; run alone with --nocapture"]
#[expect(clippy::disallowed_methods, reason = "it measures; no pixel depends on it")]
fn time_of_closed_forms_and_of_the_march() {
    let cases: [(&str, Build); 4] = [
        ("sphere", |t| t.sphere(1.0)),
        ("box", |t| t.cuboid(Vec3::new(1.6, 1.2, 1.4))),
        ("8 solids", |t| {
            let mut node = t.cuboid(Vec3::splat(1.4));
            for i in 0..7_u8 {
                let solid = CONVEX[usize::from(i)](t);
                let solid = turned(t, solid, Vec3::new(0.3, 0.2, -0.5) * f32::from(i % 3), 0.5);
                node = if i % 2 == 0 { t.difference(&[node, solid]) } else { t.union(&[node, solid]) };
            }
            node
        }),
        ("16 solids", |t| {
            let mut node = t.cuboid(Vec3::splat(1.4));
            for i in 0..15_u8 {
                let solid = CONVEX[usize::from(i % 7)](t);
                let to = Vec3::new(0.3, 0.2 - 0.1 * f32::from(i / 4), -0.5) * f32::from(i % 3);
                let solid = turned(t, solid, to, 0.4);
                node = if i % 2 == 0 { t.difference(&[node, solid]) } else { t.union(&[node, solid]) };
            }
            node
        }),
    ];
    let rays: Vec<_> = around(20_000).collect();
    for (name, build) in cases {
        let formula = object(build);
        let march = formula.clone().marching();
        let time = |sdf: &Sdf| {
            let best = (0..7).map(|_| {
                let start = Instant::now();
                let hits = rays.iter().filter(|ray| black_box(hit(sdf, ray)).is_some()).count();
                (start.elapsed().as_secs_f64() * 1e9 / rays.len() as f64, hits)
            });
            best.min_by(|a, b| a.0.total_cmp(&b.0)).expect("seven runs")
        };
        for _ in 0..3 {
            let (formula, march) = (time(&formula), time(&march));
            println!(
                "{name}: formula {:.0} ns, march {:.0} ns per ray; hits {} and {}",
                formula.0, march.0, formula.1, march.1
            );
        }
    }
}
