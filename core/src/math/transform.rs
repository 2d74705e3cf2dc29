//! Owns placements of objects: an affine map and its inverse in double precision.

use glam::{DAffine3, DMat3, Vec3};

/// Local to world and back. Kept in f64 so that an object far from the origin loses no precision of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    to_world: DAffine3,
    to_local: DAffine3,
    normal: DMat3,
    flips: bool,
    /// Whether it changes nothing: most objects of converted scenes stand where their files say.
    identity: bool,
}

impl Transform {
    /// The identity.
    pub const IDENTITY: Self = Self {
        to_world: DAffine3::IDENTITY,
        to_local: DAffine3::IDENTITY,
        normal: DMat3::IDENTITY,
        flips: false,
        identity: true,
    };

    /// A placement by an invertible map; `None` when it cannot be inverted or is not finite.
    pub fn new(to_world: DAffine3) -> Option<Self> {
        let determinant = to_world.matrix3.determinant();
        let to_local = to_world.inverse();
        (determinant != 0.0 && to_world.is_finite() && to_local.is_finite()).then(|| Self {
            to_world,
            to_local,
            normal: to_local.matrix3.transpose(),
            flips: determinant < 0.0,
            identity: to_world == DAffine3::IDENTITY,
        })
    }

    /// Whether it changes nothing.
    #[inline]
    pub fn is_identity(&self) -> bool {
        self.identity
    }

    /// Whether it mirrors: the winding of triangles turns around.
    #[inline]
    pub fn flips(&self) -> bool {
        self.flips
    }

    /// The map to the world.
    #[inline]
    pub fn to_world(&self) -> &DAffine3 {
        &self.to_world
    }

    /// The map to the object.
    #[inline]
    pub fn to_local(&self) -> &DAffine3 {
        &self.to_local
    }

    /// Where it puts the origin.
    #[inline]
    pub fn shift(&self) -> Vec3 {
        self.to_world.translation.as_vec3()
    }

    /// A point, local to world.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        if self.identity { p } else { self.to_world.transform_point3(p.as_dvec3()).as_vec3() }
    }

    /// A direction, local to world; its length scales with the map.
    #[inline]
    pub fn vector(&self, v: Vec3) -> Vec3 {
        if self.identity { v } else { self.to_world.transform_vector3(v.as_dvec3()).as_vec3() }
    }

    /// A normal, local to world, normalised, on the same side of the surface.
    #[inline]
    pub fn normal(&self, n: Vec3) -> Vec3 {
        let length2 = n.length_squared();
        // Squares of ordinary length neither overflow nor lose digits.
        if self.identity && (1e-20..1e20).contains(&length2) {
            return n / length2.sqrt();
        }
        let n = n.as_dvec3();
        (if self.identity { n } else { self.normal * n }).normalize_or_zero().as_vec3()
    }

    /// A point, world to local.
    #[inline]
    pub fn local_point(&self, p: Vec3) -> Vec3 {
        if self.identity { p } else { self.to_local.transform_point3(p.as_dvec3()).as_vec3() }
    }

    /// A direction, world to local; its length scales with the map.
    #[inline]
    pub fn local_vector(&self, v: Vec3) -> Vec3 {
        if self.identity { v } else { self.to_local.transform_vector3(v.as_dvec3()).as_vec3() }
    }

    /// Bound of the world error of a point whose local error is `error`.
    #[inline]
    pub fn error(&self, error: Vec3) -> Vec3 {
        if self.identity {
            return error;
        }
        let m = self.to_world.matrix3;
        (m.x_axis.abs() * f64::from(error.x)
            + m.y_axis.abs() * f64::from(error.y)
            + m.z_axis.abs() * f64::from(error.z))
        .as_vec3()
    }
}
