//! Owns writing PLY: binary little endian, so that importers hand over meshes exactly.

use crate::mesh::Mesh;

impl Mesh {
    /// The mesh as a binary little-endian PLY file. [`read`](crate::mesh::read) gives it back bit for bit, but for
    /// triangles without area. Normals and texture coordinates are written where every vertex has one.
    pub fn to_ply(&self) -> Vec<u8> {
        let every = |count: usize| count > 0 && count == self.positions.len();
        let (normals, uvs) = (every(self.normals.len()), every(self.uvs.len()));
        let columns = [(true, "x y z"), (normals, "nx ny nz"), (uvs, "u v")];
        let written = columns.iter().filter(|(there, _)| *there).flat_map(|(_, names)| names.split(' '));
        let properties: String = written.map(|name| ["property float ", name, "\n"].concat()).collect();
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}element face {}\n\
             property list uchar uint vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangles.len(),
        );
        let row = 12 + 12 * usize::from(normals) + 8 * usize::from(uvs);
        let length = header.len() + row * self.positions.len() + 13 * self.triangles.len();
        let mut bytes = Vec::with_capacity(length);
        bytes.extend(header.into_bytes());
        for (vertex, position) in self.positions.iter().enumerate() {
            push(&mut bytes, &position.to_array());
            if normals {
                push(&mut bytes, &self.normals[vertex].to_array());
            }
            if uvs {
                push(&mut bytes, &self.uvs[vertex].to_array());
            }
        }
        for corners in &self.triangles {
            bytes.push(3);
            bytes.extend(corners.iter().flat_map(|index| index.to_le_bytes()));
        }
        bytes
    }
}

fn push(bytes: &mut Vec<u8>, numbers: &[f32]) {
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}
