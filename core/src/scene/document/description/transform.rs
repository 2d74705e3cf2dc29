//! Owns placements: the three ways to write one, and the affine map they stand for.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::scene::document::macros::object;

object! {
    "look_at";
    /// An eye that looks at a target: −z of the local frame points from `eye` to `target`, y lies in the plane
    /// of −z and `up`.
    pub struct LookAt {
        /// Where the local origin is, in world units.
        eye: DVec3 = required();
        /// A point on the line of sight, in world units; not the eye.
        target: DVec3 = required();
        /// Direction that is up, of any length; not along the line of sight.
        up: DVec3 = or(DVec3::Y);
    }
}

/// Scale first, then rotate, then translate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Components {
    /// Translation, in units of the parent.
    pub translate: DVec3,
    /// Rotations about x, y and z, in degrees, applied in this order.
    pub rotate: DVec3,
    /// Factors along x, y and z, none of them 0.
    pub scale: DVec3,
}

impl Components {
    /// The affine map: scale, then rotate about x, y, z, then translate.
    pub fn affine(&self) -> DAffine3 {
        let [x, y, z] = self.rotate.to_array().map(f64::to_radians);
        let turn = DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x);
        DAffine3::from_scale_rotation_translation(self.scale, turn, self.translate)
    }
}

impl LookAt {
    /// The rigid map whose −z looks from eye to target; `None` when the points give no direction.
    pub fn affine(&self) -> Option<DAffine3> {
        let z = (self.eye - self.target).try_normalize()?;
        let x = self.up.try_normalize()?.cross(z).try_normalize()?;
        Some(DAffine3 { matrix3: DMat3::from_cols(x, z.cross(x), z), translation: self.eye })
    }
}
