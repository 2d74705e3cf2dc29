//! Owns the two ways of winding a child: twist and bend.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `twist`, `bend`, made by `scenes/sdf/`.

use glam::Vec3Swizzles as _;

use crate::math::Aabb;
use crate::sdf::error::{SdfError, require};
use crate::sdf::real::{Point, Real};

/// What a place is turned around, and what it is turned by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sdf) enum Axis {
    /// Around the y axis, in proportion to y: a screw.
    Twist,
    /// Around the z axis, in proportion to x: a bow.
    Bend,
}

/// A child whose space is turned around an axis by `rate` times a coordinate.
///
/// The turn keeps the distance `r` from the axis and the coordinate along it. A turn in proportion to the coordinate
/// along the axis stretches lengths by up to `L(r) = k + √(1 + k²)` with `k = rate r / 2` (the greatest singular value of
/// a shear by `rate r`); one in proportion to a coordinate across it by up to `L(r) = 1 + rate r`. With the child within
/// `r0` of the axis and between two planes across it, `r1 = 5/4 r0` and `v = child / L(r1)`, the value is
/// `max(r - r0, planes, min(v, r1 - r0))` where `r < r1` and `max(r - r0, planes)` beyond: every part has the bound 1
/// where it is used, the two meet where `r = r1`, and the sign is the child's.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Winding {
    axis: Axis,
    /// Radians per unit of length.
    rate: f32,
    /// Radius around the axis that holds the child.
    radius: f32,
    /// Planes that the child is between.
    low: f32,
    high: f32,
    /// One over how much lengths are stretched.
    per_stretch: f32,
}

/// Where the child itself is no longer looked at, in units of the radius that holds it.
const OUTER: f32 = 1.25;

impl Winding {
    /// A turn by `degrees` per unit of length.
    pub(in crate::sdf) fn new(axis: Axis, degrees: f32) -> Result<Self, SdfError> {
        let name = match axis {
            Axis::Twist => "twist.degrees",
            Axis::Bend => "bend.degrees",
        };
        require(degrees.abs() <= 1e6, name, degrees, "a number from -1e6 to 1e6")?;
        let rate = f64::from(degrees).to_radians() as f32;
        Ok(Self { axis, rate, radius: 0.0, low: 0.0, high: 0.0, per_stretch: 1.0 })
    }

    /// The same around a child of these bounds, which must have an end.
    pub(in crate::sdf) fn around(self, hull: Aabb) -> Result<Self, SdfError> {
        if hull.is_empty() {
            return Ok(self);
        }
        if !hull.is_finite() {
            return Err(SdfError::Endless);
        }
        let farthest = hull.max.max(-hull.min);
        let (radius, low, high) = match self.axis {
            Axis::Twist => (farthest.xz().length(), hull.min.y, hull.max.y),
            Axis::Bend => (farthest.xy().length(), hull.min.z, hull.max.z),
        };
        let turn = f64::from(self.rate.abs()) * f64::from(radius * OUTER);
        let stretch = match self.axis {
            Axis::Twist => 0.5 * turn + (1.0 + 0.25 * turn * turn).sqrt(),
            Axis::Bend => 1.0 + turn,
        };
        Ok(Self { radius, low, high, per_stretch: (1.0 / stretch) as f32, ..self })
    }

    /// A place in the child's space.
    #[inline]
    pub(in crate::sdf) fn enter<R: Real>(&self, p: Point<R>) -> Point<R> {
        let rate = R::splat(self.rate);
        match self.axis {
            Axis::Twist => {
                let (sin, cos) = (rate * p.y).sin_cos();
                Point::new(cos * p.x - sin * p.z, p.y, sin * p.x + cos * p.z)
            }
            Axis::Bend => {
                let (sin, cos) = (rate * p.x).sin_cos();
                Point::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z)
            }
        }
    }

    /// The value at `p` from the child's value at the place in its space.
    #[inline]
    pub(in crate::sdf) fn leave<R: Real>(&self, value: R, p: Point<R>) -> R {
        let (a, b, along) = match self.axis {
            Axis::Twist => (p.x, p.z, p.y),
            Axis::Bend => (p.x, p.y, p.z),
        };
        let across = (a * a + b * b).sqrt();
        let planes = (R::splat(self.low) - along).max(along - R::splat(self.high));
        let hull = planes.max(across - R::splat(self.radius));
        let inner = (value * R::splat(self.per_stretch)).min(R::splat((OUTER - 1.0) * self.radius));
        R::select(across.less(R::splat(OUTER * self.radius)), hull.max(inner), hull)
    }

    /// A box around all places where the value is at most `margin`.
    pub(in crate::sdf) fn bounds(&self, margin: f32) -> Aabb {
        let radius = self.radius;
        let (min, max) = match self.axis {
            Axis::Twist => ([-radius, self.low, -radius], [radius, self.high, radius]),
            Axis::Bend => ([-radius, -radius, self.low], [radius, radius, self.high]),
        };
        Aabb { min: min.into(), max: max.into() }.grown(margin)
    }
}
