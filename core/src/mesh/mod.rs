//! Owns triangle meshes.

use glam::{Vec2, Vec3};

/// Triangles over shared vertices, in the units of their file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the vertices, finite.
    pub positions: Vec<Vec3>,
    /// Normals per vertex, of any length; empty where the file has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, v upwards; empty where the file has none.
    pub uvs: Vec<Vec2>,
    /// Corners of the triangles, counter-clockwise seen from the front; every index is below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles of the file that were left out because they have no area.
    pub dropped: u32,
}
