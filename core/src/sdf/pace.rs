//! Owns how a march approaches a surface: from value to value, of one ray or of eight.

use super::object::Resolved;
use super::real::{Logic, Real};
use wide::{bytemuck, f32x8};

/// Unit roundoff of f32.
pub(super) const ROUNDOFF: f32 = 1.0 / 16_777_216.0;

/// What rounding hides along a ray: the error of a value, or of the distance itself.
pub(super) fn blur<R: Real>(at: R, noise: R) -> R {
    noise.max(R::splat(ROUNDOFF) * at)
}

/// Memory of the slope estimate: the weight of the newest step.
const SLOPE_WEIGHT: f32 = 0.3;

/// Auto-relaxed sphere tracing (Bálint and Valasek 2018) from a positive value towards the first change of sign.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace<R> {
    /// Where the next value is asked for, counted from the start of the segment.
    pub(super) at: R,
    /// The last place outside, and its value.
    pub(super) here: R,
    pub(super) value: R,
    /// Least step from here.
    pub(super) least: R,
    /// The step that is being made.
    pub(super) step: R,
    /// Estimated change of the value with the distance; NaN until the first step has measured it.
    pub(super) slope: R,
    /// What steps are multiplied with since one was too long.
    pub(super) caution: R,
    /// Steps so far.
    pub(super) steps: R,
    /// By how much the step is longer than the value promises.
    pub(super) relaxed: R,
    /// Where the ray came closest to a surface.
    pub(super) nearest: Nearest<R>,
    pub(super) course: Course<R>,
}

/// What does not change on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course<R> {
    /// Values are multiplied by this, so that the march always comes from positive values.
    pub(super) side: R,
    /// Half the least step per unit of distance travelled.
    pub(super) epsilon: R,
    /// Distance from the ray's own origin to the start of the segment.
    pub(super) start: R,
    /// Length of the segment.
    pub(super) length: R,
}

/// Where a ray came closest to a surface, as seen from its origin (Keinert et al. 2014): the answer when steps run
/// out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Nearest<R> {
    pub(super) at: R,
    pub(super) value: R,
    /// The least step from there.
    pub(super) least: R,
    /// Distance from the ray's own origin.
    pub(super) travelled: R,
}

/// The limits of steps, for all rays of an object.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    hit_epsilon: Option<f32>,
    largest_hit_epsilon: f32,
    step_clamp: f32,
    max_steps: f32,
    /// Steepest slope that is trusted: without a proven bound a long step is a gamble.
    steepest: f32,
}

impl Limits {
    pub(super) fn new(resolved: &Resolved, fractal: bool) -> Self {
        Self {
            hit_epsilon: resolved.hit_epsilon,
            largest_hit_epsilon: resolved.largest_hit_epsilon,
            step_clamp: resolved.step_clamp,
            max_steps: resolved.max_steps as f32,
            steepest: if fractal { 0.5 } else { 0.99 },
        }
    }
}

/// How many numbers a pace is.
const FIELDS: usize = 17;

impl<R: Copy> Pace<R> {
    /// All numbers.
    fn fields(&self) -> [R; FIELDS] {
        let (n, c) = (&self.nearest, &self.course);
        [
            self.at,
            self.here,
            self.value,
            self.least,
            self.step,
            self.slope,
            self.caution,
            self.steps,
            self.relaxed,
            n.at,
            n.value,
            n.least,
            n.travelled,
            c.side,
            c.epsilon,
            c.start,
            c.length,
        ]
    }

    /// [`Pace::fields`], to be changed.
    fn fields_mut(&mut self) -> [&mut R; FIELDS] {
        let (n, c) = (&mut self.nearest, &mut self.course);
        [
            &mut self.at,
            &mut self.here,
            &mut self.value,
            &mut self.least,
            &mut self.step,
            &mut self.slope,
            &mut self.caution,
            &mut self.steps,
            &mut self.relaxed,
            &mut n.at,
            &mut n.value,
            &mut n.least,
            &mut n.travelled,
            &mut c.side,
            &mut c.epsilon,
            &mut c.start,
            &mut c.length,
        ]
    }

    /// The pace of which these are [`Pace::fields`].
    fn from_fields(fields: [R; FIELDS]) -> Self {
        let [at, here, value, least, step, slope, caution, steps, relaxed, rest @ ..] = fields;
        let [nearest_at, nearest_value, nearest_least, travelled, side, epsilon, start, length] = rest;
        let nearest = Nearest { at: nearest_at, value: nearest_value, least: nearest_least, travelled };
        let course = Course { side, epsilon, start, length };
        Self { at, here, value, least, step, slope, caution, steps, relaxed, nearest, course }
    }
}

impl<R: Logic> Pace<R> {
    /// A march along a course that has not begun.
    pub(super) fn new(course: Course<R>) -> Self {
        let [zero, one] = [R::splat(0.0), R::splat(1.0)];
        let nearest = Nearest { at: zero, value: R::splat(f32::INFINITY), least: zero, travelled: one };
        Self {
            at: zero,
            here: zero,
            value: zero,
            least: zero,
            step: zero,
            slope: R::splat(f32::NAN),
            caution: one,
            steps: zero,
            relaxed: zero,
            nearest,
            course,
        }
    }

    /// A value as seen from the side of the march.
    pub(super) fn seen(&self, value: R) -> R {
        // Nothing here makes NaN from finite points; if it did, the ray must still end.
        R::select(value.is_nan(), R::splat(0.0), self.course.side * value)
    }

