//! Owns where textures are looked up.

use glam::{Vec2, Vec3};

use crate::sdf::Traps;

/// A point of a surface as textures know it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Texture coordinates of the surface, v upwards.
    pub uv: Vec2,
    /// Position in the space of the object, where solid textures are.
    pub solid: Vec3,
    /// How close the orbit of a fractal's point came to its traps.
    pub traps: Traps,
}

impl From<Vec2> for Place {
    /// A place of which only the texture coordinates are known.
    fn from(uv: Vec2) -> Self {
        Self { uv, solid: Vec3::ZERO, traps: Traps::NONE }
    }
}
