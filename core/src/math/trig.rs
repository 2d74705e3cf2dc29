//! Owns elementary functions: crate libm, pinned, so that two machines give the same bits.

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
