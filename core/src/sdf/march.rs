//! Owns the march of one ray through a tape: how far to step, what counts as a hit, when to give up.

use glam::{DVec3, Vec3};

use crate::math::Aabb;

use super::object::Sdf;
use super::pace::{Course, Limits, Pace, blur};
use super::root::{End, Search};
use std::ops::ControlFlow::{self, Break, Continue};

/// What marching cost, and what went wrong.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MarchStats {
    /// Rays that entered the bounds of an object.
    pub rays: u64,
    /// Evaluations of distance functions.
    pub evaluations: u64,
    /// Rays that ran out of steps: where they had come within the hit distance of the surface and were about to meet it
    /// they count as hits, else as misses.
    pub exhausted: u64,
    /// Steps that ended inside although the value had promised free space; they were taken back and made smaller.
    pub overshoots: u64,
    /// Sign changes that were bracketed and refined: the hits.
    pub brackets: u64,
}

impl MarchStats {
    /// Adds another's counts.
    pub fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.evaluations += other.evaluations;
        self.exhausted += other.exhausted;
        self.overshoots += other.overshoots;
        self.brackets += other.brackets;
    }
}

/// A ray inside the bounds of its object: unit direction, distances counted from where it enters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    pub(super) origin: Vec3,
    pub(super) dir: Vec3,
    /// Length inside the bounds.
    pub(super) length: f32,
    /// Distance from the ray's own origin to `origin`.
    pub(super) start: f64,
    /// Length of a unit of the ray's own direction.
    unit: f64,
}

impl Segment {
    /// The part of a ray between two distances that is inside `bounds`; `dir` is a unit vector.
    ///
    /// In f64, so that only the entry point is rounded: an origin far away costs no precision at the object.
    ///
    /// `unit` is the length of a unit of the ray's own direction.
    pub(super) fn clip(bounds: Aabb, origin: DVec3, dir: DVec3, unit: f64, limits: [f64; 2]) -> Option<Self> {
        let [mut near, mut far] = limits;
        for axis in 0..3 {
            let (low, high) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
            if dir[axis] == 0.0 {
                if !(low <= origin[axis] && origin[axis] <= high) {
                    return None;
                }
                continue;
            }
            let inverse = 1.0 / dir[axis];
            let (a, b) = ((low - origin[axis]) * inverse, (high - origin[axis]) * inverse);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        // Written so that NaN ends here too.
        if !(near <= far && near.is_finite() && far.is_finite()) {
            return None;
        }
        let entry = (origin + dir * near).as_vec3();
        Some(Self { origin: entry, dir: dir.as_vec3(), length: (far - near) as f32, start: near, unit })
    }

    /// The distance in units of the ray's own direction of a place `at` from the start.
    pub(super) fn reached(&self, at: f32) -> f32 {
        ((self.start + f64::from(at)) / self.unit) as f32
    }
}

/// One ray on its way: a machine that asks for the value at a distance and is told it, so that one ray or eight may be
/// served at a time.
#[derive(Debug, Clone)]
pub(super) struct March {
    segment: Segment,
    pace: Pace<f32>,
    phase: Phase,
    evaluations: u32,
    search: Search,
    goal: Goal,
}

/// What a march is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Goal {
    /// The first hit.
    First,
    /// Whether there is a hit: a bracket is enough.
    Any,
}

/// What a march is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// Looking for the first place where the sign means something.
    Leave,
    /// Stepping towards the first change of sign.
    Run,
    /// Narrowing a change of sign down.
    Refine,
}

/// How a march goes on: with the next value, or to its end, with the distance of the first hit if there is one.
pub(super) type Next = ControlFlow<Option<f32>>;

impl March {
    /// A march along a segment.
    ///
    /// `epsilon` is half the least step per unit of distance travelled: the march steps through the surface on
    /// purpose, and what it brackets by a change of sign is refined. Features thinner than twice that may be skipped.
    pub(super) fn new(segment: Segment, epsilon: f32, goal: Goal) -> Self {
        let course = Course { side: 1.0, epsilon, start: segment.start as f32, length: segment.length };
        let here = End { at: 0.0, value: 0.0 };
        let search = Search::new(here, here, 0.0);
        Self { segment, pace: Pace::new(course), phase: Phase::Leave, evaluations: 0, search, goal }
    }

    /// Where the next value is asked for.
    pub(super) fn point(&self) -> Vec3 {
        self.segment.origin + self.segment.dir * self.pace.at
    }

    /// The ray.
    pub(super) fn segment(&self) -> &Segment {
        &self.segment
    }

    /// How it approaches the surface.
    pub(super) fn pace(&self) -> &Pace<f32> {
        &self.pace
    }

    /// Puts it where it is by a pace that went on without it.
    pub(super) fn resume(&mut self, pace: Pace<f32>) {
        self.pace = pace;
    }

