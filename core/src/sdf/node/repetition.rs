//! Owns copies of a child at the points of a lattice.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `repetition`, `repetition_infinite`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::error::{SdfError, require};
use crate::sdf::real::{Point, Real};

/// A child copied along the axes with a period each; 0 along an axis does not copy.
///
/// Each copy is alone in its cell, a box of one period, with the gap `g` between its bounds and every face. In a cell the
/// value is the least of the child's own (and no less than the distance to its bounds) and, towards every face with a
/// neighbour behind it, the distance to the face plus `g`: no copy behind it is nearer than that. Both have the bound 1,
/// and on a face the second is `g`, which the first is at least, on either side: the value is continuous and has the bound
/// 1 everywhere. One copy is evaluated wherever the place is.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Repetition {
    period: Vec3,
    /// Numbers of the first and the last copy along each axis; may be infinite.
    first: Vec3,
    last: Vec3,
    /// Bounds of the child.
    hull: Aabb,
    /// From the bounds to the faces.
    gap: Vec3,
}

/// Least gap between a copy and the face of its cell, in periods: rays cross faces in steps of the gap.
const LEAST_GAP: f32 = 1.0 / 64.0;

impl Repetition {
    /// Copies with the given periods: `count` on either side of the child along each axis, `None` without end.
    pub(in crate::sdf) fn new(period: Vec3, count: [Option<u32>; 3]) -> Result<Self, SdfError> {
        let allowed = "three numbers from 1e-6 to 1e6, or 0 along axes without copies";
        for length in period.to_array() {
            require(length == 0.0 || (1e-6..=1e6).contains(&length), "repetition.period", length, allowed)?;
        }
        let last = Vec3::from_array(count.map(|count| count.map_or(f32::INFINITY, |count| count as f32)));
        Ok(Self { period, first: -last, last, hull: Aabb::EMPTY, gap: Vec3::ZERO })
    }

    /// The same around a child of these bounds, or an error where copies are too close to each other.
    pub(in crate::sdf) fn around(self, hull: Aabb) -> Result<Self, SdfError> {
        let mut gap = Vec3::ZERO;
        for axis in 0..3 {
            let (period, reach) = (self.period[axis], hull.max[axis].max(-hull.min[axis]));
            if period > 0.0 && !hull.is_empty() {
                gap[axis] = 0.5 * period - reach;
                let allowed =
                    "a period of more than twice the child's reach from its origin, and 1/32 of itself more";
                require(gap[axis] >= LEAST_GAP * period, "repetition.period", period, allowed)?;
            }
        }
        Ok(Self { hull, gap, ..self })
    }

    /// A place in the cell of its copy.
    #[inline]
    pub(in crate::sdf) fn enter<R: Real>(&self, p: Point<R>) -> Point<R> {
        let [x, y, z] = [p.x, p.y, p.z];
        Point::new(self.fold(x, 0).0, self.fold(y, 1).0, self.fold(z, 2).0)
    }

    /// A coordinate in its cell, and the number of the cell.
    #[inline]
    fn fold<R: Real>(&self, at: R, axis: usize) -> (R, R) {
        let period = self.period[axis];
        if period == 0.0 {
            return (at, R::splat(0.0));
        }
        let cell = (at * R::splat(1.0 / period) + R::splat(0.5)).floor();
        let cell = cell.max(R::splat(self.first[axis])).min(R::splat(self.last[axis]));
        (at - cell * R::splat(period), cell)
    }

    /// The value at `p` from the child's value at the place in its cell.
    #[inline]
    pub(in crate::sdf) fn leave<R: Real>(&self, value: R, p: Point<R>) -> R {
        if self.hull.is_empty() {
            return value;
        }
        let mut least = R::splat(f32::INFINITY);
        let zero = R::splat(0.0);
        let mut beyond = [zero; 3];
        for (axis, at) in [p.x, p.y, p.z].into_iter().enumerate() {
            let (q, cell) = self.fold(at, axis);
            let (low, high) = (R::splat(self.hull.min[axis]), R::splat(self.hull.max[axis]));
            beyond[axis] = (low - q).max(q - high).max(zero);
            if self.period[axis] > 0.0 {
                let reach = R::splat(0.5 * self.period[axis] + self.gap[axis]);
                let open = R::splat(f32::INFINITY);
                let after = R::select(cell.less(R::splat(self.last[axis])), reach - q, open);
                let before = R::select(R::splat(self.first[axis]).less(cell), reach + q, open);
                least = least.min(after).min(before);
            }
        }
        let hull = Point::new(beyond[0], beyond[1], beyond[2]).length();
        R::select(zero.less(hull), value.max(hull), value).min(least)
    }

    /// A box around all places where the value is at most `margin`.
    pub(in crate::sdf) fn bounds(&self, margin: f32) -> Aabb {
        if self.hull.is_empty() {
            return Aabb::EMPTY;
        }
        let span = |cells: Vec3, axis: usize| {
            // No copies times no end is no copies.
            if self.period[axis] == 0.0 { 0.0 } else { cells[axis] * self.period[axis] }
        };
        let moved = |cells: Vec3| Vec3::from_array([0, 1, 2].map(|axis| span(cells, axis)));
        let (first, last) = (moved(self.first), moved(self.last));
        Aabb { min: self.hull.min + first, max: self.hull.max + last }.grown(margin)
    }

    /// Largest number that is subtracted near the surface besides the coordinates.
    pub(in crate::sdf) fn reach(&self) -> f32 {
        self.period.max_element()
    }
}
