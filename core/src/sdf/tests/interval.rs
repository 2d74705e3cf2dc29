//! Owns intervals with outward rounding: a [`Real`] whose answers hold for every place of a box, proven.

use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::sdf::noise;
use crate::sdf::real::{Point, Real};

/// All numbers from `low` to `high`. Every operation gives a range that holds every result that numbers of its operands
/// can have: ends are moved out by one unit in the last place, and by four for functions of libm, which are within one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub(super) low: f64,
    pub(super) high: f64,
}

/// What a comparison of intervals can say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Answer {
    Yes,
    No,
    Either,
}

impl Interval {
    const ALL: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    pub(super) fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    fn out(low: f64, high: f64) -> Self {
        if low.is_nan() || high.is_nan() {
            Self::ALL
        } else {
            Self { low: low.next_down(), high: high.next_up() }
        }
    }

    /// Of a function of libm that rises.
    fn rising(self, f: impl Fn(f64) -> f64) -> Self {
        let wide = (0..3).fold(Self::out(f(self.low), f(self.high)), |i, _| Self::out(i.low, i.high));
        Self { low: wide.low, high: wide.high }
    }

    /// The cosine, by where its extremes are: at multiples of π, where the error of π is far below what is added.
    fn cosine(self) -> Self {
        if self.high - self.low >= 2.0 * PI || !self.low.is_finite() || !self.high.is_finite() {
            return Self::new(-1.0, 1.0);
        }
        let (a, b) = (libm::cos(self.low), libm::cos(self.high));
        let mut found = Self::new(a.min(b) - 1e-15, a.max(b) + 1e-15);
        let (first, last) = ((self.low / PI - 1e-12).ceil(), (self.high / PI + 1e-12).floor());
        let mut k = first;
        while k <= last {
            if k.rem_euclid(2.0) == 0.0 {
                found.high = 1.0;
            } else {
                found.low = -1.0;
            }
            k += 1.0;
        }
        found
    }

    fn hull(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::out(self.low + other.low, self.high + other.high)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::out(self.low - other.high, self.high - other.low)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let products =
            [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        if products.iter().any(|p| p.is_nan()) {
            return Self::ALL;
        }
        Self::out(
            products.into_iter().fold(f64::INFINITY, f64::min),
            products.into_iter().fold(f64::NEG_INFINITY, f64::max),
        )
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        if other.low <= 0.0 && other.high >= 0.0 {
            return Self::ALL;
        }
        self * Self::out(1.0 / other.high, 1.0 / other.low)
    }
}

impl Real for Interval {
    type Mask = Answer;

    fn splat(value: f32) -> Self {
        Self { low: f64::from(value), high: f64::from(value) }
    }
    fn sqrt(self) -> Self {
        // What rounding has put below 0 is not there.
        let root = Self::out(self.low.max(0.0).sqrt(), self.high.max(0.0).sqrt());
        Self { low: root.low.max(0.0), ..root }
    }
    fn abs(self) -> Self {
        let (a, b) = (self.low.abs(), self.high.abs());
        let low = if self.low <= 0.0 && self.high >= 0.0 { 0.0 } else { a.min(b) };
        Self { low, high: a.max(b) }
    }
    fn min(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.min(other.high) }
    }
    fn max(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.max(other.high) }
    }
    fn ln(self) -> Self {
        self.rising(|x| libm::log(x.max(0.0)))
    }
    fn sin_cos(self) -> (Self, Self) {
        let quarter = 0.5 * PI;
        ((self - Self::new(quarter.next_down(), quarter.next_up())).cosine(), self.cosine())
    }
    fn acos(self) -> Self {
        Self::new(0.0, PI.next_up())
    }
    fn atan2(self, _: Self) -> Self {
        Self::new(PI.next_up().neg(), PI.next_up())
    }
    fn powf(self, exponent: f32) -> Self {
        self.rising(|x| libm::pow(x.max(0.0), f64::from(exponent)))
    }
    fn floor(self) -> Self {
        Self { low: self.low.floor(), high: self.high.floor() }
    }
    /// The value in the middle and the steepest slope that was proven for noise.
    fn gradient_noise(place: Point<Self>, key: u32) -> Self {
        let parts = [place.x, place.y, place.z];
        let middle = parts.map(|part| 0.5 * (part.low + part.high));
        let radius = parts.iter().map(|part| (part.high - part.low).powi(2)).sum::<f64>().sqrt() * 0.5;
        let value = f64::gradient_noise(Point::new(middle[0], middle[1], middle[2]), key);
        let reach = noise::STEEPEST_OCTAVE * radius * (1.0 + 1e-12) + 1e-13;
        let most = noise::LARGEST_OCTAVE;
        Self::new((value - reach).max(-most), (value + reach).min(most))
    }
    fn less(self, other: Self) -> Answer {
        if self.high < other.low {
            Answer::Yes
        } else if self.low >= other.high {
            Answer::No
        } else {
            Answer::Either
        }
    }
    fn select(mask: Answer, yes: Self, no: Self) -> Self {
        match mask {
            Answer::Yes => yes,
            Answer::No => no,
            Answer::Either => yes.hull(no),
        }
    }
    fn any(mask: Answer) -> bool {
        mask != Answer::No
    }
}
