//! Owns the ellipsoid.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `ellipsoid`, made by `scenes/sdf/`.

use glam::Vec3;

use super::Cuboid;
use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::error::{LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Ellipsoid with half axes `r` along x, y and z: `f(p) = max(min(r) (|p / r| - 1), box(p))` with the distance to the
/// box around it.
///
/// `|p / r|` has the bound `1 / min(r)`, so both have the bound 1 and so has the greater. The box holds the ellipsoid,
/// so that it is never what is greater on its surface. The value is a lower bound of the distance, poor only close to
/// the tips of long ellipsoids.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Ellipsoid {
    per_radius: Vec3,
    least: f32,
    hull: Cuboid,
}

impl Ellipsoid {
    /// An ellipsoid with the given half axes.
    pub(in crate::sdf) fn new(radii: Vec3) -> Result<Self, SdfError> {
        for radius in radii.to_array() {
            let allowed = "three numbers greater than 0 (1e-12 to 1e12)";
            require(LENGTHS.contains(&radius), "ellipsoid.radii", radius, allowed)?;
        }
        Ok(Self { per_radius: radii.recip(), least: radii.min_element(), hull: Cuboid::from_half(radii) })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let per = Point::splat(self.per_radius);
        let shrunk = Point::new(p.x * per.x, p.y * per.y, p.z * per.z).length() - R::splat(1.0);
        (R::splat(self.least) * shrunk).max(self.hull.distance(p))
    }

    /// The piece of a line that is in the unit ball when the axes are scaled to 1.
    #[inline]
    pub(in crate::sdf) fn span(self, line: &Line) -> Option<Span> {
        let per = self.per_radius.as_dvec3();
        let (foot, dir) = (line.foot * per, line.dir * per);
        let square = dir.length_squared();
        let middle = -foot.dot(dir) / square;
        let gap = foot + dir * middle;
        Span::around(middle, (1.0 - gap.length_squared()) / square)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        self.hull.bounds()
    }
}
