//! Owns the rough picture of an emitter or of many: a box, a cone of directions, and a brightness
//! (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting").

use super::Receiver;
use crate::math::Aabb;
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};
use wide::f32x8;

/// Where emitters are and how they shine: in full within a cone around the axis, then falling with the cosine of the
/// angle beyond it. Angles in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Emitter {
    /// The box around them.
    pub(super) bounds: Aabb,
    /// Unit axis of the cone.
    pub(super) axis: DVec3,
    /// Half angle of the full cone, up to π.
    pub(super) full: f64,
    /// Angle beyond it from which on there is no light, at most π/2.
    pub(super) fade: f64,
    /// Luminance of the intensity within the full cone: power per solid angle.
    pub(super) intensity: f64,
}

impl Emitter {
    /// One that is never chosen.
    pub(super) const NOTHING: Self = Self {
        bounds: Aabb { min: Vec3::ZERO, max: Vec3::ZERO },
        axis: DVec3::Z,
        full: PI,
        fade: FRAC_PI_2,
        intensity: 0.0,
    };

    /// A flat one that shines from its front.
    pub(super) fn front(bounds: Aabb, normal: DVec3, intensity: f64) -> Self {
        Self { bounds, axis: normal, full: 0.0, fade: FRAC_PI_2, intensity }
    }

    /// One that shines evenly in all directions.
    pub(super) fn everywhere(bounds: Aabb, intensity: f64) -> Self {
        Self { bounds, axis: DVec3::Z, full: PI, fade: FRAC_PI_2, intensity }
    }

    /// Both together.
    pub(super) fn union(&self, other: &Self) -> Self {
        let (axis, full) = union_of_cones((self.axis, self.full), (other.axis, other.full));
        Self {
            bounds: self.bounds.union(other.bounds),
            axis,
            full,
            fade: self.fade.max(other.fade),
            intensity: self.intensity + other.intensity,
        }
    }

    /// How much it spoils the choice to know no more than this picture: brightness times spread of directions (the
    /// solid angle, weighed by the falloff) times squared size. The size is that of the ball around the box, which is
    /// what [`Balls::importance`] looks at; a surface area would be 0 for points in a row.
    pub(super) fn cost(&self) -> f64 {
        let (full, reach) = (self.full, (self.full + self.fade).min(PI));
        let (sin, cos) = libm::sincos(full);
        let spread = 2.0 * PI * (1.0 - cos)
            + FRAC_PI_2 * (2.0 * reach * sin - libm::cos(full - 2.0 * reach) - 2.0 * full * sin + cos);
        self.intensity * spread * f64::from(self.bounds.size().length_squared())
    }
}

/// The smallest cone (axis and half angle) that holds two.
fn union_of_cones(a: (DVec3, f64), b: (DVec3, f64)) -> (DVec3, f64) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    // What is common needs no trigonometry: all directions, and lights that face the same way.
    if a.1 >= PI || a.0 == b.0 {
        return a;
    }
    let between = libm::atan2(a.0.cross(b.0).length(), a.0.dot(b.0));
    if between + b.1 <= a.1 {
        return a;
    }
    let half = (a.1 + between + b.1) * 0.5;
    let sideways = (b.0 - a.0 * a.0.dot(b.0)).normalize_or_zero();
    if half >= PI || sideways == DVec3::ZERO {
        return (a.0, PI);
    }
    let (sin, cos) = libm::sincos(half - a.1);
    ((a.0 * cos + sideways * sin).normalize(), half)
}

/// Eight emitters made ready to be weighed together: their balls instead of their boxes, sines and cosines instead of
/// angles. Lanes without an emitter weigh nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Balls {
    center: [f32x8; 3],
    radius2: f32x8,
    axis: [f32x8; 3],
    intensity: f32x8,
    cos_full: f32x8,
    sin_full: f32x8,
    /// Cosine of the angle beyond the full cone from which on there is no light.
    cos_fade: f32x8,
}

impl Balls {
    /// Widens cones by a few roundings, so that no light falls out of one.
    const SLACK: f64 = 1e-6;