    /// The least step from a place along the ray where a value has a rounding error.
    pub(super) fn least_step(&self, limits: &Limits, noise: R) -> R {
        let wanted = if let Some(epsilon) = limits.hit_epsilon {
            R::splat(epsilon)
        } else {
            let travelled = self.course.start + self.at;
            (self.course.epsilon * travelled).min(R::splat(limits.largest_hit_epsilon))
        };
        (R::splat(2.0) * wanted).max(R::splat(4.0) * blur(self.at, noise))
    }

    /// Whether the step to [`Pace::at`] was longer than the values at both its ends promise together to be free: it has
    /// to be taken back.
    pub(super) fn too_far(&self, value: R, noise: R) -> R::Mask {
        let free = (self.value + value.abs()) * R::splat(1.0 + 8.0 * ROUNDOFF) + R::splat(4.0) * noise;
        R::both(R::splat(0.0).less(self.relaxed), free.less(self.at - self.here))
    }

    /// Whether all steps are used up.
    pub(super) fn is_spent(&self, limits: &Limits) -> R::Mask {
        R::not(self.steps.less(R::splat(limits.max_steps)))
    }

    /// Takes the value at [`Pace::at`] (see [`Pace::seen`]) and its rounding error, and plans the next step; the mask holds
    /// where that is all there is to do. Where it does not hold, the march has come to something, and the answer means
    /// nothing.
    ///
    /// The step is the one after which the spheres around both ends just touch, were the surface a plane of the
    /// estimated slope; where they do not overlap, the plain step is taken instead.
    #[inline]
    pub(super) fn go_on(&self, limits: &Limits, value: R, noise: R) -> (Self, R::Mask) {
        let back = self.too_far(value, noise);
        // Exactly 0 is not inside: a solid less itself is 0 all over its surface.
        let arrives = R::either(value.less(R::splat(0.0)), R::not(self.at.less(self.course.length)));
        let usual = R::not(R::either(self.is_spent(limits), R::both(R::not(back), arrives)));
        let ahead = self.forward(limits, value, noise);
        let behind = self.backward();
        (Self::select(back, behind, ahead).planned(limits), usual)
    }

    /// From the place of the newest value.
    #[inline]
    pub(super) fn forward(&self, limits: &Limits, value: R, noise: R) -> Self {
        let least = self.least_step(limits, noise);
        let measured = (value - self.value) / (self.at - self.here);
        let updated = self.slope + R::splat(SLOPE_WEIGHT) * (measured - self.slope);
        let slope = R::select(self.slope.is_nan(), measured, updated);
        let trusted = slope.max(R::splat(-1.0)).min(R::splat(limits.steepest));
        let step = self.caution * R::splat(2.0) * value / (R::splat(1.0) - trusted);
        let nearest = self.nearest.offer(self.at, value, least, self.course.start);
        Self { here: self.at, value, least, step, slope, nearest, ..*self }
    }

    /// From the last place again, by the plain step.
    #[inline]
    pub(super) fn backward(&self) -> Self {
        Self { slope: R::splat(-1.0), step: self.value * self.caution, ..*self }
    }

    #[inline]
    fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        let either = |yes, no| R::select(mask, yes, no);
        Self {
            here: either(yes.here, no.here),
            value: either(yes.value, no.value),
            least: either(yes.least, no.least),
            step: either(yes.step, no.step),
            slope: either(yes.slope, no.slope),
            nearest: Nearest::select(mask, yes.nearest, no.nearest),
            ..no
        }
    }

    /// The same with the next step planned, of about [`Pace::step`].
    #[inline]
    pub(super) fn planned(mut self, limits: &Limits) -> Self {
        self.steps = self.steps + R::splat(1.0);
        self.step = self.step.min(R::splat(limits.step_clamp)).max(self.least);
        // Decided on the step as planned: its end is rounded.
        self.relaxed = self.step - self.value.max(self.least);
        self.at = (self.here + self.step).min(self.course.length);
        self
    }
}

impl<R: Logic> Nearest<R> {
    #[inline]
    fn offer(&self, at: R, value: R, least: R, start: R) -> Self {
        let travelled = start + at;
        // Which of two angles is smaller, without dividing.
        let closer = (value * self.travelled).less(self.value * travelled);
        Self::select(closer, Self { at, value, least, travelled }, *self)
    }

    #[inline]
    fn select(mask: R::Mask, yes: Self, no: Self) -> Self {
        let either = |yes, no| R::select(mask, yes, no);
        Self {
            at: either(yes.at, no.at),
            value: either(yes.value, no.value),
            least: either(yes.least, no.least),
            travelled: either(yes.travelled, no.travelled),
        }
    }
}

impl Pace<f32x8> {
    /// One lane.
    pub(super) fn lane(&self, lane: usize) -> Pace<f32> {
        Pace::from_fields(self.fields().map(|field| field.to_array()[lane]))
    }

    /// Sets one lane.
    pub(super) fn set(&mut self, lane: usize, pace: &Pace<f32>) {
        for (field, value) in self.fields_mut().into_iter().zip(pace.fields()) {
            bytemuck::cast_mut::<f32x8, [f32; 8]>(field)[lane] = value;
        }
    }
}

impl Pace<f32> {
    /// Whether the step is the least one, which goes through surfaces on purpose.
    pub(super) fn is_deliberate(&self) -> bool {
        self.step <= self.least
    }
}
