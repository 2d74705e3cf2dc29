//! Owns writing triangle meshes as binary PLY.

use glam::{Vec2, Vec3};

/// A mesh to be written. Normals and texture coordinates are there for every vertex, or the list is empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Triangles {
    /// Positions of the vertices.
    pub(crate) positions: Vec<Vec3>,
    /// Normals of the vertices.
    pub(crate) normals: Vec<Vec3>,
    /// Texture coordinates of the vertices.
    pub(crate) uvs: Vec<Vec2>,
    /// Corners, counter-clockwise seen from the front.
    pub(crate) corners: Vec<[u32; 3]>,
}

/// The bytes of a binary little endian PLY file.
pub(crate) fn write(mesh: &Triangles) -> Vec<u8> {
    let (normals, uvs) = (!mesh.normals.is_empty(), !mesh.uvs.is_empty());
    let mut columns = vec!["x", "y", "z"];
    if normals {
        columns.extend(["nx", "ny", "nz"]);
    }
    if uvs {
        columns.extend(["u", "v"]);
    }
    let columns = columns.join("\nproperty float ");
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float {columns}\nelement face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.corners.len()
    );
    let mut bytes = header.into_bytes();
    for (vertex, position) in mesh.positions.iter().enumerate() {
        let normal = mesh.normals.get(vertex).map(Vec3::to_array).filter(|_| normals);
        let uv = mesh.uvs.get(vertex).map(Vec2::to_array).filter(|_| uvs);
        let numbers = position.to_array().into_iter().chain(normal.into_iter().flatten());
        for number in numbers.chain(uv.into_iter().flatten()) {
            bytes.extend(number.to_le_bytes());
        }
    }
    for corners in &mesh.corners {
        bytes.push(3);
        for corner in corners {
            bytes.extend(corner.to_le_bytes());
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::{Triangles, write};
    use glam::{Vec2, Vec3};

    #[test]
    fn what_is_written_is_read_again() {
        let mesh = Triangles {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
            normals: vec![Vec3::Z; 4],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::new(0.25, 0.75)],
            corners: vec![[0, 1, 2], [2, 1, 3]],
        };
        for mesh in [mesh.clone(), Triangles { normals: Vec::new(), uvs: Vec::new(), ..mesh }] {
            let read = karst_core::mesh::read(&write(&mesh), "a.ply", 10).unwrap();
            assert_eq!((read.positions, read.normals), (mesh.positions, mesh.normals));
            assert_eq!((read.uvs, read.triangles), (mesh.uvs, mesh.corners));
        }
    }
}
