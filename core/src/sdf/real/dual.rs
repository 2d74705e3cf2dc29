//! Owns numbers that know how they change with the place: forward derivatives, exact where a function has them.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::DVec3;

use super::{Lattice, Point, Real};
use crate::sdf::noise;

/// A value and its gradient: a dual number with three parts.
///
/// Where a function has a kink, the gradient is that of one of its sides; where a slope is infinite, it is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::sdf) struct Dual {
    pub(in crate::sdf) value: f64,
    pub(in crate::sdf) gradient: DVec3,
}

impl Dual {
    /// The place itself: every coordinate changes with itself.
    pub(in crate::sdf) fn place(p: DVec3) -> Point<Self> {
        let [x, y, z] = std::array::from_fn(|axis| Self { value: p[axis], gradient: DVec3::AXES[axis] });
        Point::new(x, y, z)
    }

    fn constant(value: f64) -> Self {
        Self { value, gradient: DVec3::ZERO }
    }

    /// A function of this number, by its value and its derivative there.
    fn chain(self, value: f64, derivative: f64) -> Self {
        let gradient = if derivative.is_finite() { self.gradient * derivative } else { DVec3::ZERO };
        Self { value, gradient }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, gradient: self.gradient + other.gradient }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, gradient: self.gradient - other.gradient }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let gradient = self.gradient * other.value + other.gradient * self.value;
        Self { value: self.value * other.value, gradient }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, gradient: (self.gradient - other.gradient * value) / other.value }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, gradient: -self.gradient }
    }
}

impl Real for Dual {
    type Mask = bool;

    fn splat(value: f32) -> Self {
        Self::constant(f64::from(value))
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root)
    }
    fn abs(self) -> Self {
        self.chain(self.value.abs(), 1.0_f64.copysign(self.value))
    }
    fn min(self, other: Self) -> Self {
        if other.value < self.value { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if other.value > self.value { other } else { self }
    }
    fn ln(self) -> Self {
        self.chain(libm::log(self.value), 1.0 / self.value)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = libm::sincos(self.value);
        (self.chain(sine, cosine), self.chain(cosine, -sine))
    }
    fn acos(self) -> Self {
        self.chain(libm::acos(self.value), -1.0 / (1.0 - self.value * self.value).sqrt())
    }
    fn atan2(self, x: Self) -> Self {
        let square = self.value * self.value + x.value * x.value;
        let gradient = (self.gradient * x.value - x.gradient * self.value) / square;
        let gradient = if square > 0.0 { gradient } else { DVec3::ZERO };
        Self { value: libm::atan2(self.value, x.value), gradient }
    }
    fn powf(self, exponent: f32) -> Self {
        let exponent = f64::from(exponent);
        self.chain(libm::pow(self.value, exponent), exponent * libm::pow(self.value, exponent - 1.0))
    }
    fn floor(self) -> Self {
        Self::constant(self.value.floor())
    }
    fn gradient_noise(place: Point<Self>, key: u32) -> Self {
        noise::gradient_noise(place, key)
    }
    fn less(self, other: Self) -> bool {
        self.value < other.value
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    fn any(mask: bool) -> bool {
        mask
    }
}

impl Lattice for Dual {
    type Cell = <f64 as Lattice>::Cell;

    fn cell(corner: Point<Self>, key: u32) -> Self::Cell {
        f64::cell(Point::new(corner.x.value, corner.y.value, corner.z.value), key)
    }
    fn corner(cell: Self::Cell, step: [u32; 3], way: Point<Self>) -> Self {
        noise::edge(noise::hash(cell, step), way)
    }
}
