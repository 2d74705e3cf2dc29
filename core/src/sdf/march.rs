//! Owns the march of one ray through a tape: how far to step, what counts as a hit, when to give up.

use glam::{DVec3, Vec3};

use crate::math::Aabb;

use super::object::{Resolved, Sdf};
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

/// Unit roundoff of f32.
pub(super) const ROUNDOFF: f32 = 1.0 / 16_777_216.0;

/// Memory of the slope estimate: the weight of the newest step.
const SLOPE_WEIGHT: f32 = 0.3;

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
/// served at a time. Values are multiplied by `side`, so that the march always comes from positive values.
#[derive(Debug, Clone)]
pub(super) struct March {
    segment: Segment,
    side: f32,
    /// Half the least step per unit of distance travelled.
    epsilon: f32,
    /// Where the next value is asked for, counted from the start of the segment.
    at: f32,
    phase: Phase,
    here: End,
    /// Least step from here.
    least: f32,
    /// The step that is being made.
    step: f32,
    /// Estimated change of the value with the distance; unknown until the first step has measured it.
    slope: f32,
    /// What steps are multiplied with since one was too long.
    caution: f32,
    /// Whether the step is longer than the value promises.
    relaxed: bool,
    /// Whether the step is the least one, which goes through surfaces on purpose.
    deliberate: bool,
    steps: u32,
    evaluations: u32,
    nearest: Nearest,
    search: Search,
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
    pub(super) fn new(segment: Segment, epsilon: f32) -> Self {
        let here = End { at: 0.0, value: 0.0 };
        Self {
            segment,
            side: 1.0,
            epsilon,
            at: 0.0,
            phase: Phase::Leave,
            here,
            least: 0.0,
            step: 0.0,
            slope: f32::NAN,
            caution: 1.0,
            relaxed: false,
            deliberate: false,
            steps: 0,
            evaluations: 0,
            nearest: Nearest::default(),
            search: Search::new(here, here, 0.0),
        }
    }

    /// Where the next value is asked for.
    pub(super) fn point(&self) -> Vec3 {
        self.segment.origin + self.segment.dir * self.at
    }

    /// The ray.
    pub(super) fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Where the next value is asked for, counted from the start of the segment.
    pub(super) fn at(&self) -> f32 {
        self.at
    }

    /// Values that it was told so far.
    pub(super) fn evaluations(&self) -> u32 {
        self.evaluations
    }

    /// Takes the value at [`March::point`], and the rounding error of a value there.
    #[inline]
    pub(super) fn tell(&mut self, sdf: &Sdf, value: f32, noise: f32, stats: &mut MarchStats) -> Next {
        self.evaluations += 1;
        // Nothing here makes NaN from finite points; if it did, the ray must still end.
        let value = if value.is_nan() { 0.0 } else { self.side * value };
        match self.phase {
            Phase::Leave => self.leave(sdf, value, noise, stats),
            Phase::Run => self.run(sdf, value, noise, stats),
            Phase::Refine => {
                self.search.tell(value);
                self.refine()
            }
        }
    }

    /// The least step from a place along the ray where a value has a rounding error.
    #[inline]
    fn least_step(&self, resolved: &Resolved, noise: f32) -> f32 {
        let travelled = self.segment.start as f32 + self.at;
        let derived = (self.epsilon * travelled).min(resolved.largest_hit_epsilon);
        (2.0 * resolved.hit_epsilon.unwrap_or(derived)).max(4.0 * blur(self.at, noise))
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
        if (-floor.max(level)..floor).contains(&value) && self.at < reach {
            self.step = if self.at == 0.0 { floor.max(level / 16.0) } else { 2.0 * self.step };
            self.at += self.step;
            return if self.at > self.segment.length { Break(None) } else { Continue(()) };
        }
        if value < 0.0 {
            self.side = -1.0;
        }
        self.phase = Phase::Run;
        self.here = End { at: self.at, value: value.abs() };
        self.least = self.least_step(sdf.resolved(), noise);
        self.step = self.here.value;
        self.plan(sdf.resolved(), stats)
    }

