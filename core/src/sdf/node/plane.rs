//! Owns the half-space.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `plane`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::real::{Point, Real};

/// Everything below the plane `y = 0`: `f(p) = p.y`.
///
/// The exact distance; it has no end, so that something else must bound the object.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Plane;

impl Plane {
    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(p: Point<R>) -> R {
        p.y
    }

    /// The piece of a line below.
    #[inline]
    pub(in crate::sdf) fn span(line: &Line) -> Option<Span> {
        let slope = line.dir.y;
        if slope == 0.0 {
            return (line.foot.y <= 0.0).then_some(Span::WHOLE);
        }
        let at = -line.foot.y / slope;
        Some(if slope > 0.0 { Span { end: at, ..Span::WHOLE } } else { Span { start: at, ..Span::WHOLE } })
    }

    pub(in crate::sdf) fn bounds() -> Aabb {
        Aabb { min: Vec3::NEG_INFINITY, max: Vec3::new(f32::INFINITY, 0.0, f32::INFINITY) }
    }
}
