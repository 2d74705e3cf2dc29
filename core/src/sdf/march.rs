//! Owns the march of one ray through a tape: how far to step, what counts as a hit, when to give up.

use glam::{DVec3, Vec3};

use crate::math::Aabb;

use super::object::Sdf;
use super::real::Point;
use super::root::{self, End};

/// What marching cost, and what went wrong.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MarchStats {
    /// Evaluations of distance functions.
    pub evaluations: u64,
    /// Rays that ran out of steps: where they were approaching and had come within the hit distance of the surface
    /// they count as hits, else as misses.
    pub exhausted: u64,
    /// Steps that ended inside although the value had promised free space; they were taken back and made smaller.
    pub overshoots: u64,
    /// Sign changes that were bracketed and refined: the hits.
    pub brackets: u64,
}

/// Unit roundoff of f32.
pub(super) const ROUNDOFF: f32 = 1.0 / 16_777_216.0;

/// Memory of the slope estimate: the weight of the newest step.
const SLOPE_WEIGHT: f32 = 0.3;

/// A ray inside the bounds of its object: unit direction, distances counted from where it enters.
pub(super) struct Segment {
    pub(super) origin: Vec3,
    pub(super) dir: Vec3,
    /// Length inside the bounds.
    pub(super) length: f32,
    /// Distance from the ray's own origin to `origin`.
    pub(super) start: f64,
}