    /// Auto-relaxed sphere tracing (Bálint and Valasek 2018) from a positive value to the first bracketed root.
    ///
    /// The step is the one after which the spheres around both ends just touch, were the surface a plane of the
    /// estimated slope; where they do not overlap, the plain step is taken instead.
    #[inline]
    fn run(&mut self, sdf: &Sdf, value: f32, noise: f32, stats: &mut MarchStats) -> Next {
        let fractal = sdf.tape().level().is_some();
        let (here, there) = (self.here, End { at: self.at, value });
        let free = here.value + there.value.abs();
        let overlap = there.at - here.at <= free * (1.0 + 8.0 * ROUNDOFF) + 4.0 * noise;
        if self.relaxed && !overlap {
            (self.slope, self.step) = (-1.0, here.value * self.caution);
            return self.plan(sdf.resolved(), stats);
        }
        // Exactly 0 is not inside: a solid less itself is 0 all over its surface.
        if there.value < 0.0 {
            if fractal && !self.deliberate {
                stats.overshoots += 1;
                self.caution = 0.25;
                (self.slope, self.step) = (-1.0, 0.25 * self.step);
                return self.plan(sdf.resolved(), stats);
            }
            stats.brackets += 1;
            self.phase = Phase::Refine;
            self.search = Search::new(here, there, 4.0 * blur(there.at, noise));
            return self.refine();
        }
        if there.at >= self.segment.length {
            return Break(None);
        }
        self.least = self.least_step(sdf.resolved(), noise);
        self.nearest.offer(there, self.least, self.segment.start as f32);
        let measured = (there.value - here.value) / (there.at - here.at);
        self.slope =
            if self.slope.is_nan() { measured } else { self.slope + SLOPE_WEIGHT * (measured - self.slope) };
        // Without a proven bound a long step is a gamble.
        let steepest = if fractal { 0.5 } else { 0.99 };
        self.step = self.caution * 2.0 * there.value / (1.0 - self.slope.clamp(-1.0, steepest));
        self.here = there;
        self.plan(sdf.resolved(), stats)
    }

    /// Plans the next step from here, of about `self.step`.
    #[inline]
    fn plan(&mut self, resolved: &Resolved, stats: &mut MarchStats) -> Next {
        if self.steps == resolved.max_steps {
            stats.exhausted += 1;
            let nearest = &self.nearest;
            // A ray that would not get there on the rest of its way has hit nothing, however close it came.
            let arrives = -self.slope * (self.segment.length - self.here.at) >= self.here.value;
            let hit = arrives && nearest.value <= nearest.least;
            return Break(hit.then_some(nearest.at));
        }
        self.steps += 1;
        self.step = self.step.min(resolved.step_clamp).max(self.least);
        // Decided on the step as planned: its end is rounded.
        self.relaxed = self.step > self.here.value.max(self.least);
        self.deliberate = self.step <= self.least;
        self.at = (self.here.at + self.step).min(self.segment.length);
        Continue(())
    }

    fn refine(&mut self) -> Next {
        match self.search.next() {
            Continue(at) => {
                self.at = at;
                Continue(())
            }
            Break(root) => Break(Some(root)),
        }
    }
}

/// What rounding hides along the ray: the error of a value, or of the distance itself.
fn blur(at: f32, noise: f32) -> f32 {
    noise.max(ROUNDOFF * at)
}

/// Where a ray came closest to a surface, as seen from its origin (Keinert et al. 2014): the answer when steps run
/// out.
#[derive(Debug, Clone)]
struct Nearest {
    at: f32,
    value: f32,
    /// The least step from there.
    least: f32,
    /// Distance from the ray's own origin.
    travelled: f32,
}

impl Default for Nearest {
    fn default() -> Self {
        Self { at: 0.0, value: f32::INFINITY, least: 0.0, travelled: 1.0 }
    }
}

impl Nearest {
    #[inline]
    fn offer(&mut self, end: End, least: f32, start: f32) {
        let travelled = start + end.at;
        // Which of two angles is smaller, without dividing.
        if end.value * self.travelled < self.value * travelled {
            *self = Self { at: end.at, value: end.value, least, travelled };
        }
    }
}
