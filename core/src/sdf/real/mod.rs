//! Owns the numbers that distance functions are evaluated in: one definition of every node serves them all.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::Vec3;

mod dual;
mod lanes;
mod scalar;

pub(super) use dual::Dual;

/// A number that a distance function can be evaluated in.
///
/// Implementations may hold several lanes, derivatives or an interval, so nodes never branch on a value: they
/// compare with [`Real::less`] and choose with [`Real::select`], both lane by lane.
pub trait Real:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The answer of a comparison, one per lane.
    type Mask: Copy;

    /// The same constant in every lane.
    fn splat(value: f32) -> Self;
    /// Square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Magnitude.
    #[must_use]
    fn abs(self) -> Self;
    /// The lesser of two numbers.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// The greater of two numbers.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// Natural logarithm.
    #[must_use]
    fn ln(self) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// Arc cosine in radians, of a number in [-1, 1].
    #[must_use]
    fn acos(self) -> Self;
    /// Angle of the vector (x, self) in radians, in [-pi, pi].
    #[must_use]
    fn atan2(self, x: Self) -> Self;
    /// Power with a constant exponent, of a number that is not negative.
    #[must_use]
    fn powf(self, exponent: f32) -> Self;
    /// Greatest whole number that is not above.
    #[must_use]
    fn floor(self) -> Self;
    /// An octave of gradient noise at a place measured in cells; `key` is that of the octave.
    #[must_use]
    fn gradient_noise(place: Point<Self>, key: u32) -> Self;
    /// Lane by lane `self < other`.
    fn less(self, other: Self) -> Self::Mask;
    /// Lane by lane `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// True when the mask holds in at least one lane.
    fn any(mask: Self::Mask) -> bool;
}

/// A [`Real`] whose comparisons can be combined.
pub(super) trait Logic: Real {
    /// Where both hold.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Where at least one holds.
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Where it does not hold.
    fn not(a: Self::Mask) -> Self::Mask;
    /// Where this is no number.
    fn is_nan(self) -> Self::Mask;
}

/// A [`Real`] that can be asked for the gradients in the corners of a lattice.
pub(super) trait Lattice: Real {
    /// What the corners of a cell have in common.
    type Cell: Copy;

    /// The cell with the given whole numbers, of magnitude 2²³ or less; `key` is that of the octave.
    fn cell(corner: Point<Self>, key: u32) -> Self::Cell;
    /// The gradient in the corner of a cell that is `step` away from its lowest, times the way from that corner.
    fn corner(cell: Self::Cell, step: [u32; 3], way: Point<Self>) -> Self;
}

/// A point or vector of any [`Real`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point<R> {
    /// First coordinate.
    pub x: R,
    /// Second coordinate.
    pub y: R,
    /// Third coordinate.
    pub z: R,
}

impl<R: Real> Point<R> {
    /// A point from its coordinates.
    #[inline]
    pub fn new(x: R, y: R, z: R) -> Self {
        Self { x, y, z }
    }

    /// The same point in every lane.
    #[inline]
    pub fn splat(p: Vec3) -> Self {
        Self::new(R::splat(p.x), R::splat(p.y), R::splat(p.z))
    }

    /// Squared distance from the origin.
    #[inline]
    pub fn length_squared(self) -> R {
        self.x * self.x + self.y * self.y + self.z * self.z
    }

    /// Distance from the origin.
    #[inline]
    pub fn length(self) -> R {
        self.length_squared().sqrt()
    }
}
