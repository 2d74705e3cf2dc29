//! Owns the torus around the y axis.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `torus`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Torus in the plane `y = 0`, around the y axis: `f(p) = hypot(hypot(p.x, p.z) - major, p.y) - minor`.
///
/// The first term is the exact distance to the circle of radius `major`, which is 1-Lipschitz like every distance to
/// a set. `minor` may be 0: a circle without thickness, which no ray hits.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Torus {
    major: f32,
    minor: f32,
}

impl Torus {
    pub(in crate::sdf) fn new(major: f32, minor: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&major), "torus.major_radius", major, A_LENGTH)?;
        require(
            minor == 0.0 || LENGTHS.contains(&minor),
            "torus.minor_radius",
            minor,
            "0 or a number from 1e-12 to 1e12",
        )?;
        Ok(Self { major, minor })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let across = (p.x * p.x + p.z * p.z).sqrt() - R::splat(self.major);
        (across * across + p.y * p.y).sqrt() - R::splat(self.minor)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        let reach = self.major + self.minor;
        let corner = Vec3::new(reach, self.minor, reach);
        Aabb { min: -corner, max: corner }
    }
}
