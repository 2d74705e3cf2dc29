//! Owns the capsule along the y axis.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `capsule`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Everything within `r` of a piece of the y axis: `f(p) = |p - (0, clamp(p.y, -h, h), 0)| - r`.
///
/// The distance to a set less a constant: exact outside, bound 1.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Capsule {
    radius: f32,
    half: f32,
}

impl Capsule {
    /// A capsule of a radius around a line of a full length; its ends are half balls beyond the line's.
    pub(in crate::sdf) fn new(radius: f32, height: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&radius), "capsule.radius", radius, A_LENGTH)?;
        let allowed = "0 or a number from 1e-12 to 1e12";
        require(height == 0.0 || LENGTHS.contains(&height), "capsule.height", height, allowed)?;
        Ok(Self { radius, half: 0.5 * height })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        // Beyond an end this is what is left of |y|, elsewhere 0.
        let along = (p.y.abs() - R::splat(self.half)).max(R::splat(0.0));
        Point::new(p.x, along, p.z).length() - R::splat(self.radius)
    }

    /// The piece of a line in the cylinder or in either ball: they are one convex solid.
    #[inline]
    pub(in crate::sdf) fn span(self, line: &Line) -> Option<Span> {
        let (radius, half) = (f64::from(self.radius), f64::from(self.half));
        let tube = line.in_tube(radius)?;
        let side = line.between_caps(half).and_then(|caps| caps.common(tube));
        [side, line.in_ball(half, radius), line.in_ball(-half, radius)]
            .into_iter()
            .flatten()
            .reduce(Span::hull)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        let corner = Vec3::new(self.radius, self.half + self.radius, self.radius);
        Aabb { min: -corner, max: corner }
    }
}
