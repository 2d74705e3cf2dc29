//! Owns vectors' companions: rays, boxes, frames, transforms, error bounds, and elementary functions that give
//! the same bits on every machine.

mod aabb;
mod frame;
mod robust;
mod transform;
mod trig;

pub use aabb::Aabb;
pub use frame::Frame;
pub use robust::{even_error, gamma, offset_origin};
pub use transform::Transform;
pub use trig::{acos, atan2, cos, exp, ln, powf, sin, sin_cos, sin_cos_eighth, sin_cos_turn, tan, turn_of};

use glam::Vec3;

/// A ray `o + t·d` for `t` in `(0, t_max]`; `d` need not be of unit length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction; `t` is in units of its length.
    pub d: Vec3,
    /// Largest `t` that counts.
    pub t_max: f32,
}

impl Ray {
    /// A ray without an end.
    #[inline]
    pub fn new(o: Vec3, d: Vec3) -> Self {
        Self { o, d, t_max: f32::INFINITY }
    }

    /// The point at `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.o + self.d * t
    }
}
