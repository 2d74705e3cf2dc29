//! Owns reading Wavefront OBJ: a check that names lines, then tobj.

use std::cell::Cell;
use std::io::{BufRead, Read, Result as IoResult};

use glam::{Vec2, Vec3};
use tobj::{LoadError, LoadOptions};

use crate::mesh::{Mesh, MeshError, check_count};

/// Reads an OBJ file; its objects, groups and materials become one mesh.
pub(super) fn read(bytes: &[u8], max_triangles: u64) -> Result<Mesh, MeshError> {
    let text = String::from_utf8_lossy(bytes);
    check_count(check_faces(&text)?, max_triangles)?;
    let lines = Cell::new(0);
    let mut reader = LineReader { left: text.as_bytes(), lines: &lines };
    let options =
        LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    // Materials of the file are not used: the scene document gives them.
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, |_| Ok(<_>::default()))
        .map_err(|error| MeshError::new(format!("line {}", lines.get()), words(error)))?;
    let mut mesh = Mesh::default();
    for model in models {
        append(&mut mesh, &model.mesh)?;
    }
    // What not every vertex has belongs to none.
    if mesh.normals.len() != mesh.positions.len() {
        mesh.normals.clear();
    }
    if mesh.uvs.len() != mesh.positions.len() {
        mesh.uvs.clear();
    }
    Ok(mesh)
}

fn append(mesh: &mut Mesh, part: &tobj::Mesh) -> Result<(), MeshError> {
    let first = mesh.positions.len();
    let vec3 = |v: &[f32; 3]| Vec3::from_array(*v);
    mesh.positions.extend(part.positions.as_chunks::<3>().0.iter().map(vec3));
    mesh.normals.extend(part.normals.as_chunks::<3>().0.iter().map(vec3));
    mesh.uvs.extend(part.texcoords.as_chunks::<2>().0.iter().map(|uv| Vec2::from_array(*uv)));
    let many = || MeshError::new("file", "has more than 2^32 vertices");
    let first = u32::try_from(first).map_err(|_| many())?;
    u32::try_from(mesh.positions.len()).map_err(|_| many())?;
    mesh.triangles.extend(part.indices.as_chunks::<3>().0.iter().map(|t| t.map(|index| index + first)));
    Ok(())
}

/// Checks the indices of all faces against the vertices of the file; gives the number of triangles.
///
/// tobj reports these without a line, and multiplies indices before it checks them.
fn check_faces(text: &str) -> Result<u64, MeshError> {
    let count = |keyword: &str| {
        text.lines().filter(|line| line.split_ascii_whitespace().next() == Some(keyword)).count() as i64
    };
    let totals =
        [("v", "vertices"), ("vt", "texture coordinates"), ("vn", "normals")].map(|(k, w)| (count(k), w));
    let mut so_far = [0_i64; 3];
    let mut triangles = 0_u64;
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => so_far[0] += 1,
            Some("vt") => so_far[1] += 1,
            Some("vn") => so_far[2] += 1,
            Some("f" | "l") => {
                let mut corners = 0_u64;
                for word in words {
                    corners += 1;
                    check_corner(word, &totals, &so_far)
                        .map_err(|message| MeshError::new(format!("line {}", number + 1), message))?;
                }
                triangles += corners.saturating_sub(2);
            }
            _ => {}
        }
    }
    Ok(triangles)
}

/// Checks a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` of a face.
fn check_corner(corner: &str, totals: &[(i64, &str); 3], so_far: &[i64; 3]) -> Result<(), String> {
    let malformed = || format!("found the corner {corner:.40?}, expected v, v/vt, v//vn or v/vt/vn");
    for (place, index) in corner.split('/').enumerate() {
        if index.is_empty() && place > 0 {
            continue;
        }
        let &(total, what) = totals.get(place).ok_or_else(malformed)?;
        let number: i64 = index.parse().map_err(|_| malformed())?;
        let within = (1..=total).contains(&number) || (-so_far[place]..0).contains(&number);
        if !within {
            return Err(format!("found the index {number}, the file has {total} {what}, counted from 1"));
        }
    }
    Ok(())
}

fn words(error: LoadError) -> &'static str {
    match error {
        LoadError::PositionParseError => "expected v with three numbers",
        LoadError::NormalParseError => "expected vn with three numbers",
        LoadError::TexcoordParseError => "expected vt with two numbers",
        LoadError::ColorParseError | LoadError::FaceColorOutOfBounds => {
            "expected v with x y z, or with x y z and a colour at every vertex"
        }
        LoadError::ScalingByZeroError => "found the weight 0 of a vertex, expected another number",
        LoadError::FaceParseError | LoadError::InvalidPolygon => "expected f with at least three corners",
        LoadError::FaceVertexOutOfBounds => "found a face before its vertices, expected it after them",
        LoadError::FaceTexCoordOutOfBounds => {
            "found a face before its texture coordinates, expected it after them"
        }
        LoadError::FaceNormalOutOfBounds => "found a face before its normals, expected it after them",
        LoadError::OpenFileFailed
        | LoadError::ReadError
        | LoadError::UnrecognizedCharacter
        | LoadError::MaterialParseError
        | LoadError::InvalidObjectName
        | LoadError::InvalidLoadOptionConfig
        | LoadError::GenericFailure => "not an OBJ file that can be read",
    }
}

/// Bytes that are read line by line, with a count of the lines.
struct LineReader<'a> {
    left: &'a [u8],
    lines: &'a Cell<u64>,
}

impl Read for LineReader<'_> {
    fn read(&mut self, into: &mut [u8]) -> IoResult<usize> {
        let length = self.fill_buf()?.read(into)?;
        self.consume(length);
        Ok(length)
    }
}

impl BufRead for LineReader<'_> {
    /// One line at a time, its end included.
    fn fill_buf(&mut self) -> IoResult<&[u8]> {
        let end = self.left.iter().position(|&byte| byte == b'\n').map_or(self.left.len(), |at| at + 1);
        Ok(&self.left[..end])
    }

    fn consume(&mut self, length: usize) {
        let (consumed, left) = self.left.split_at(length);
        let ends = consumed.ends_with(b"\n") || (length > 0 && left.is_empty());
        self.lines.set(self.lines.get() + u64::from(ends));
        self.left = left;
    }
}
