//! Owns shapes that become meshes: Mitsuba's own positions, normals and texture coordinates.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use karst_core::mesh::Mesh;

/// Segments around a circle.
const AROUND: u32 = 256;
/// Segments from pole to pole.
const DOWN: u32 = 128;

/// Adds a vertex; v runs downwards in Mitsuba and upwards here.
fn push(mesh: &mut Mesh, position: DVec3, normal: DVec3, uv: DVec2) {
    mesh.positions.push(position.as_vec3());
    mesh.normals.push(normal.as_vec3());
    mesh.uvs.push(DVec2::new(uv.x, 1.0 - uv.y).as_vec2());
}

/// Adds the two triangles of a quadrilateral.
fn quad(mesh: &mut Mesh, [a, b, c, d]: [u32; 4]) {
    mesh.triangles.extend([[a, b, c], [a, c, d]]);
}

/// The square from (−1, −1, 0) to (1, 1, 0), facing z.
pub(super) fn rectangle() -> Mesh {
    let mut mesh = Mesh::default();
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        push(&mut mesh, DVec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0), DVec3::Z, DVec2::new(u, v));
    }
    quad(&mut mesh, [0, 1, 2, 3]);
    mesh
}

/// Faces of the cube: the corners that have the texture coordinates (0, 1), (1, 1), (1, 0) and (0, 0), and the normal.
const FACES: [([[i8; 3]; 4], [i8; 3]); 6] = [
    ([[1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1]], [0, -1, 0]),
    ([[1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]], [0, 1, 0]),
    ([[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]], [1, 0, 0]),
    ([[1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]], [0, 0, 1]),
    ([[-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1]], [-1, 0, 0]),
    ([[1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]], [0, 0, -1]),
];

/// The cube from −1 to 1.
pub(super) fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    let vector = |v: [i8; 3]| DVec3::from_array(v.map(f64::from));
    for (corners, normal) in FACES {
        let first = mesh.positions.len() as u32;
        for (corner, uv) in corners.into_iter().zip([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]) {
            push(&mut mesh, vector(corner), vector(normal), DVec2::from(uv));
        }
        quad(&mut mesh, [first, first + 1, first + 2, first + 3]);
    }
    mesh
}

/// A point of the unit circle, at a share of a turn.
fn circle(turn: f64) -> DVec2 {
    DVec2::new(libm::cos(TAU * turn), libm::sin(TAU * turn))
}

/// The unit disk in the plane z = 0, facing z; u is the distance from the middle, v the angle.
pub(super) fn disk() -> Mesh {
    let mut mesh = Mesh::default();
    for segment in 0..AROUND {
        let first = mesh.positions.len() as u32;
        let turn = |part: f64| (f64::from(segment) + part) / f64::from(AROUND);
        push(&mut mesh, DVec3::ZERO, DVec3::Z, DVec2::new(0.0, turn(0.5)));
        for part in [0.0, 1.0] {
            push(&mut mesh, circle(turn(part)).extend(0.0), DVec3::Z, DVec2::new(1.0, turn(part)));
        }
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// The cylinder of radius 1 around z from 0 to 1, open at both ends, facing outwards.
pub(super) fn cylinder() -> Mesh {
    let mut mesh = Mesh::default();
    for segment in 0..=AROUND {
        let u = f64::from(segment) / f64::from(AROUND);
        let normal = circle(u).extend(0.0);
        for v in [0.0, 1.0] {
            push(&mut mesh, normal + DVec3::Z * v, normal, DVec2::new(u, v));
        }
    }
    for segment in 0..AROUND {
        let first = 2 * segment;
        quad(&mut mesh, [first, first + 2, first + 3, first + 1]);
    }
    mesh
}

/// The unit sphere with its poles on z, facing outwards; u is the angle around z from x, v that from z.
pub(super) fn sphere() -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=DOWN {
        let v = f64::from(row) / f64::from(DOWN);
        let (height, radius) = (libm::cos(PI * v), libm::sin(PI * v));
        for column in 0..=AROUND {
            let u = f64::from(column) / f64::from(AROUND);
            let normal = (circle(u) * radius).extend(height);
            push(&mut mesh, normal, normal, DVec2::new(u, v));
        }
    }
    let at = |row: u32, column: u32| row * (AROUND + 1) + column;
    for row in 0..DOWN {
        for column in 0..AROUND {
            let [a, b] = [at(row, column), at(row + 1, column)];
            // At the poles one side of the quadrilateral is a point.
            if row + 1 < DOWN {
                mesh.triangles.push([a, b, b + 1]);
            }
            if row > 0 {
                mesh.triangles.push([a, b + 1, a + 1]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::{Mesh, cube, cylinder, disk, rectangle, sphere};
    use glam::Vec3;
    use std::f32::consts::PI;

    fn area(mesh: &Mesh) -> f32 {
        let of = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|at| mesh.positions[at as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        mesh.triangles.iter().map(of).sum()
    }

    #[test]
    fn triangles_face_as_their_normals_and_cover_the_shape() {
        for (mesh, expected) in
            [(rectangle(), 4.0), (cube(), 24.0), (disk(), PI), (cylinder(), 2.0 * PI), (sphere(), 4.0 * PI)]
        {
            for corners in &mesh.triangles {
                let [a, b, c] = corners.map(|at| mesh.positions[at as usize]);
                let face = (b - a).cross(c - a);
                assert!(face.length() > 0.0);
                for corner in corners {
                    assert!(face.dot(mesh.normals[*corner as usize]) > 0.0, "{corners:?}");
                }
            }
            let found = area(&mesh);
            assert!((found / expected - 1.0).abs() < 3e-4, "{found} for {expected}");
            assert_eq!((mesh.normals.len(), mesh.uvs.len()), (mesh.positions.len(), mesh.positions.len()));
        }
    }

    #[test]
    fn texture_coordinates_are_those_of_mitsuba_turned_upwards() {
        let uv = |mesh: &Mesh, p: Vec3| {
            let at = mesh.positions.iter().position(|q| (*q - p).length() < 1e-6).unwrap();
            mesh.uvs[at].to_array()
        };
        assert_eq!(uv(&rectangle(), Vec3::new(1.0, -1.0, 0.0)), [1.0, 1.0]);
        assert_eq!(uv(&sphere(), Vec3::Z)[1], 1.0);
        assert_eq!(uv(&sphere(), Vec3::Y), [0.25, 0.5]);
        assert_eq!(uv(&cylinder(), Vec3::new(0.0, 1.0, 1.0)), [0.25, 0.0]);
        assert_eq!(uv(&disk(), Vec3::NEG_X), [1.0, 0.5]);
        assert_eq!(uv(&cube(), Vec3::new(1.0, -1.0, 1.0)), [1.0, 0.0]);
    }
}