    /// Whether [`Pace::go_on`] may serve it.
    pub(super) fn is_running(&self) -> bool {
        self.phase == Phase::Run
    }

    /// Whether it is enough for it that some place ahead is on the other side, and whether signs tell that: values of
    /// fractals do not.
    pub(super) fn may_look_ahead(&self, sdf: &Sdf) -> bool {
        self.goal == Goal::Any && self.phase == Phase::Run && sdf.tape().level().is_none()
    }

    /// Values that it was told so far.
    pub(super) fn evaluations(&self) -> u32 {
        self.evaluations
    }

    /// Takes the value at [`March::point`], and the rounding error of a value there.
    #[inline]
    pub(super) fn tell(&mut self, sdf: &Sdf, value: f32, noise: f32, stats: &mut MarchStats) -> Next {
        self.evaluations += 1;
        let value = self.pace.seen(value);
        match self.phase {
            Phase::Leave => self.leave(sdf, value, noise, stats),
            Phase::Run => self.run(sdf, value, noise, stats),
            Phase::Refine => {
                self.search.tell(value);
                self.refine()
            }
        }
    }

    /// Decides from which side the ray comes, and starts at the first distance where its value is clearly on that side.
    ///
    /// A ray may start on a surface, where rounding decides the sign: it goes on until the sign means something, and
    /// so never hits the surface that it leaves.
    fn leave(&mut self, sdf: &Sdf, value: f32, noise: f32, stats: &mut MarchStats) -> Next {
        let level = sdf.tape().level().unwrap_or(0.0);
        // The inside of a fractal has no values below its level: a start there is on the surface, or near it.
        let floor = 4.0 * noise;
        let reach = if level > 0.0 { 16.0 * level } else { f32::INFINITY };
        let pace = &mut self.pace;
        if (-floor.max(level)..floor).contains(&value) && pace.at < reach {
            pace.step = if pace.at == 0.0 { floor.max(level / 16.0) } else { 2.0 * pace.step };
            pace.at += pace.step;
            return if pace.at > pace.course.length { Break(None) } else { Continue(()) };
        }
        if value < 0.0 {
            pace.course.side = -1.0;
        }
        self.phase = Phase::Run;
        (pace.here, pace.value, pace.step) = (pace.at, value.abs(), value.abs());
        pace.least = pace.least_step(sdf.limits(), noise);
        self.plan(sdf.limits(), stats)
    }

    /// Steps towards the first bracketed root.
    #[inline]
    fn run(&mut self, sdf: &Sdf, value: f32, noise: f32, stats: &mut MarchStats) -> Next {
        let (pace, usual) = self.pace.go_on(sdf.limits(), value, noise);
        if usual {
            self.pace = pace;
            return Continue(());
        }
        self.come_to(sdf, value, noise, stats)
    }

    /// Does what is left when [`Pace::go_on`] does not know how.
    fn come_to(&mut self, sdf: &Sdf, value: f32, noise: f32, stats: &mut MarchStats) -> Next {
        let (limits, pace) = (sdf.limits(), &mut self.pace);
        if pace.too_far(value, noise) {
            *pace = pace.backward();
            return self.plan(limits, stats);
        }
        if value < 0.0 {
            if sdf.tape().level().is_some() && !pace.is_deliberate() {
                stats.overshoots += 1;
                pace.caution = 0.25;
                (pace.slope, pace.step) = (-1.0, 0.25 * pace.step);
                return self.plan(limits, stats);
            }
            stats.brackets += 1;
            if self.goal == Goal::Any {
                return Break(Some(pace.at));
            }
            self.phase = Phase::Refine;
            let (here, there) = (End { at: pace.here, value: pace.value }, End { at: pace.at, value });
            self.search = Search::new(here, there, 4.0 * blur(there.at, noise));
            return self.refine();
        }
        if pace.at >= pace.course.length {
            return Break(None);
        }
        *pace = pace.forward(limits, value, noise);
        self.plan(limits, stats)
    }

    /// Plans the next step from here, of about the pace's step.
    #[inline]
    fn plan(&mut self, limits: &Limits, stats: &mut MarchStats) -> Next {
        let pace = &mut self.pace;
        if pace.is_spent(limits) {
            stats.exhausted += 1;
            let nearest = &pace.nearest;
            // A ray that would not get there on the rest of its way has hit nothing, however close it came.
            let arrives = -pace.slope * (pace.course.length - pace.here) >= pace.value;
            let hit = arrives && nearest.value <= nearest.least;
            return Break(hit.then_some(nearest.at));
        }
        *pace = pace.planned(limits);
        Continue(())
    }

    fn refine(&mut self) -> Next {
        match self.search.next() {
            Continue(at) => {
                self.pace.at = at;
                Continue(())
            }
            Break(root) => Break(Some(root)),
        }
    }
}
