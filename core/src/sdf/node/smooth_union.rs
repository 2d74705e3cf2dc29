//! Owns the smooth union.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::error::{SdfError, require};
use crate::sdf::node::union;
use crate::sdf::real::Real;

/// Quadratic polynomial smooth minimum with support `k`:
/// `h = max(k - |a - b|, 0)`, `f = min(a, b) - h² / (4 k)`.
///
/// Where `|a - b| >= k` it is exactly the union. Elsewhere the gradient is `(1 - s) ∇a + s ∇b` with
/// `s = 1/2 + (a - b) / (2 k)` in [0, 1]: a convex combination, so the Lipschitz bound is that of the children
/// (Quilez 2013, "smooth minimum"). The value is at most `k/4` below the union.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct SmoothUnion {
    k: f32,
    /// 1 / (4 k), in 1 / length.
    quarter: f32,
}

impl SmoothUnion {
    /// The operator, or `None` where `k` is 0 or so small that the blend vanishes: then it is the plain union.
    pub(in crate::sdf) fn new(k: f32) -> Result<Option<Self>, SdfError> {
        require((0.0..=1e12).contains(&k), "smooth_union.k", k, "a number from 0 to 1e12")?;
        let quarter = 0.25 / k;
        Ok(quarter.is_finite().then_some(Self { k, quarter }))
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, a: R, b: R) -> R {
        let h = (R::splat(self.k) - (a - b).abs()).max(R::splat(0.0));
        a.min(b) - h * (h * R::splat(self.quarter))
    }

    /// The hull of both boxes, k/4 larger on every side.
    ///
    /// Each child is at least the distance `d` to the hull, so the value is at least `d - k/4`, and the hull grown by
    /// k/4 contains every point within k/4 of the hull.
    pub(in crate::sdf) fn bounds(self, a: Aabb, b: Aabb) -> Aabb {
        let hull = union::bounds(a, b);
        let margin = Vec3::splat(self.k * 0.25);
        Aabb { min: hull.min - margin, max: hull.max + margin }
    }
}
