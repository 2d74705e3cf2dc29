//! Owns what makes one object of two.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `union`, `intersection`, `difference`, made by `scenes/sdf/`.

use super::Blend;
use crate::math::Aabb;
use crate::sdf::real::Real;

/// How two objects become one. The minimum and the maximum of two functions with bound `L` have bound `L`, and so have
/// their smooth forms; outside of the result the value is a lower bound of the distance.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) enum Operator {
    /// What is in either: `min(a, b)`.
    Union,
    /// What is in both: `max(a, b)`.
    Intersection,
    /// What is in the first and not in the second: `max(a, -b)`.
    Difference,
    /// A union with its seam filled.
    SmoothUnion(Blend),
    /// An intersection with its edge rounded off.
    SmoothIntersection(Blend),
    /// A difference with its edge rounded off.
    SmoothDifference(Blend),
}

impl Operator {
    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, a: R, b: R) -> R {
        match self {
            Self::Union => a.min(b),
            Self::Intersection => a.max(b),
            Self::Difference => a.max(-b),
            Self::SmoothUnion(blend) => blend.min(a, b),
            Self::SmoothIntersection(blend) => blend.max(a, b),
            Self::SmoothDifference(blend) => blend.max(a, -b),
        }
    }

    /// Operands that are at least this far apart do not change each other.
    pub(in crate::sdf) fn width(self) -> f64 {
        match self {
            Self::Union | Self::Intersection | Self::Difference => 0.0,
            Self::SmoothUnion(blend) | Self::SmoothIntersection(blend) | Self::SmoothDifference(blend) => {
                f64::from(blend.width())
            }
        }
    }

    /// Whether the result is what the operands are at every place: in or out, without a blend.
    pub(in crate::sdf) fn is_hard(self) -> bool {
        matches!(self, Self::Union | Self::Intersection | Self::Difference)
    }

    /// Whether a place is in the result, from whether it is in the operands; blends are left out.
    #[inline]
    pub(in crate::sdf) fn holds(self, a: bool, b: bool) -> bool {
        match self {
            Self::Union | Self::SmoothUnion(_) => a || b,
            Self::Intersection | Self::SmoothIntersection(_) => a && b,
            Self::Difference | Self::SmoothDifference(_) => a && !b,
        }
    }

    /// Values of the operands up to which they matter for values of the result up to `margin`: where the result is at
    /// most `margin`, one operand of a union, and both of an intersection, are at most this.
    pub(in crate::sdf) fn margin(self, margin: f32) -> f32 {
        match self {
            Self::SmoothUnion(blend) => margin + blend.depth(),
            Self::Union
            | Self::Intersection
            | Self::Difference
            | Self::SmoothIntersection(_)
            | Self::SmoothDifference(_) => margin,
        }
    }

    /// A box around the result's values up to a margin, from boxes around the operands' values up to
    /// [`Operator::margin`].
    pub(in crate::sdf) fn bounds(self, a: Aabb, b: Aabb) -> Aabb {
        match self {
            Self::Union | Self::SmoothUnion(_) => a.union(b),
            Self::Intersection | Self::SmoothIntersection(_) => a.intersection(b),
            Self::Difference | Self::SmoothDifference(_) => a,
        }
    }
}
