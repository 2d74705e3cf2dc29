//! Owns rigid transforms with a uniform scale.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `transform`, made by `scenes/sdf/`.

use glam::{DMat3, DVec3, Mat3, Vec3};

use crate::math::Aabb;
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Placement `x -> s R x + t` of a child `g`: `f(p) = s g(Rᵀ (p - t) / s)`.
///
/// `Rᵀ` keeps lengths, dividing by `s` divides the Lipschitz bound by `s` and the factor in front restores it, so the
/// bound and exactness of the child are kept. Nested placements are multiplied out in f64 before any is rounded to
/// f32: large offsets that cancel cost no precision.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Similarity {
    rotation: DMat3,
    translate: DVec3,
    scale: f64,
}

/// A [`Similarity`] as the tape applies it.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Placement {
    /// Rows of `Rᵀ / s`.
    rows: [Vec3; 3],
    translate: Vec3,
    /// Size of a unit of the child, in units of the parent.
    pub(in crate::sdf) scale: f32,
}

/// How far `RᵀR` may be from the identity: f32 rotations pass, matrices with shear or scale do not.
const ORTHONORMAL: f32 = 1e-4;

impl Similarity {
    pub(in crate::sdf) fn new(translate: Vec3, rotation: Mat3, scale: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&scale), "transform.scale", scale, A_LENGTH)?;
        for component in translate.to_array() {
            require(
                component.abs() <= 1e12,
                "transform.translate",
                component,
                "three numbers from -1e12 to 1e12",
            )?;
        }
        let skew = (rotation.transpose() * rotation - Mat3::IDENTITY).to_cols_array();
        let worst = skew.iter().fold(0.0_f32, |worst, c| if c.abs() <= worst { worst } else { c.abs() });
        let proper = worst <= ORTHONORMAL && rotation.determinant() > 0.0;
        require(
            proper,
            "transform.rotation",
            worst,
            "a pure rotation: RᵀR within 1e-4 of the identity, no mirror",
        )?;
        Ok(Self { rotation: rotation.as_dmat3(), translate: translate.as_dvec3(), scale: f64::from(scale) })
    }

    /// The placement of a child by `inner` in something that `self` places.
    pub(in crate::sdf) fn then_inner(self, inner: Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translate: self.rotation * (inner.translate * self.scale) + self.translate,
            scale: self.scale * inner.scale,
        }
    }

    /// The form that is evaluated, or an error when nested scales left the range of f32.
    pub(in crate::sdf) fn placement(self) -> Result<Placement, SdfError> {
        let (scale, translate) = (self.scale as f32, self.translate.as_vec3());
        let ok = scale >= f32::MIN_POSITIVE
            && scale.is_finite()
            && (1.0 / scale).is_finite()
            && translate.is_finite();
        require(ok, "transform.scale", scale, "nested transforms that stay within the range of f32")?;
        let columns = self.rotation / self.scale;
        let rows = [columns.x_axis.as_vec3(), columns.y_axis.as_vec3(), columns.z_axis.as_vec3()];
        Ok(Placement { rows, translate, scale })
    }
}

impl Placement {
    /// One that only moves.
    pub(in crate::sdf) fn at(translate: Vec3) -> Self {
        Self { rows: [Vec3::X, Vec3::Y, Vec3::Z], translate, scale: 1.0 }
    }

    /// A point of the parent in the child's coordinates.
    #[inline]
    pub(in crate::sdf) fn enter<R: Real>(&self, p: Point<R>) -> Point<R> {
        let t = Point::splat(self.translate);
        let d = Point::new(p.x - t.x, p.y - t.y, p.z - t.z);
        let row = |v: Vec3| R::splat(v.x) * d.x + R::splat(v.y) * d.y + R::splat(v.z) * d.z;
        Point::new(row(self.rows[0]), row(self.rows[1]), row(self.rows[2]))
    }

    /// The child's origin in the parent, and what turns and scales vectors of the parent into the child's.
    pub(in crate::sdf) fn inwards(&self) -> (DVec3, DMat3) {
        let [x, y, z] = self.rows.map(Vec3::as_dvec3);
        (self.translate.as_dvec3(), DMat3::from_cols(x, y, z).transpose())
    }

    /// Largest coordinate of the child's origin in the parent: what the subtraction in [`Self::enter`] can cancel.
    pub(in crate::sdf) fn reach(&self) -> f32 {
        self.translate.abs().max_element()
    }

    /// A point of the child in the parent's coordinates.
    pub(in crate::sdf) fn leave(&self, p: Vec3) -> Vec3 {
        let [x, y, z] = self.rows.map(|row| row * self.scale * self.scale);
        x * p.x + y * p.y + z * p.z + self.translate
    }

    /// The box around the eight corners of the child's bounds; of what has no end it has none either.
    pub(in crate::sdf) fn bounds(&self, child: Aabb) -> Aabb {
        if child.is_empty() {
            return Aabb::EMPTY;
        }
        if !child.is_finite() {
            return Aabb::EVERYTHING;
        }
        let corners = child.corners().into_iter();
        corners.fold(Aabb::EMPTY, |hull, corner| hull.with_point(self.leave(corner)))
    }
}
