//! Owns the tests of mesh files, sound and hostile.

use glam::{Vec2, Vec3};

use crate::mesh::{Mesh, read};

fn ok(bytes: &[u8], path: &str) -> Mesh {
    read(bytes, path, 1000).unwrap_or_else(|error| panic!("{error}"))
}

fn error(bytes: impl AsRef<[u8]>, path: &str) -> String {
    read(bytes.as_ref(), path, 1000).map_or_else(|error| error.to_string(), |_| "nothing".to_owned())
}

#[test]
fn obj_with_polygons_groups_and_relative_indices() {
    let mesh = ok(
        b"# square, then a triangle of its own object\n\
          mtllib none.mtl\no floor\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
          usemtl a\nf 1/1 2/2 3/3 4/4\no other\nv 0 0 5\nf -1/1 -4/2 -3/3\n",
        "a.obj",
    );
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    assert_eq!(mesh.positions[4..], [Vec3::new(0.0, 0.0, 5.0), Vec3::X, Vec3::new(1.0, 1.0, 0.0)]);
    assert_eq!((mesh.uvs[3], mesh.normals.len(), mesh.dropped), (Vec2::Y, 0, 0));
}

#[test]
fn obj_normals_of_some_vertices_belong_to_none() {
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";
    assert_eq!(ok(format!("{corners}f 1//1 2//1 3//1\n").as_bytes(), "a.obj").normals, [Vec3::Z; 3]);
    assert!(ok(format!("{corners}f 1//1 2 3\n").as_bytes(), "a.obj").normals.is_empty());
}

#[test]
fn obj_problems_name_the_line() {
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (rest, expected) in [
        ("f 1 2 4\n", "line 4: found the index 4, the file has 3 vertices, counted from 1"),
        ("f 0 1 2\n", "line 4: found the index 0, the file has 3 vertices, counted from 1"),
        ("f 1 2 -4\n", "line 4: found the index -4, the file has 3 vertices, counted from 1"),
        ("f 1/1 2/1 3/1\n", "line 4: found the index 1, the file has 0 texture coordinates, counted from 1"),
        (
            "f 1/-9223372036854775808 2 3\n",
            "line 4: found the index -9223372036854775808, the file has 0 texture \
                                             coordinates, counted from 1",
        ),
        ("\nf 1 2 x\n", "line 5: found the corner \"x\", expected v, v/vt, v//vn or v/vt/vn"),
        ("f 1/1/1/1 2 3\n", "line 4: found the index 1, the file has 0 texture coordinates, counted from 1"),
        ("v 0 zero 0\nf 1 2 3\n", "line 4: expected v with three numbers"),
        ("v 0 0", "line 4: expected v with three numbers"),
        ("v 0 nan 0\nf 1 2 4\n", "vertex 2: found the position [0, NaN, 0], expected finite numbers"),
        ("v 0 0 1e39\nf 1 2 4\n", "vertex 2: found the position [0, 0, inf], expected finite numbers"),
        (
            "f 1 2 4\no b\nv 0 0 0\nf 1 2 3",
            "line 5: found a face before its vertices, expected it after them",
        ),
        ("f\n", "line 4: expected f with at least three corners"),
    ] {
        assert_eq!(error(format!("{corners}{rest}"), "a.obj"), expected, "{rest}");
    }
}

#[test]
fn triangles_without_area_are_dropped_and_counted() {
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.5 0 0\nv 1 1e-13 0\n";
    let mesh = ok(format!("{corners}f 1 2 3\nf 1 1 2\nf 1 2 4\nf 1 2 5\n").as_bytes(), "a.obj");
    assert_eq!((mesh.triangles.len(), mesh.dropped), (1, 3));
}

#[test]
fn too_many_triangles_are_refused() {
    let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n", "1 2 3 ".repeat(400));
    assert_eq!(error(&text, "a.obj"), "has 1198 triangles, 1000 are left of the limit for all meshes");
    let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list int int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0\n";
    let text = format!("{header}1200 {}\n", "0 1 2 ".repeat(400));
    assert_eq!(error(&text, "a.ply"), "has 1198 triangles, 1000 are left of the limit for all meshes");
}

