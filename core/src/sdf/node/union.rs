//! Owns the hard union.

use crate::math::Aabb;
use crate::sdf::real::Real;

/// Union of two objects: `f = min(a, b)`.
///
/// The minimum of two functions with bound `L` has bound `L`. Outside, the value is the exact distance when both are
/// exact; inside, it is a lower bound of the distance to the surface.
#[inline]
pub(in crate::sdf) fn distance<R: Real>(a: R, b: R) -> R {
    a.min(b)
}

/// The hull of both boxes: outside it both values, hence their minimum, are at least the distance to it.
pub(in crate::sdf) fn bounds(a: Aabb, b: Aabb) -> Aabb {
    a.union(b)
}
