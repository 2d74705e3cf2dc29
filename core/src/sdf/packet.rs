//! Owns marching eight rays at a time: a lane whose ray has ended takes the next one.

use std::ops::ControlFlow;

use wide::{f32x8, u32x8};

use super::march::{March, MarchStats};
use super::object::Sdf;
use super::real::Point;

/// Rays that are marched at a time.
const LANES: usize = 8;

/// The first hit of every march of a list, as [`Sdf::intersect`] would find it: `ended` gets the name that came with
/// the march, the distance in units of the ray's direction if there is a hit, and how many evaluations that took.
///
/// A ray's answer does not depend on the others; the order of the answers does.
pub(super) fn first_hits<N: Copy>(
    sdf: &Sdf,
    mut marches: impl Iterator<Item = (N, March)>,
    stats: &mut MarchStats,
    mut ended: impl FnMut(N, Option<f32>, u32),
) {
    let mut lanes: [Option<(N, March)>; LANES] = std::array::from_fn(|_| marches.next());
    let mut rays = Rays::default();
    for (lane, taken) in lanes.iter().enumerate() {
        if let Some((_, march)) = taken {
            rays.set(lane, march);
        }
    }
    while lanes.iter().any(Option::is_some) {
        let point = rays.points();
        let values = sdf.distances(point, bits(lanes.each_ref().map(Option::is_some))).to_array();
        let noises = sdf.noises(point).to_array();
        for (lane, slot) in lanes.iter_mut().enumerate() {
            let Some((name, march)) = slot else { continue };
            match march.tell(sdf, values[lane], noises[lane], stats) {
                ControlFlow::Continue(()) => rays.at[lane] = march.at(),
                ControlFlow::Break(hit) => {
                    stats.rays += 1;
                    stats.evaluations += u64::from(march.evaluations());
                    ended(*name, hit.map(|at| march.segment().reached(at)), march.evaluations());
                    *slot = marches.next();
                    if let Some((_, march)) = slot {
                        rays.set(lane, march);
                    }
                }
            }
        }
    }
}

/// The rays of all lanes by coordinate; those of idle lanes stay where they were.
#[derive(Default)]
struct Rays {
    origin: [[f32; LANES]; 3],
    dir: [[f32; LANES]; 3],
    at: [f32; LANES],
}

impl Rays {
    fn set(&mut self, lane: usize, march: &March) {
        let segment = march.segment();
        for axis in 0..3 {
            self.origin[axis][lane] = segment.origin[axis];
            self.dir[axis][lane] = segment.dir[axis];
        }
        self.at[lane] = march.at();
    }

    /// What [`March::point`] is for every lane.
    fn points(&self) -> Point<f32x8> {
        let at = f32x8::new(self.at);
        let [x, y, z] =
            std::array::from_fn(|axis| f32x8::new(self.origin[axis]) + f32x8::new(self.dir[axis]) * at);
        Point::new(x, y, z)
    }
}

/// Lanes as bits.
pub(super) fn bits(lanes: [bool; LANES]) -> u32 {
    lanes.iter().rev().fold(0, |bits, &lane| bits << 1 | u32::from(lane))
}

/// The lanes that are wanted, as bits, by what they have in common.
pub(super) fn groups(of: u32x8, wanted: u32) -> impl Iterator<Item = (u32, u32)> + Clone {
    let mut left = wanted;
    std::iter::from_fn(move || {
        if left == 0 {
            return None;
        }
        let common = of.to_array()[left.trailing_zeros() as usize];
        let equal: u32x8 = of.simd_eq(u32x8::splat(common));
        let same = equal.to_bitmask() & left;
        left &= !same;
        Some((common, same))
    })
}