/// A header of a mesh with `vertices` and `faces`, with normals and coordinates.
fn header(format: &str, vertices: &str, faces: &str) -> String {
    let floats: String = ["x", "y", "z", "nx", "ny", "nz", "u", "v"]
        .iter()
        .map(|name| ["property float ", name, "\n"].concat())
        .collect();
    format!(
        "ply\nformat {format} 1.0\ncomment made by hand\nelement vertex {vertices}\n{floats}property uchar red\n\
         element face {faces}\nproperty int flags\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

/// A square of edge 2, as a binary PLY.
fn binary(big: bool) -> Vec<u8> {
    let name = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = header(name, "4", "1").into_bytes();
    let word = |bits: u32| if big { bits.to_be_bytes() } else { bits.to_le_bytes() };
    for (x, y) in [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)] {
        for value in [x, y, 0.0, 0.0, 0.0, 1.0, x / 2.0, y / 2.0_f32] {
            bytes.extend(word(value.to_bits()));
        }
        bytes.push(255);
    }
    bytes.extend(word(7));
    bytes.push(4);
    for index in [0, 1, 2, 3] {
        bytes.extend(word(index));
    }
    bytes
}

fn square() -> Mesh {
    let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    Mesh {
        positions: uvs.iter().map(|uv| (uv * 2.0).extend(0.0)).collect(),
        normals: vec![Vec3::Z; 4],
        uvs,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        dropped: 0,
    }
}

#[test]
fn ply_of_every_format() {
    assert_eq!(ok(&binary(false), "a.ply"), square());
    assert_eq!(ok(&binary(true), "a.PLY"), square());
    let rows = "0 0 0 0 0 1 0 0 9\n2 0 0 0 0 1 1 0 9\n2 2 0 0 0 1 1 1 9\n0 2 0 0 0 1 0 1 9\n-5 4 0 1 2 3";
    assert_eq!(ok((header("ascii", "4", "1") + rows).as_bytes(), "a.ply"), square());
}

#[test]
fn ply_headers_that_lie_take_no_memory() {
    for (vertices, faces, expected) in [
        (
            "4000000000",
            "1",
            "offset 325: found 153 bytes for 4000000000 rows of \"vertex\", expected at least",
        ),
        ("18446744073709551615", "1", "offset 335: found 153 bytes for 18446744073709551615 rows"),
        ("4", "4000000000", "bytes for 4000000000 rows of \"face\", expected at least"),
        ("-4", "1", "line 4: found \"element vertex -4\", expected a PLY header"),
        ("18446744073709551616", "1", "line 4: found \"element vertex 18446744073709551616\""),
    ] {
        let mut bytes = header("binary_little_endian", vertices, faces).into_bytes();
        let body = binary(false);
        bytes.extend(&body[header("binary_little_endian", "4", "1").len()..]);
        let found = error(&bytes, "a.ply");
        assert!(found.contains(expected), "{found}");
    }
    // A table without columns takes no bytes, however many rows it announces.
    let text = "ply\nformat ascii 1.0\nelement nothing 99999999999999\nend_header\n";
    assert_eq!(ok(text.as_bytes(), "a.ply"), Mesh::default());
}

#[test]
fn ply_problems_name_the_place() {
    let good = binary(false);
    let head = header("binary_little_endian", "4", "1").len();
    let with = |offset: usize, bytes: &[u8]| {
        let mut all = good.clone();
        all[head + offset..head + offset + bytes.len()].copy_from_slice(bytes);
        all
    };
    let (row, face) = (33, 4 * 33);
    for (bytes, expected) in [
        (
            with(2 * row, &f32::NAN.to_le_bytes()),
            "vertex 2: found the position [NaN, 2, 0], expected finite numbers",
        ),
        (
            with(row + 24, &f32::INFINITY.to_le_bytes()),
            "vertex 1: found the texture coordinate [inf, 0], expected finite numbers",
        ),
        (with(face + 4, &[2]), "face 0: found 2 corners, expected at least 3"),
        (with(face + 4, &[200]), "offset 453: found a list of 200 numbers, at most 4 follow"),
        (
            with(face + 5, &9_u32.to_le_bytes()),
            "triangle 0: found the vertex index 9, the mesh has 4 vertices",
        ),
        (with(face + 5, &(-1_i32).to_le_bytes()), "face 0: found the vertex index -1, expected one from 0"),
        (b"PLY\n".to_vec(), "line 1: found \"PLY\", expected a PLY header"),
        (b"ply\nend_header\n".to_vec(), "line 2: found no format before end_header"),
        (b"ply\nformat ascii 1.0\nelement face 1\n".to_vec(), "line 4: found no end_header within 64 KiB"),
        (vec![b'\n'; 1 << 20], "line 1: found \"\", expected a PLY header"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n".to_vec(),
            "header: found vertices without the properties x, y and z",
        ),
    ] {
        assert_eq!(error(&bytes, "a.ply"), expected);
    }
}

#[test]
fn damaged_files_never_panic() {
    let obj =
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1\nl 1 2\np 1\no x\nusemtl y\n"
            .to_vec();
    for (file, path) in [(binary(false), "a.ply"), (binary(true), "a.ply"), (obj, "a.obj")] {
        for at in 0..file.len() {
            drop(read(&file[..at], path, 1000));
            for byte in [0, 1, b' ', b'-', b'9', b'/', b'\n', 0x7f, 0xff] {
                let mut damaged = file.clone();
                damaged[at] = byte;
                drop(read(&damaged, path, 1000));
            }
        }
    }
}

/// The uv of the third corner of a triangle whose vertices have these two columns besides.
fn uv_under(names: [&str; 2]) -> Vec<Vec2> {
    let [u, v] = names;
    let text = format!(
        "ply\r\nformat ascii 1.0\r\nobj_info none\r\nelement vertex 3\r\nproperty double x\r\nproperty double y\r\n\
         property double z\r\nproperty float {u}\r\nproperty float {v}\r\nelement face 1\r\n\
         property list uint8 int32 vertex_index\r\nend_header\r\n0 0 0 0 0\r\n1 0 0 0 0\r\n0 1 0 0.25 -2.5e-1\r\n\
         3 0 1 2\r\n"
    );
    ok(text.as_bytes(), "a.ply").uvs
}

#[test]
fn ply_texture_coordinates_have_many_names() {
    for names in [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]] {
        assert_eq!(uv_under(names), [Vec2::ZERO, Vec2::ZERO, Vec2::new(0.25, -0.25)], "{names:?}");
    }
    assert!(uv_under(["u", "w"]).is_empty());
}

