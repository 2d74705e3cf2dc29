//! Owns the cone around the y axis, with its tip or without.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Cone around the y axis: radius `r1` at `y = -h`, `r2` at `y = h`, flat ends.
///
/// In the half-plane of `q = (hypot(p.x, p.z), p.y)` the nearest point is on the nearer end, a distance of
/// `(max(q.x - r, 0), |q.y| - h)` away, or on the slant from `(r1, -h)` to `(r2, h)`, onto which `q` is projected. The
/// least of both lengths is the exact distance, negative where `q` is behind the slant and between the ends; bound 1.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Cone {
    bottom: f32,
    top: f32,
    half: f32,
    /// One over the squared length of the slant.
    per_slant2: f32,
}

impl Cone {
    /// A cone of a full height; the radius at the top may be 0, which is a tip.
    pub(in crate::sdf) fn new(radius: f32, top_radius: f32, height: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&radius), "cone.radius", radius, A_LENGTH)?;
        let allowed = "0 or a number from 1e-12 to 1e12";
        let fits = top_radius == 0.0 || LENGTHS.contains(&top_radius);
        require(fits, "cone.top_radius", top_radius, allowed)?;
        require(LENGTHS.contains(&height), "cone.height", height, A_LENGTH)?;
        let (across, along) = (f64::from(top_radius) - f64::from(radius), f64::from(height));
        let per_slant2 = (1.0 / (across * across + along * along)) as f32;
        Ok(Self { bottom: radius, top: top_radius, half: 0.5 * height, per_slant2 })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let zero = R::splat(0.0);
        let across = (p.x * p.x + p.z * p.z).sqrt();
        // From the nearer end.
        let below = p.y.less(zero);
        let end = R::select(below, R::splat(self.bottom), R::splat(self.top));
        let (end_x, end_y) = ((across - end).max(zero), p.y.abs() - R::splat(self.half));
        // From the slant.
        let (run, rise) = (R::splat(self.top - self.bottom), R::splat(2.0 * self.half));
        let (x, y) = (across - R::splat(self.bottom), p.y + R::splat(self.half));
        let part = ((x * run + y * rise) * R::splat(self.per_slant2)).max(zero).min(R::splat(1.0));
        let (slant_x, slant_y) = (x - run * part, y - rise * part);
        let square = (end_x * end_x + end_y * end_y).min(slant_x * slant_x + slant_y * slant_y);
        let within = R::select(end_y.less(zero), R::splat(-1.0), R::splat(1.0));
        square.sqrt() * R::select(slant_x.less(zero), within, R::splat(1.0))
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        let radius = self.bottom.max(self.top);
        let corner = Vec3::new(radius, self.half, radius);
        Aabb { min: -corner, max: corner }
    }
}