    /// Of at most eight emitters.
    pub(super) fn new(emitters: &[Option<Emitter>]) -> Self {
        let lanes = |value: &dyn Fn(&Emitter) -> f32| {
            f32x8::from(std::array::from_fn(|i| emitters.get(i).and_then(Option::as_ref).map_or(0.0, value)))
        };
        let full = |e: &Emitter| (e.full + Self::SLACK).min(PI);
        let fade = |e: &Emitter| {
            if e.fade < FRAC_PI_2 { libm::cos(e.fade + Self::SLACK).max(0.0) as f32 } else { 0.0 }
        };
        Self {
            center: [0, 1, 2].map(|axis| lanes(&|e| e.bounds.center()[axis])),
            radius2: lanes(&|e| e.bounds.size().length_squared() * (0.25 + f32::EPSILON)),
            axis: [0, 1, 2].map(|axis| lanes(&|e| e.axis[axis] as f32)),
            intensity: lanes(&|e| e.intensity as f32),
            cos_full: lanes(&|e| libm::cos(full(e)) as f32),
            sin_full: lanes(&|e| libm::sin(full(e)) as f32),
            cos_fade: lanes(&fade),
        }
    }

    /// Roughly the irradiance that each brings, unoccluded: intensity times both cosines over squared distance, of the
    /// most favourable place in the ball; 0 only where it brings nothing. The squared distance is at least that of
    /// the ball's radius and `nearest2`.
    ///
    /// Second, how coarse a guess that is for more than one light: the squared part of the distance that the ball's
    /// radius is, 1 from within.
    #[inline]
    pub(super) fn importance(&self, from: &Receiver, nearest2: f32) -> ([f32; 8], [f32; 8]) {
        let (zero, one) = (f32x8::splat(0.0), f32x8::splat(1.0));
        let towards = [0, 1, 2].map(|axis| self.center[axis] - f32x8::splat(from.p[axis]));
        let d2 = dot(towards, towards);
        let inverse = one / d2.sqrt();
        let sin2 = self.radius2 / d2;
        let ball = (root(one - sin2), sin2.sqrt());
        let (off_axis, off_axis_sin) =
            less_angle(angle(-dot(towards, self.axis) * inverse), (self.cos_full, self.sin_full));
        let out = less_angle((off_axis, off_axis_sin), ball).0;
        let out = (out.simd_ge(self.cos_fade) & out.simd_gt(zero)).select(out, zero);
        let received = if from.n == Vec3::ZERO {
            one
        } else {
            let normal = from.n.to_array().map(f32x8::splat);
            less_angle(angle(dot(towards, normal) * inverse), ball).0.max(zero)
        };
        let cosines = d2.simd_gt(self.radius2).select(out * received, one);
        let far2 = d2.max(self.radius2).max(f32x8::splat(nearest2));
        let weight = self.intensity / far2 * cosines;
        // NaN and infinity fail the comparison.
        let weight = weight.simd_lt(f32x8::splat(f32::INFINITY)).select(weight, zero);
        (weight.to_array(), (self.radius2 / far2).to_array())
    }
}

#[inline]
fn dot(a: [f32x8; 3], b: [f32x8; 3]) -> f32x8 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Square root; 0 of what rounding has made negative.
#[inline]
fn root(x: f32x8) -> f32x8 {
    x.max(f32x8::splat(0.0)).sqrt()
}

/// Cosine and sine of the angles with some cosines.
#[inline]
fn angle(cos: f32x8) -> (f32x8, f32x8) {
    (cos, root(f32x8::splat(1.0) - cos * cos))
}

/// Cosine and sine of max(0, a − b), for angles from 0 to π given by cosine and sine.
#[inline]
fn less_angle(a: (f32x8, f32x8), b: (f32x8, f32x8)) -> (f32x8, f32x8) {
    let within = a.0.simd_ge(b.0);
    let cos = within.select(f32x8::splat(1.0), a.0 * b.0 + a.1 * b.1);
    (cos, within.select(f32x8::splat(0.0), a.1 * b.0 - a.0 * b.1))
}
