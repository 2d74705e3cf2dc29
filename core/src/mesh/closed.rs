//! Owns what a mesh encloses.

use std::collections::HashMap;

use super::Mesh;

impl Mesh {
    /// Edges that are not shared by two triangles of the same orientation; 0 where the mesh encloses space. Vertices at the
    /// same place count as one.
    pub fn open_edges(&self) -> usize {
        let mut places = HashMap::new();
        let mut place = |corner: u32| {
            let next = places.len() as u32;
            // Adding 0 makes one zero of two.
            let key = self.positions[corner as usize].to_array().map(|part| (part + 0.0).to_bits());
            *places.entry(key).or_insert(next)
        };
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for corners in &self.triangles {
            let [a, b, c] = corners.map(&mut place);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if from < to {
                    *edges.entry((from, to)).or_default() += 1;
                } else if from > to {
                    *edges.entry((to, from)).or_default() -= 1;
                }
            }
        }
        edges.values().filter(|&&left| left != 0).count()
    }

    /// The volume inside, negative where the fronts of triangles look inwards; `flat` leaves the normals aside.
    pub fn volume(&self, flat: bool) -> f64 {
        let of = |(triangle, corners): (usize, &[u32; 3])| {
            let [a, b, c] = corners.map(|i| self.positions[i as usize].as_dvec3());
            let side = if flat { 1.0 } else { f64::from(self.side(triangle)) };
            side * a.dot(b.cross(c)) / 6.0
        };
        self.triangles.iter().enumerate().map(of).sum()
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::Mesh;
    use glam::Vec3;

    #[test]
    fn a_tetrahedron_is_closed_until_a_face_is_missing_or_turned() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mesh = Mesh { positions, triangles, ..Mesh::default() };
        assert_eq!(mesh.open_edges(), 0);
        assert!((mesh.volume(true) - 1.0 / 6.0).abs() < 1e-12);
        let open = Mesh { triangles: mesh.triangles[..3].to_vec(), ..mesh.clone() };
        assert_eq!(open.open_edges(), 3);
        let mut turned = mesh.clone();
        turned.triangles[0] = [0, 1, 2];
        assert_eq!(turned.open_edges(), 3);
        let inverted =
            Mesh { triangles: mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..mesh.clone() };
        assert_eq!(inverted.open_edges(), 0);
        assert!(inverted.volume(true) < 0.0);
        // Every triangle with vertices of its own: places count.
        let positions = mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize]).collect();
        let apart =
            Mesh { positions, triangles: (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), ..mesh };
        assert_eq!(apart.open_edges(), 0);
    }
}
