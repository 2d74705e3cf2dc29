//! Owns elementary functions: crate libm, pinned, so that two machines give the same bits.

use std::f32::consts::TAU;

macro_rules! forward {
    ($($(#[$doc:meta])* $name:ident => $of:ident ($($arg:ident),*);)*) => {
        $($(#[$doc])* #[inline] pub fn $name($($arg: f32),*) -> f32 { libm::$of($($arg),*) })*
    };
}

forward! {
    /// Sine of an angle in radians.
    sin => sinf(x);
    /// Cosine of an angle in radians.
    cos => cosf(x);
    /// Tangent of an angle in radians.
    tan => tanf(x);
    /// Arc cosine in radians; the argument is not clamped.
    acos => acosf(x);
    /// Angle of the point (x, y) in radians, −π..π.
    atan2 => atan2f(y, x);
    /// `eˣ`.
    exp => expf(x);
    /// Natural logarithm.
    ln => logf(x);
    /// `x` to the power `y`.
    powf => powf(x, y);
}

/// Sine and cosine together.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// Sine and cosine of a part of a whole turn, −8 to 8, to 1.2e-7: what random numbers choose needs no long arguments.
///
/// The nearest quarter turn is taken off, and the rest is in the reach of short series (Cephes, `sinf` and `cosf`).
#[inline]
pub fn sin_cos_turn(turn: f32) -> (f32, f32) {
    let quarters = (turn * 4.0).round_ties_even();
    let (sin, cos) = sin_cos_eighth(turn - quarters * 0.25);
    let quarter = quarters as i32;
    let (a, b) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    (if quarter & 2 == 0 { a } else { -a }, if (quarter + 1) & 2 == 0 { b } else { -b })
}

/// The same of at most an eighth of a turn to either side.
#[inline]
pub fn sin_cos_eighth(turn: f32) -> (f32, f32) {
    let x = turn * TAU;
    let x2 = x * x;
    let sin = ((-1.951_529_6e-4 * x2 + 8.332_161e-3) * x2 - 1.666_665_5e-1) * x2 * x + x;
    let cos = ((2.443_315_7e-5 * x2 - 1.388_731_6e-3) * x2 + 4.166_664_6e-2) * x2 * x2 - 0.5 * x2 + 1.0;
    (sin, cos)
}

/// Angle of the point (x, y) in parts of a whole turn, −½..½, to 2.5e-7 of it; 0 of the origin.
///
/// The smaller part over the larger is taken around ½ where it is large, and the rest is in the reach of a short series
/// (Cephes, `atanf`).
#[inline]
pub fn turn_of(y: f32, x: f32) -> f32 {
    const EIGHTH: f32 = std::f32::consts::FRAC_PI_4;
    let (low, high) = (y.abs().min(x.abs()), y.abs().max(x.abs()));
    if high == 0.0 {
        return 0.0;
    }
    let is_wide = low > 0.414_213_57 * high;
    let t = if is_wide { (low - high) / (low + high) } else { low / high };
    let t2 = t * t;
    let series = ((8.053_744_5e-2 * t2 - 1.387_768_5e-1) * t2 + 1.997_771_1e-1) * t2 - 3.333_295e-1;
    let from_axis = (series * t2 * t + t + if is_wide { EIGHTH } else { 0.0 }) * (1.0 / TAU);
    let from_right = if y.abs() > x.abs() { 0.25 - from_axis } else { from_axis };
    let upper = if x < 0.0 { 0.5 - from_right } else { from_right };
    upper.copysign(y)
}

#[cfg(test)]
mod tests {
    use super::{sin_cos_turn, turn_of};

    #[test]
    fn points_have_their_angle() {
        for i in -1_000_000..=1_000_000 {
            let (sin, cos) = libm::sincos(f64::from(i) * 1e-6 * std::f64::consts::PI);
            for size in [1e-30, 1.0, 3e18] {
                let (y, x) = ((size * sin) as f32, (size * cos) as f32);
                let exact = libm::atan2(f64::from(y), f64::from(x)) / std::f64::consts::TAU;
                let found = f64::from(turn_of(y, x));
                assert!(
                    (found - exact).abs() <= 2.5e-7 * exact.abs().max(0.05),
                    "({x}, {y}): {found}, {exact}"
                );
            }
        }
        for (y, x, turn) in
            [(0.0, 1.0, 0.0), (1.0, 0.0, 0.25), (0.0, -2.0, 0.5), (-0.0, -2.0, -0.5), (-1.0, 0.0, -0.25)]
        {
            assert_eq!(turn_of(y, x), turn);
        }
        assert_eq!(turn_of(0.0, 0.0), 0.0);
    }

    #[test]
    fn parts_of_a_turn_have_their_sine_and_cosine() {
        for i in -2_000_000..=2_000_000 {
            let turn = i as f32 / 1_000_000.0 + 0.3 * f32::EPSILON * i as f32;
            let (sin, cos) = sin_cos_turn(turn);
            let exact = libm::sincos(f64::from(turn) * std::f64::consts::TAU);
            let off = (f64::from(sin) - exact.0).abs().max((f64::from(cos) - exact.1).abs());
            assert!(off < 1.2e-7, "{turn}: {sin} {cos}, {exact:?}");
        }
        assert_eq!(sin_cos_turn(0.0), (0.0, 1.0));
        assert_eq!(sin_cos_turn(0.25), (1.0, 0.0));
        assert_eq!(sin_cos_turn(0.5), (0.0, -1.0));
        assert_eq!(sin_cos_turn(0.75), (-1.0, 0.0));
    }
}
