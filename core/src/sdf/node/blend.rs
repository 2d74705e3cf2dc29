//! Owns the polynomial blend that the smooth operators share.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `smooth_union`, `smooth_intersection`, `smooth_difference`, made by `scenes/sdf/`.

use crate::sdf::error::{SdfError, require};
use crate::sdf::real::Real;

/// Quadratic polynomial smooth minimum with support `k`:
/// `h = max(k - |a - b|, 0)`, `f = min(a, b) - h² / (4 k)`.
///
/// Where `|a - b| >= k` it is exactly the minimum. Elsewhere the gradient is `(1 - s) ∇a + s ∇b` with
/// `s = 1/2 + (a - b) / (2 k)` in [0, 1]: a convex combination, so the Lipschitz bound is that of the operands
/// (Quilez 2013, "smooth minimum"). The value is at most `k/4` below the minimum.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Blend {
    k: f32,
    /// 1 / (4 k), in 1 / length.
    quarter: f32,
}

impl Blend {
    /// A blend, or `None` where `k` is 0 or so small that it vanishes.
    pub(in crate::sdf) fn new(name: &'static str, k: f32) -> Result<Option<Self>, SdfError> {
        require((0.0..=1e12).contains(&k), name, k, "a number from 0 to 1e12")?;
        let quarter = 0.25 / k;
        Ok(quarter.is_finite().then_some(Self { k, quarter }))
    }

    /// The smooth minimum of two values.
    #[inline]
    pub(in crate::sdf) fn min<R: Real>(self, a: R, b: R) -> R {
        a.min(b) - self.excess(a - b)
    }

    /// The smooth maximum of two values: `-min(-a, -b)`, at most `k/4` above the maximum.
    #[inline]
    pub(in crate::sdf) fn max<R: Real>(self, a: R, b: R) -> R {
        a.max(b) + self.excess(a - b)
    }

    /// How far the smooth minimum may be below the minimum.
    pub(in crate::sdf) fn depth(self) -> f32 {
        0.25 * self.k
    }

    /// Values farther apart than this are not blended.
    pub(in crate::sdf) fn width(self) -> f32 {
        self.k
    }

    #[inline]
    fn excess<R: Real>(self, difference: R) -> R {
        let h = (R::splat(self.k) - difference.abs()).max(R::splat(0.0));
        h * (h * R::splat(self.quarter))
    }
}