#[test]
fn ply_polygons_become_fans() {
    let header = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 3\nproperty list uchar int vertex_indices\nproperty list uchar float rest\nend_header\n";
    let rows = "0 0 0 2 0 0 3 1 0 1 2 0 -1 1 0\n5 0 1 2 3 4 0\n4 0 1 2 3 2 0.5 0.5\n3 4 0 1 1 9\n";
    let mesh = ok((header.to_owned() + rows).as_bytes(), "a.ply");
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [0, 2, 3], [4, 0, 1]]);
}

#[test]
fn ply_strips_are_refused_instead_of_lost() {
    let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n3 0 0 0\n";
    assert_eq!(error(text, "a.ply"), "header: found triangle strips, expected the element face");
}

#[test]
fn what_is_written_is_what_is_read() {
    let mut mesh = square();
    mesh.positions[2] = Vec3::new(1.0e3, 1.1e3, -f32::MIN_POSITIVE);
    for (normals, uvs) in [(true, true), (true, false), (false, true), (false, false)] {
        let mut mesh = mesh.clone();
        if !normals {
            mesh.normals.clear();
        }
        if !uvs {
            mesh.uvs.clear();
        }
        let bytes = mesh.to_ply();
        assert_eq!(bytes.len(), bytes.capacity());
        assert_eq!(ok(&bytes, "a.ply"), mesh);
    }
    // What not every vertex has is not written, so that no row is short.
    mesh.uvs.pop();
    assert!(ok(&mesh.to_ply(), "a.ply").uvs.is_empty());
}
