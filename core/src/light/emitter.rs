//! Owns the rough picture of an emitter or of many: a box, a cone of directions, and a brightness
//! (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting").

use super::Receiver;
use crate::math::Aabb;
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

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
    /// what [`Ball::importance`] looks at; a surface area would be 0 for points in a row.
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

/// An emitter made ready to be weighed: its ball instead of its box, sines and cosines instead of angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ball {
    center: Vec3,
    radius2: f32,
    axis: Vec3,
    intensity: f32,
    /// Cosine and sine of the full cone.
    full: [f32; 2],
    /// Cosine of the angle beyond it from which on there is no light.
    cos_fade: f32,
}

impl Ball {
    /// Widens cones by a few roundings, so that no light falls out of one.
    const SLACK: f64 = 1e-6;

    pub(super) fn new(emitter: &Emitter) -> Self {
        let (sin, cos) = libm::sincos((emitter.full + Self::SLACK).min(PI));
        let cos_fade = if emitter.fade < FRAC_PI_2 { libm::cos(emitter.fade + Self::SLACK) } else { 0.0 };
        Self {
            center: emitter.bounds.center(),
            radius2: emitter.bounds.size().length_squared() * (0.25 + f32::EPSILON),
            axis: emitter.axis.as_vec3(),
            intensity: emitter.intensity as f32,
            full: [cos as f32, sin as f32],
            cos_fade: cos_fade.max(0.0) as f32,
        }
    }

    /// Roughly the irradiance that it brings, unoccluded: intensity times both cosines over squared distance, of the
    /// most favourable place in the ball; 0 only where it brings nothing. The squared distance is at least that of
    /// the ball's radius and `nearest2`.
    #[inline]
    pub(super) fn importance(&self, from: &Receiver, nearest2: f32) -> f32 {
        let towards = self.center - from.p;
        let d2 = towards.length_squared();
        let far = self.intensity / d2.max(self.radius2).max(nearest2);
        if d2 <= self.radius2 {
            return far;
        }
        let inverse = 1.0 / d2.sqrt();
        let sin2 = self.radius2 / d2;
        let ball = [(1.0 - sin2).max(0.0).sqrt(), sin2.sqrt()];
        let off_axis = less_angle(angle(-towards.dot(self.axis) * inverse), self.full);
        let out = less_angle(off_axis, ball)[0];
        if out < self.cos_fade || out <= 0.0 {
            return 0.0;
        }
        let received = if from.n == Vec3::ZERO {
            1.0
        } else {
            less_angle(angle(towards.dot(from.n) * inverse), ball)[0].max(0.0)
        };
        far * out * received
    }
}

/// Cosine and sine of the angle with a cosine.
#[inline]
fn angle(cos: f32) -> [f32; 2] {
    [cos, (1.0 - cos * cos).max(0.0).sqrt()]
}

/// Cosine and sine of max(0, a − b), for angles from 0 to π given by cosine and sine.
#[inline]
fn less_angle(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    if a[0] >= b[0] { [1.0, 0.0] } else { [a[0] * b[0] + a[1] * b[1], a[1] * b[0] - a[0] * b[1]] }
}
