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
    let x = (turn - quarters * 0.25) * TAU;
    let x2 = x * x;
    let sin = ((-1.951_529_6e-4 * x2 + 8.332_161e-3) * x2 - 1.666_665_5e-1) * x2 * x + x;
    let cos = ((2.443_315_7e-5 * x2 - 1.388_731_6e-3) * x2 + 4.166_664_6e-2) * x2 * x2 - 0.5 * x2 + 1.0;
    let quarter = quarters as i32;
    let (a, b) = if quarter & 1 == 0 { (sin, cos) } else { (cos, sin) };
    (if quarter & 2 == 0 { a } else { -a }, if (quarter + 1) & 2 == 0 { b } else { -b })
}

#[cfg(test)]
mod tests {
    use super::sin_cos_turn;

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
