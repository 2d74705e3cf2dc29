//! Owns the numbers that distance functions are evaluated in: one definition of every node serves them all.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::Vec3;

use super::noise;

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
    /// The gradient of noise in a corner of the lattice: whole numbers plus `step`; `key` is that of the octave.
    fn lattice_gradient(cell: Point<Self>, step: [u32; 3], key: u32) -> Point<Self>;
    /// An octave of gradient noise at a place measured in cells; `key` is that of the octave.
    #[must_use]
    #[inline]
    fn gradient_noise(place: Point<Self>, key: u32) -> Self {
        noise::gradient_noise(place, key)
    }
    /// Lane by lane `self < other`.
    fn less(self, other: Self) -> Self::Mask;
    /// Lane by lane `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// True when the mask holds in at least one lane.
    fn any(mask: Self::Mask) -> bool;
}

impl Real for f32 {
    type Mask = bool;

    #[inline]
    fn splat(value: f32) -> Self {
        value
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
    #[inline]
    fn ln(self) -> Self {
        libm::logf(self)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        libm::sincosf(self)
    }
    #[inline]
    fn acos(self) -> Self {
        libm::acosf(self)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        libm::atan2f(self, x)
    }
    #[inline]
    fn powf(self, exponent: f32) -> Self {
        libm::powf(self, exponent)
    }
    #[inline]
    fn floor(self) -> Self {
        self.floor()
    }
    #[inline]
    fn lattice_gradient(cell: Point<Self>, step: [u32; 3], key: u32) -> Point<Self> {
        let [x, y, z] = [cell.x as i32, cell.y as i32, cell.z as i32];
        let [right, up, near] = step.map(u32::cast_signed);
        let (x, y, z) = (x.wrapping_add(right), y.wrapping_add(up), z.wrapping_add(near));
        Point::splat(Vec3::from_array(noise::gradient(x, y, z, key)))
    }
    #[inline]
    fn less(self, other: Self) -> bool {
        self < other
    }
    #[inline]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline]
    fn any(mask: bool) -> bool {
        mask
    }
}

impl Real for f64 {
    type Mask = bool;

    #[inline]
    fn splat(value: f32) -> Self {
        Self::from(value)
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
    #[inline]
    fn ln(self) -> Self {
        libm::log(self)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        libm::sincos(self)
    }
    #[inline]
    fn acos(self) -> Self {
        libm::acos(self)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
    #[inline]
    fn powf(self, exponent: f32) -> Self {
        libm::pow(self, Self::from(exponent))
    }
    #[inline]
    fn floor(self) -> Self {
        self.floor()
    }
    #[inline]
    fn lattice_gradient(cell: Point<Self>, step: [u32; 3], key: u32) -> Point<Self> {
        let [x, y, z] = [cell.x as i32, cell.y as i32, cell.z as i32];
        let [right, up, near] = step.map(u32::cast_signed);
        let (x, y, z) = (x.wrapping_add(right), y.wrapping_add(up), z.wrapping_add(near));
        Point::splat(Vec3::from_array(noise::gradient(x, y, z, key)))
    }
    #[inline]
    fn less(self, other: Self) -> bool {
        self < other
    }
    #[inline]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline]
    fn any(mask: bool) -> bool {
        mask
    }
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
