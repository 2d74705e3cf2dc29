//! Owns the box with rounded edges.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `rounded_box`, made by `scenes/sdf/`.

use glam::Vec3;

use super::Cuboid;
use crate::math::Aabb;
use crate::sdf::error::{LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Box whose edges and corners are rounded with radius `r`: the distance to the box that is `r` smaller on every side,
/// minus `r`.
///
/// An exact distance less a constant is an exact distance outside and keeps the bound 1 everywhere.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct RoundedBox {
    core: Cuboid,
    radius: f32,
}

impl RoundedBox {
    /// A box with the given full edge lengths, which the rounding does not change.
    pub(in crate::sdf) fn new(size: Vec3, radius: f32) -> Result<Self, SdfError> {
        Cuboid::check(size, "rounded_box.size")?;
        let allowed = "0, or a number from 1e-12 to half the shortest edge";
        let fits = radius == 0.0 || (LENGTHS.contains(&radius) && radius <= 0.5 * size.min_element());
        require(fits, "rounded_box.radius", radius, allowed)?;
        Ok(Self { core: Cuboid::from_half(size * 0.5 - radius), radius })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        self.core.distance(p) - R::splat(self.radius)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        self.core.bounds().grown(self.radius)
    }
}
