//! Owns the axis-aligned box around the origin.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `box`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::error::{LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Box with half edges `h`: `q = |p| - h`, `f(p) = |max(q, 0)| + min(max(q.x, q.y, q.z), 0)`.
///
/// Outside, `max(q, 0)` is the vector from the nearest point of the box (folded into one octant), so `f` is its
/// exact length; inside, the nearest face is `max q` away. An exact signed distance has Lipschitz bound 1.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Cuboid {
    half: Vec3,
}

impl Cuboid {
    /// A box with the given full edge lengths.
    pub(in crate::sdf) fn new(size: Vec3) -> Result<Self, SdfError> {
        Self::check(size, "box.size")?;
        Ok(Self::from_half(size * 0.5))
    }

    /// Whether a box can have these edges.
    pub(super) fn check(size: Vec3, name: &'static str) -> Result<(), SdfError> {
        let allowed = "three numbers greater than 0 (1e-12 to 1e12)";
        size.to_array().into_iter().try_for_each(|edge| require(LENGTHS.contains(&edge), name, edge, allowed))
    }

    /// A box with the given half edges, which are not negative.
    pub(in crate::sdf) fn from_half(half: Vec3) -> Self {
        Self { half }
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let zero = R::splat(0.0);
        let x = p.x.abs() - R::splat(self.half.x);
        let y = p.y.abs() - R::splat(self.half.y);
        let z = p.z.abs() - R::splat(self.half.z);
        let outside = Point::new(x.max(zero), y.max(zero), z.max(zero)).length();
        outside + x.max(y).max(z).min(zero)
    }

    /// The piece of a line between all three pairs of faces.
    #[inline]
    pub(in crate::sdf) fn span(self, line: &Line) -> Option<Span> {
        let half = self.half.as_dvec3();
        let x = Span::slab(line.foot.x, line.dir.x, half.x)?;
        let y = Span::slab(line.foot.y, line.dir.y, half.y)?;
        let z = Span::slab(line.foot.z, line.dir.z, half.z)?;
        x.common(y)?.common(z)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        Aabb { min: -self.half, max: self.half }
    }
}
