//! Owns displacement of any object by noise.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `fbm_noise`, `fbm_noise_sphere`, made by `scenes/sdf/`.

use crate::sdf::error::SdfError;
use crate::sdf::noise::{Noise, NoiseParameters};
use crate::sdf::real::{Point, Real};

/// The object whose surface is moved out by noise: `base(p) < noise(p)`.
///
/// With the first `n` octaves `s_n = base - Σ_{i<n} nᵢ`, the bound `L_n = 1 + Σ_{i<n} |∇nᵢ|` of its slope, and the most
/// `r_n` that the octaves left out can change, `(s_n - r_n) / L_n` and `(s_n + r_n) / L_n` have the bound 1 and are on
/// either side of 0 only where the full sum is. Their greatest, outside, and their least, inside, over all `n` are so
/// too, meet in 0 on the surface, and need the finer octaves close to the surface only: outside of the shell that the
/// amplitudes reach there is no noise to evaluate at all, and a step there is as long as to the object without it.
///
/// An octave is left out where it and all that follow could not change the value: the value is the same as if it
/// were not.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Displacement {
    noise: Noise,
}

impl Displacement {
    pub(in crate::sdf) fn new(parameters: NoiseParameters) -> Result<Self, SdfError> {
        Ok(Self { noise: Noise::new(parameters)? })
    }

    /// How far the surface may be moved.
    pub(in crate::sdf) fn reach(&self) -> f32 {
        self.noise.bound()
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(&self, base: R, p: Point<R>) -> R {
        let zero = R::splat(0.0);
        let mut rest = self.noise.bound();
        let mut slope = 1.0;
        let mut sum = base;
        let mut outside = base - R::splat(rest);
        let mut inside = base + R::splat(rest);
        // Lanes whose value may still change.
        let mut open = R::splat(1.0);
        for octave in self.noise.octaves() {
            // What follows is at best all that is left, over a slope that is at least the next one.
            slope += octave.slope;
            let (high, low) = (sum + R::splat(rest), sum - R::splat(rest));
            let next = R::splat(slope);
            let settled_outside = R::select(outside.less(high / next), zero, outside);
            let settled_inside = R::select((low / next).less(inside), zero, -inside);
            open = R::select(zero.less(settled_outside.max(settled_inside)), zero, open);
            let active = zero.less(open);
            if !R::any(active) {
                break;
            }
            rest = octave.rest;
            sum = R::select(active, sum - octave.at(p), sum);
            outside = R::select(active, outside.max((sum - R::splat(rest)) / next), outside);
            inside = R::select(active, inside.min((sum + R::splat(rest)) / next), inside);
        }
        R::select(zero.less(outside), outside, inside.min(zero))
    }
}
