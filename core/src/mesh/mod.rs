//! Owns triangle meshes: what they are, and that every one that is read is sound.

mod closed;
mod obj;
mod ply;
#[cfg(test)]
mod tests;

use std::fmt::Display;

use glam::{Vec2, Vec3};

/// Triangles over shared vertices, in the units of their file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the vertices, finite.
    pub positions: Vec<Vec3>,
    /// Normals per vertex, finite, of any length; empty where not every vertex has one.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex, finite, v upwards; empty where not every vertex has one.
    pub uvs: Vec<Vec2>,
    /// Corners of the triangles, counter-clockwise seen from the front; every index is below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Triangles of the file that were left out because they have no area.
    pub dropped: u32,
}

impl Mesh {
    /// 1 where the side that a triangle's winding calls its front is that of its vertices' normals, or where there are
    /// none; −1 where the normals say otherwise: they were made by whoever knew which side is which.
    #[inline]
    pub fn side(&self, triangle: usize) -> f32 {
        if self.normals.is_empty() {
            return 1.0;
        }
        let corners = self.triangles[triangle].map(|i| i as usize);
        let [p0, p1, p2] = corners.map(|i| self.positions[i]);
        let [n0, n1, n2] = corners.map(|i| self.normals[i]);
        side((p1 - p0).cross(p2 - p0), [n0, n1, n2])
    }
}

/// [`Mesh::side`] of a triangle with the normal that its winding tells, of any length, and the normals of its vertices.
#[inline]
pub fn side(winding: Vec3, [n0, n1, n2]: [Vec3; 3]) -> f32 {
    // Not by the sign bit: normals of length 0 say nothing, and their product may be −0.
    if winding.dot(n0 + n1 + n2) < 0.0 { -1.0 } else { 1.0 }
}

/// What is wrong with a mesh file, in words: where (a line, an offset, a vertex), what was found, what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct MeshError(String);

impl MeshError {
    /// A problem at a place in the file, such as `line 12` or `vertex 7`.
    fn new(place: impl Display, message: impl Display) -> Self {
        Self(format!("{place}: {message}"))
    }
}

/// Share of the squared diagonal of the mesh below which a triangle has no area.
const NO_AREA: f64 = 1.0e-12;

/// Reads an OBJ or PLY file, chosen by the extension of `path`, of at most `max_triangles` triangles.
///
/// Polygons become fans around their first corner. Triangles without area are left out and counted.
///
/// # Errors
/// Damaged files, numbers that are not finite, indices of vertices that are not there, too many triangles.
pub fn read(bytes: &[u8], path: &str, max_triangles: u64) -> Result<Mesh, MeshError> {
    let ply = path.rsplit('.').next().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"));
    let mut mesh = if ply { ply::read(bytes, max_triangles)? } else { obj::read(bytes, max_triangles)? };
    check(&mesh)?;
    drop_degenerate(&mut mesh);
    Ok(mesh)
}

/// Refuses more triangles than are left of the limit.
fn check_count(triangles: u64, left: u64) -> Result<(), MeshError> {
    if triangles <= left {
        return Ok(());
    }
    Err(MeshError(format!("has {triangles} triangles, {left} are left of the limit for all meshes")))
}

/// Refuses numbers that are not finite and indices beyond the vertices.
fn check(mesh: &Mesh) -> Result<(), MeshError> {
    let not_finite = |index: usize, what: &str, found: String| {
        MeshError::new(
            format!("vertex {index}"),
            format!("found the {what} {found}, expected finite numbers"),
        )
    };
    if let Some((index, p)) = mesh.positions.iter().enumerate().find(|(_, p)| !p.is_finite()) {
        return Err(not_finite(index, "position", p.to_string()));
    }
    if let Some((index, n)) = mesh.normals.iter().enumerate().find(|(_, n)| !n.is_finite()) {
        return Err(not_finite(index, "normal", n.to_string()));
    }
    if let Some((index, uv)) = mesh.uvs.iter().enumerate().find(|(_, uv)| !uv.is_finite()) {
        return Err(not_finite(index, "texture coordinate", uv.to_string()));
    }
    let vertices = mesh.positions.len();
    let beyond = |triangle: &[u32; 3]| triangle.iter().copied().find(|&index| index as usize >= vertices);
    match mesh.triangles.iter().enumerate().find_map(|(at, triangle)| Some((at, beyond(triangle)?))) {
        None => Ok(()),
        Some((at, index)) => Err(MeshError::new(
            format!("triangle {at}"),
            format!("found the vertex index {index}, the mesh has {vertices} vertices"),
        )),
    }
}

/// Leaves out triangles with a corner twice or with next to no area.
fn drop_degenerate(mesh: &mut Mesh) {
    let (low, high) = mesh
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let least = NO_AREA * (high.as_dvec3() - low.as_dvec3()).length_squared();
    let positions = &mesh.positions;
    let before = mesh.triangles.len();
    mesh.triangles.retain(|&[a, b, c]| {
        let [p, q, r] = [a, b, c].map(|index| positions[index as usize].as_dvec3());
        a != b && b != c && c != a && (q - p).cross(r - p).length() / 2.0 > least
    });
    mesh.dropped += (before - mesh.triangles.len()) as u32;
}
