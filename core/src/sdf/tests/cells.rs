//! Trees of many solids, with their cells and without.

use glam::Vec3;

use super::{Random, moved, object, ray};
use crate::sdf::{MarchStats, Sdf, SdfRay};

/// Solids of three kinds strewn over a ball, melted together or not.
fn heap(count: u32, k: f32) -> Sdf {
    object(|t| {
        let mut random = Random(35);
        let parts: Vec<_> = (0..count)
            .map(|i| {
                let size = 2.0 / libm::cbrtf(count as f32);
                let part = match i % 3 {
                    0 => t.sphere(0.3 * size),
                    1 => t.rounded_box(Vec3::splat(0.5 * size), 0.05 * size),
                    _ => t.torus(0.3 * size, 0.1 * size),
                };
                moved(t, part, random.direction() * 2.0 * libm::cbrtf(random.next()))
            })
            .collect();
        t.smooth_union(&parts, k)
    })
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
            SdfRay { footprint: 1e-3, ..ray(eye, target - eye) }
        })
        .collect()
}

#[test]
fn small_trees_are_evaluated_whole_and_large_ones_in_pieces() {
    assert_eq!(heap(31, 0.0).cells(), None);
    let (cells, steps) = heap(500, 0.0).cells().expect("500 solids are many");
    println!("{cells} cells with {steps:.1} steps on average");
    assert!(steps < 30.0, "{steps} of 2000");
}

#[test]
fn pieces_are_hit_where_the_whole_is() {
    for sdf in [heap(40, 0.0), heap(40, 0.1), heap(500, 0.02)] {
        let whole = sdf.clone().without_cells();
        let (mut hits, mut of_pieces, mut of_whole) = (0, MarchStats::default(), MarchStats::default());
        for ray in picture(&sdf, 40, 40) {
            let found = sdf.intersect(&ray, &mut of_pieces);
            assert_eq!(
                found.map(f32::to_bits),
                whole.intersect(&ray, &mut of_whole).map(f32::to_bits),
                "{ray:?}"
            );
            if let Some(t) = found {
                let p = ray.origin + ray.dir * t;
                assert_eq!((sdf.normal(p), sdf.offset(p)), (whole.normal(p), whole.offset(p)), "{p}");
                hits += 1;
            }
        }
        assert_eq!(of_pieces, of_whole);
        assert!(hits > 90, "{hits}");
    }
}

#[test]
fn ten_thousand_solids_in_one_place_take_no_longer_than_the_budget() {
    let sdf = object(|t| {
        let balls: Vec<_> = (0..10_000).map(|_| t.sphere(1.0)).collect();
        t.smooth_union(&balls, 1e-4)
    });
    let (_, steps) = sdf.cells().expect("many");
    assert!(steps > 10_000.0, "nothing can be left out of {steps}");
}
