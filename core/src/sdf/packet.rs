//! Owns marching eight rays at a time: a lane whose ray has ended takes the next one.

use std::ops::ControlFlow;

use wide::{f32x8, u32x8};

use super::march::{March, MarchStats};
use super::object::Sdf;
use super::pace::{Course, Pace};
use super::real::Point;

/// Rays that are marched at a time.
const LANES: usize = 8;

/// After so many evaluations a march that looks for any hit looks ahead.
const PATIENCE: u32 = 6;

/// The hit of every march of a list, as [`Sdf::intersect`] would find it where the first one is wanted: `ended` gets the
/// name that came with the march, the distance in units of the ray's direction if there is a hit, and how many evaluations
/// that took.
///
/// A ray's answer does not depend on the others; the order of the answers does.
pub(super) fn all_hits<N: Copy>(
    sdf: &Sdf,
    mut marches: impl Iterator<Item = (N, March)>,
    stats: &mut MarchStats,
    mut ended: impl FnMut(N, Option<f32>, u32),
) {
    let idle = Pace::new(Course { side: 0.0, epsilon: 0.0, start: 0.0, length: 0.0 });
    let mut rays = Rays::new(&idle);
    let mut lanes: [Option<(N, March)>; LANES] = std::array::from_fn(|_| marches.next());
    for (lane, taken) in lanes.iter().enumerate() {
        if let Some((_, march)) = taken {
            rays.begin(lane, march);
        }
    }
    // Every round tells every lane one value.
    let (mut round, mut begun) = (0_u32, [0_u32; LANES]);
    loop {
        let taken = bits(lanes.each_ref().map(Option::is_some));
        if taken == 0 {
            return;
        }
        let point = rays.points();
        let (values, noises) = (sdf.distances(point, taken), sdf.noises(point));
        round = round.wrapping_add(1);
        let before = rays.pace;
        let gone_on = rays.go_on(sdf, values, noises);
        let (values, noises) = (values.to_array(), noises.to_array());
        let patient = bits(begun.map(|begun| round.wrapping_sub(begun) != PATIENCE));
        for lane in (0..LANES).filter(|lane| (gone_on & patient) >> lane & 1 == 0) {
            let Some((name, march)) = &mut lanes[lane] else {
                rays.pace.set(lane, &idle);
                continue;
            };
            let next = if gone_on >> lane & 1 == 1 {
                if !march.may_look_ahead(sdf) {
                    continue;
                }
                begun[lane] = begun[lane].wrapping_sub(LANES as u32);
                let Some(at) = rays.look_ahead(sdf, lane) else { continue };
                stats.brackets += 1;
                ControlFlow::Break(Some(at))
            } else {
                if march.is_running() {
                    march.resume(before.lane(lane));
                }
                march.tell(sdf, values[lane], noises[lane], stats)
            };
            match next {
                ControlFlow::Continue(()) => rays.set(lane, march),
                ControlFlow::Break(hit) => {
                    let evaluations = round.wrapping_sub(begun[lane]);
                    stats.rays += 1;
                    stats.evaluations += u64::from(evaluations);
                    ended(*name, hit.map(|at| march.segment().reached(at)), evaluations);
                    begun[lane] = round;
                    lanes[lane] = marches.next();
                    if let Some((_, march)) = &lanes[lane] {
                        rays.begin(lane, march);
                    }
                }
            }
        }
    }
}

/// The rays of all lanes by coordinate.
struct Rays {
    origin: [[f32; LANES]; 3],
    dir: [[f32; LANES]; 3],
    pace: Pace<f32x8>,
    /// Lanes that [`Pace::go_on`] may serve, as bits.
    running: u32,
}

impl Rays {
    fn new(idle: &Pace<f32>) -> Self {
        let course =
            Course { side: f32x8::ZERO, epsilon: f32x8::ZERO, start: f32x8::ZERO, length: f32x8::ZERO };
        let mut pace = Pace::new(course);
        (0..LANES).for_each(|lane| pace.set(lane, idle));
        Self { origin: Default::default(), dir: Default::default(), pace, running: 0 }
    }

    /// Gives a lane a new march.
    fn begin(&mut self, lane: usize, march: &March) {
        let segment = march.segment();
        for axis in 0..3 {
            self.origin[axis][lane] = segment.origin[axis];
            self.dir[axis][lane] = segment.dir[axis];
        }
        self.set(lane, march);
    }

    /// Puts a lane where its march is.
    fn set(&mut self, lane: usize, march: &March) {
        self.pace.set(lane, march.pace());
        self.running = self.running & !(1 << lane) | u32::from(march.is_running()) << lane;
    }

    /// What [`March::point`] is for every lane.
    fn points(&self) -> Point<f32x8> {
        let [x, y, z] = std::array::from_fn(|axis| {
            f32x8::new(self.origin[axis]) + f32x8::new(self.dir[axis]) * self.pace.at
        });
        Point::new(x, y, z)
    }

    /// A place on the rest of a ray's way that is certainly on the other side of the surface, among eight that become rarer
    /// with the distance.
    ///
    /// Near a surface steps are short, and what a ray to a lamp meets is often behind much more of it.
    fn look_ahead(&self, sdf: &Sdf, lane: usize) -> Option<f32> {
        let pace = self.pace.lane(lane);
        let share: [f32; LANES] = std::array::from_fn(|i| ((i + 1) as f32 / (LANES + 1) as f32).powi(2));
        let at = f32x8::splat(pace.here) + f32x8::new(share) * f32x8::splat(pace.course.length - pace.here);
        let [x, y, z] = std::array::from_fn(|axis| {
            f32x8::splat(self.origin[axis][lane]) + f32x8::splat(self.dir[axis][lane]) * at
        });
        let point = Point::new(x, y, z);
        let values = f32x8::splat(pace.course.side) * sdf.distances(point, 0xff);
        let clear = f32x8::splat(-4.0) * sdf.noises(point);
        let beyond: f32x8 = values.simd_lt(clear);
        let beyond = beyond.to_bitmask();
        (beyond != 0).then(|| at.to_array()[beyond.trailing_zeros() as usize])
    }

    /// Lets all lanes go on; those that did, as bits. What the others have now means nothing.
    fn go_on(&mut self, sdf: &Sdf, values: f32x8, noises: f32x8) -> u32 {
        let (pace, usual) = self.pace.go_on(sdf.limits(), self.pace.seen(values), noises);
        self.pace = pace;
        usual.to_bitmask() & self.running
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