impl Segment {
    /// The part of a ray between the distances `from` and `to` that is inside `bounds`; `dir` is a unit vector.
    ///
    /// In f64, so that only the entry point is rounded: an origin far away costs no precision at the object.
    pub(super) fn clip(bounds: Aabb, origin: DVec3, dir: DVec3, from: f64, to: f64) -> Option<Self> {
        let (mut near, mut far) = (from, to);
        for axis in 0..3 {
            let (low, high) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
            if dir[axis] == 0.0 {
                if !(low <= origin[axis] && origin[axis] <= high) {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - origin[axis]) / dir[axis], (high - origin[axis]) / dir[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        // Written so that NaN ends here too.
        if !(near <= far && near.is_finite() && far.is_finite()) {
            return None;
        }
        let entry = (origin + dir * near).as_vec3();
        Some(Self { origin: entry, dir: dir.as_vec3(), length: (far - near) as f32, start: near })
    }
}

/// One ray on its way. Values are multiplied by `side`, so that the march always comes from positive values.
struct March<'a> {
    sdf: &'a Sdf,
    segment: &'a Segment,
    side: f32,
    /// Half the least step per unit of distance travelled.
    epsilon: f32,
    stats: &'a mut MarchStats,
}

/// Distance along `segment` of the first hit.
///
/// `epsilon` is half the least step per unit of distance travelled: the march steps through the surface on purpose,
/// and what it brackets by a change of sign is refined. Features thinner than twice that may be skipped.
pub(super) fn first_hit(sdf: &Sdf, segment: &Segment, epsilon: f32, stats: &mut MarchStats) -> Option<f32> {
    let mut march = March { sdf, segment, side: 1.0, epsilon, stats };
    let (at, value) = march.leave_surface()?;
    march.run(at, value)
}

impl March<'_> {
    fn point(&self, at: f32) -> Vec3 {
        self.segment.origin + self.segment.dir * at
    }

    fn value(&mut self, at: f32) -> f32 {
        self.stats.evaluations += 1;
        let value = self.side * self.sdf.tape().distance::<f32>(Point::splat(self.point(at)));
        // Nothing here makes NaN from finite points; if it did, the ray must still end.
        if value.is_nan() { 0.0 } else { value }
    }

    /// Rounding error of a value at a distance along the ray.
    fn noise(&self, at: f32) -> f32 {
        self.sdf.noise(self.point(at))
    }

    /// What rounding hides along the ray: the noise of a value, or of the distance itself.
    fn blur(&self, at: f32) -> f32 {
        self.noise(at).max(ROUNDOFF * at)
    }

    /// The least step at a distance along the ray.
    fn least_step(&self, at: f32) -> f32 {
        let resolved = self.sdf.resolved();
        let travelled = self.segment.start as f32 + at;
        let epsilon =
            resolved.hit_epsilon.unwrap_or((self.epsilon * travelled).min(resolved.largest_hit_epsilon));
        (2.0 * epsilon).max(4.0 * self.blur(at))
    }

    /// Decides from which side the ray comes, and returns the first distance where its value is clearly on that side.
    ///
    /// A ray may start on a surface, where rounding decides the sign: it goes on until the sign means something, and
    /// so never hits the surface that it leaves.
    fn leave_surface(&mut self) -> Option<(f32, f32)> {
        let (mut at, mut value) = (0.0, self.value(0.0));
        let level = self.sdf.tape().level().unwrap_or(0.0);
        // The inside of a fractal has no values below its level: a start there is on the surface, or near it.
        let floor = 4.0 * self.noise(0.0);
        let band = floor.max(level);
        let reach = if level > 0.0 { 16.0 * level } else { f32::INFINITY };
        let mut step = floor.max(level / 16.0);
        while (-band..floor).contains(&value) && at < reach {
            at += step;
            if at > self.segment.length {
                return None;
            }
            value = self.value(at);
            step *= 2.0;
        }
        if value < 0.0 {
            self.side = -1.0;
            value = -value;
        }
        Some((at, value))
    }

    /// Auto-relaxed sphere tracing (Bálint and Valasek 2018) from a positive value to the first bracketed root.
    ///
    /// The step is the one after which the spheres around both ends just touch, were the surface a plane of the
    /// estimated slope; where they do not overlap, the plain step is taken instead.
    fn run(&mut self, at: f32, value: f32) -> Option<f32> {
        let resolved = self.sdf.resolved();
        let fractal = self.sdf.tape().level().is_some();
        // Without a proven bound a long step is a gamble.
        let steepest = if fractal { 0.5 } else { 0.99 };
        let length = self.segment.length;
        let mut here = End { at, value };
        // Unknown until the first step has measured it.
        let mut slope = f32::NAN;
        let mut caution = 1.0_f32;
        let mut step = value.max(self.least_step(at));
        let mut nearest = Nearest::default();
        for _ in 0..resolved.max_steps {
            let least = self.least_step(here.at);
            step = step.min(resolved.step_clamp).max(least);
            // Decided on the step as planned: its end is rounded.
            let (relaxed, deliberate) = (step > here.value.max(least), step <= least);
            let next = (here.at + step).min(length);
            let there = End { at: next, value: self.value(next) };
            let free = here.value + there.value.abs();
            let overlap = next - here.at <= free * (1.0 + 8.0 * ROUNDOFF) + 4.0 * self.noise(next);
            if relaxed && !overlap {
                (slope, step) = (-1.0, here.value * caution);
                continue;
            }
            if there.value <= 0.0 {
                if fractal && !deliberate {
                    self.stats.overshoots += 1;
                    caution = 0.25;
                    (slope, step) = (-1.0, 0.25 * step);
                    continue;
                }
                return Some(self.refine(here, there));
            }
            if next >= length {
                return None;
            }
            nearest.offer(there, self.segment.start as f32);
            let measured = (there.value - here.value) / (next - here.at);
            slope = if slope.is_nan() { measured } else { slope + SLOPE_WEIGHT * (measured - slope) };
            here = there;
            step = caution * 2.0 * here.value / (1.0 - slope.clamp(-1.0, steepest));
        }
        self.stats.exhausted += 1;
        // A ray that was leaving when its steps ran out has hit nothing, however close it came.
        (slope <= 0.0 && nearest.value <= self.least_step(nearest.at)).then_some(nearest.at)
    }

    fn refine(&mut self, low: End, high: End) -> f32 {
        self.stats.brackets += 1;
        let tolerance = 4.0 * self.blur(high.at);
        root::find(low, high, tolerance, |at| self.value(at))
    }
}

/// Where a ray came closest to a surface, as seen from its origin (Keinert et al. 2014): the answer when steps run
/// out.
struct Nearest {
    at: f32,
    value: f32,
    angle: f32,
}

impl Default for Nearest {
    fn default() -> Self {
        Self { at: 0.0, value: f32::INFINITY, angle: f32::INFINITY }
    }
}

impl Nearest {
    fn offer(&mut self, end: End, start: f32) {
        let angle = end.value / (start + end.at).max(f32::MIN_POSITIVE);
        if angle < self.angle {
            *self = Self { at: end.at, value: end.value, angle };
        }
    }
}
