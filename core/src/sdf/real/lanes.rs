//! Owns eight numbers at a time. A lane never sees its neighbours: its bits are those of the number alone.

use wide::{bytemuck, f32x8, i32x8, u32x8};

use super::{Lattice, Logic, Point, Real};
use crate::sdf::noise;

impl Real for f32x8 {
    type Mask = Self;

    #[inline]
    fn splat(value: f32) -> Self {
        Self::splat(value)
    }
    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }
    // The processor gives the second of two numbers that cannot be compared.
    #[inline]
    fn min(self, other: Self) -> Self {
        other.fast_min(self)
    }
    #[inline]
    fn max(self, other: Self) -> Self {
        other.fast_max(self)
    }
    #[inline]
    fn ln(self) -> Self {
        self.ln()
    }
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        self.sin_cos()
    }
    #[inline]
    fn acos(self) -> Self {
        self.acos()
    }
    #[inline]
    fn atan2(self, x: Self) -> Self {
        self.atan2(x)
    }
    #[inline]
    fn powf(self, exponent: f32) -> Self {
        self.powf_simd(Self::splat(exponent))
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
    fn less(self, other: Self) -> Self {
        self.simd_lt(other)
    }
    #[inline]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        mask.select(yes, no)
    }
    #[inline]
    fn any(mask: Self) -> bool {
        mask.any()
    }
}

impl Logic for f32x8 {
    #[inline]
    fn both(a: Self, b: Self) -> Self {
        a & b
    }
    #[inline]
    fn either(a: Self, b: Self) -> Self {
        a | b
    }
    #[inline]
    fn not(a: Self) -> Self {
        !a
    }
    #[inline]
    fn is_nan(self) -> Self {
        self.is_nan()
    }
}

/// [`noise::STRIDES`] in every lane. A constant: made on the spot, compilers put it together on the stack.
const STRIDE: [u32x8; 3] =
    [u32x8::splat(noise::STRIDES[0]), u32x8::splat(noise::STRIDES[1]), u32x8::splat(noise::STRIDES[2])];

/// [`noise::FACTORS`] in every lane.
const FACTOR: [u32x8; 2] = [u32x8::splat(noise::FACTORS[0]), u32x8::splat(noise::FACTORS[1])];

impl Lattice for f32x8 {
    type Cell = [u32x8; 3];

    #[inline]
    fn cell(corner: Point<Self>, key: u32) -> [u32x8; 3] {
        let [x, y, z] =
            [corner.x, corner.y, corner.z].map(|at| bytemuck::cast::<i32x8, u32x8>(at.trunc_int()));
        [x * STRIDE[0] + u32x8::splat(key), y * STRIDE[1], z * STRIDE[2]]
    }

    #[inline]
    fn corner(cell: [u32x8; 3], step: [u32; 3], way: Point<Self>) -> Self {
        let at = |axis: usize| if step[axis] == 0 { cell[axis] } else { cell[axis] + STRIDE[axis] };
        edge(mix(at(0) ^ at(1) ^ at(2)), way)
    }
}

/// [`noise::mix`] of every lane.
#[inline]
fn mix(bits: u32x8) -> u32x8 {
    let bits = (bits ^ (bits >> 16)) * FACTOR[0];
    let bits = (bits ^ (bits >> 15)) * FACTOR[1];
    bits ^ (bits >> 15)
}

/// [`noise::edge`] of every lane.
#[inline]
fn edge(bits: u32x8, way: Point<f32x8>) -> f32x8 {
    let signed: i32x8 = bytemuck::cast(bits);
    let (no_x, no_z) =
        (signed.simd_lt(i32x8::splat(-noise::THIRD)), signed.simd_gt(i32x8::splat(noise::THIRD)));
    let first = bytemuck::cast::<i32x8, f32x8>(no_x).select(way.y, way.x);
    let second = bytemuck::cast::<i32x8, f32x8>(no_z).select(way.y, way.z);
    let sign = u32x8::splat(1 << 31);
    let (first_sign, second_sign) = (bits << 31, (bits << 30) & sign);
    (first ^ bytemuck::cast::<u32x8, f32x8>(first_sign))
        + (second ^ bytemuck::cast::<u32x8, f32x8>(second_sign))
}
