//! Owns the ball around the origin.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `sphere`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Ball of a given radius: `f(p) = |p| - r`.
///
/// Lipschitz bound 1 by the reverse triangle inequality, `| |p| - |q| | <= |p - q|`; the distance is exact on both
/// sides.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Sphere {
    radius: f32,
}

impl Sphere {
    pub(in crate::sdf) fn new(radius: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&radius), "sphere.radius", radius, A_LENGTH)?;
        Ok(Self { radius })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        p.length() - R::splat(self.radius)
    }

    /// The piece of a line inside.
    #[inline]
    pub(in crate::sdf) fn span(self, line: &Line) -> Option<Span> {
        line.in_ball(0.0, f64::from(self.radius))
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        Aabb { min: Vec3::splat(-self.radius), max: Vec3::splat(self.radius) }
    }
}
