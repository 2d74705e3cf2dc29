//! Owns the set of ways to give a child a space of its own.

use super::transform::Placement;
use super::{Repetition, Winding};
use crate::math::Aabb;
use crate::sdf::error::SdfError;
use crate::sdf::real::{Point, Real};

/// How a child's space lies in its parent's.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) enum Space {
    /// Moved, turned and scaled.
    Placement(Placement),
    /// Folded, so that the child is there many times.
    Repetition(Repetition),
    /// Turned about an axis by more and more.
    Winding(Winding),
}

impl Space {
    /// A place of the parent in the child's space.
    #[inline]
    pub(in crate::sdf) fn enter<R: Real>(&self, p: Point<R>) -> Point<R> {
        match self {
            Self::Placement(space) => space.enter(p),
            Self::Repetition(space) => space.enter(p),
            Self::Winding(space) => space.enter(p),
        }
    }

    /// The value at the place `p` of the parent from the child's value.
    #[inline]
    pub(in crate::sdf) fn leave<R: Real>(&self, value: R, p: Point<R>) -> R {
        match self {
            Self::Placement(space) => value * R::splat(space.scale),
            Self::Repetition(space) => space.leave(value, p),
            Self::Winding(space) => space.leave(value, p),
        }
    }

    /// The same, made for a child whose values up to what [`Space::margin`] asks for are in `hull`.
    pub(in crate::sdf) fn around(self, hull: Aabb) -> Result<Self, SdfError> {
        Ok(match self {
            Self::Placement(space) => Self::Placement(space),
            Self::Repetition(space) => Self::Repetition(space.around(hull)?),
            Self::Winding(space) => Self::Winding(space.around(hull)?),
        })
    }

    /// Values of the child up to which it matters for values up to `margin` here.
    pub(in crate::sdf) fn margin(&self, margin: f32) -> f32 {
        match self {
            Self::Placement(space) => margin / space.scale,
            // What these make of a child is at least the distance to where it is.
            Self::Repetition(_) | Self::Winding(_) => 0.0,
        }
    }

    /// A box around all places where the value is at most `margin`, from that of the child.
    pub(in crate::sdf) fn bounds(&self, hull: Aabb, margin: f32) -> Aabb {
        match self {
            Self::Placement(space) => space.bounds(hull),
            _ if hull.is_empty() => Aabb::EMPTY,
            Self::Repetition(space) => space.bounds(margin),
            Self::Winding(space) => space.bounds(margin),
        }
    }

    /// Size of a unit of the child, in units of the parent.
    pub(in crate::sdf) fn scale(&self) -> f32 {
        match self {
            Self::Placement(space) => space.scale,
            Self::Repetition(_) | Self::Winding(_) => 1.0,
        }
    }

    /// Largest number that entering it subtracts besides the coordinates.
    pub(in crate::sdf) fn reach(&self) -> f32 {
        match self {
            Self::Placement(space) => space.reach(),
            Self::Repetition(space) => space.reach(),
            Self::Winding(_) => 0.0,
        }
    }
}
