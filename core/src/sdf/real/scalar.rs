//! Owns single numbers: f32, with the elementary functions of the lanes, and f64 for what must be more exact.

use wide::f32x8;

use super::{Lattice, Logic, Point, Real};
use crate::sdf::noise;

/// What both kinds of numbers have in common.
macro_rules! plain {
    () => {
        type Mask = bool;

        #[inline]
        fn sqrt(self) -> Self {
            self.sqrt()
        }
        #[inline]
        fn abs(self) -> Self {
            self.abs()
        }
        // As the processor's vectors do it: the second of two numbers that cannot be compared.
        #[inline]
        fn min(self, other: Self) -> Self {
            if other < self { other } else { self }
        }
        #[inline]
        fn max(self, other: Self) -> Self {
            if other > self { other } else { self }
        }
        #[inline]
        fn floor(self) -> Self {
            self.floor()
        }
        #[inline]
        fn gradient_noise(place: Point<Self>, key: u32) -> Self {
            noise::gradient_noise(place, key)
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
    };
}

impl Logic for f32 {
    #[inline]
    fn both(a: bool, b: bool) -> bool {
        a & b
    }
    #[inline]
    fn either(a: bool, b: bool) -> bool {
        a | b
    }
    #[inline]
    fn not(a: bool) -> bool {
        !a
    }
    #[inline]
    fn is_nan(self) -> bool {
        self.is_nan()
    }
}

macro_rules! lattice {
    ($number:ty) => {
        impl Lattice for $number {
            type Cell = [u32; 3];

            #[inline]
            fn cell(corner: Point<Self>, key: u32) -> [u32; 3] {
                let [x, y, z] = [corner.x, corner.y, corner.z].map(|at| (at as i32).cast_unsigned());
                let [a, b, c] = noise::STRIDES;
                [x.wrapping_mul(a).wrapping_add(key), y.wrapping_mul(b), z.wrapping_mul(c)]
            }
            #[inline]
            fn corner(cell: [u32; 3], step: [u32; 3], way: Point<Self>) -> Self {
                noise::edge(noise::hash(cell, step), way)
            }
        }
    };
}

lattice!(f32);
lattice!(f64);

/// A function of all lanes for one number: bit for bit what a lane gives.
#[inline]
fn lane(f: impl FnOnce(f32x8) -> f32x8, x: f32) -> f32 {
    f(f32x8::splat(x)).to_array()[0]
}

impl Real for f32 {
    plain!();

    #[inline]
    fn splat(value: f32) -> Self {
        value
    }
    #[inline]
    fn ln(self) -> Self {
        lane(<f32x8 as Real>::ln, self)
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = <f32x8 as Real>::sin_cos(f32x8::splat(self));
        (sine.to_array()[0], cosine.to_array()[0])
    }
    #[inline]
    fn acos(self) -> Self {
        lane(<f32x8 as Real>::acos, self)
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        lane(|y| Real::atan2(y, f32x8::splat(x)), self)
    }
    #[inline]
    fn powf(self, exponent: f32) -> Self {
        lane(|x| Real::powf(x, exponent), self)
    }
}

impl Real for f64 {
    plain!();

    #[inline]
    fn splat(value: f32) -> Self {
        Self::from(value)
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
}
