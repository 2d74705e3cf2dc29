//! Owns the cylinder around the y axis.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `cylinder`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Cylinder around the y axis with flat ends: a rectangle of half sides `(r, h)` in the half-plane of
/// `q = (hypot(p.x, p.z), |p.y|) - (r, h)`, `f(p) = |max(q, 0)| + min(max(q.x, q.y), 0)`.
///
/// The distance to a solid of revolution is the distance to its profile, which is exact here; bound 1.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Cylinder {
    radius: f32,
    half: f32,
}

impl Cylinder {
    /// A cylinder of a radius and a full height.
    pub(in crate::sdf) fn new(radius: f32, height: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&radius), "cylinder.radius", radius, A_LENGTH)?;
        require(LENGTHS.contains(&height), "cylinder.height", height, A_LENGTH)?;
        Ok(Self { radius, half: 0.5 * height })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let zero = R::splat(0.0);
        let across = (p.x * p.x + p.z * p.z).sqrt() - R::splat(self.radius);
        let along = p.y.abs() - R::splat(self.half);
        let (a, b) = (across.max(zero), along.max(zero));
        (a * a + b * b).sqrt() + across.max(along).min(zero)
    }

    /// The piece of a line in the endless cylinder and between the ends.
    #[inline]
    pub(in crate::sdf) fn span(self, line: &Line) -> Option<Span> {
        line.between_caps(f64::from(self.half))?.common(line.in_tube(f64::from(self.radius))?)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        let corner = Vec3::new(self.radius, self.half, self.radius);
        Aabb { min: -corner, max: corner }
    }
}
