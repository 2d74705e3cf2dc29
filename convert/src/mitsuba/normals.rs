//! Owns the normals of mesh files: whether there are any, and the smooth ones that Mitsuba makes where there are none.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use glam::DVec3;
use karst_core::mesh::{self, Mesh};
use karst_core::scene::Limits;

/// Longest header of a PLY file, in bytes.
const MAX_HEADER: u64 = 1 << 16;

/// Whether a mesh file has normals; what is wrong with the file otherwise is found when it is loaded.
pub(super) fn in_file(path: &Path, kind: &str) -> Result<bool, String> {
    let file = File::open(path).map_err(|error| format!("file {:?}: {error}", path.display().to_string()))?;
    let limit = if kind == "ply" { MAX_HEADER } else { Limits::default().max_asset_bytes };
    let mut reader = BufReader::new(file.take(limit));
    let mut line = Vec::new();
    loop {
        line.clear();
        let length = reader.read_until(b'\n', &mut line);
        if length.map_err(|error| format!("file {:?}: {error}", path.display().to_string()))? == 0 {
            return Ok(false);
        }
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let found = match (kind, words.next()) {
            ("ply", Some(b"end_header")) => return Ok(false),
            ("ply", Some(b"property")) => words.nth(1) == Some(b"nx"),
            (_, Some(b"vn")) => kind != "ply",
            _ => false,
        };
        if found {
            return Ok(true);
        }
    }
}

/// A mesh file with normals that are means over the triangles at a vertex, weighed by their angles there (Thürmer and
/// Wüthrich 1998).
pub(super) fn smooth(path: &Path) -> Result<Mesh, String> {
    let name = path.display().to_string();
    let wrong = |error: &dyn std::fmt::Display| format!("file {name:?}: {error}");
    let limits = Limits::default();
    let size = std::fs::metadata(path).map_err(|error| wrong(&error))?.len();
    if size > limits.max_asset_bytes {
        return Err(wrong(&format!("has {size} bytes, the limit is {}", limits.max_asset_bytes)));
    }
    let bytes = std::fs::read(path).map_err(|error| wrong(&error))?;
    let mesh = mesh::read(&bytes, &name, limits.max_triangles).map_err(|error| wrong(&error))?;
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|at| mesh.positions[at as usize].as_dvec3());
        let face = (b - a).cross(c - a).normalize_or_zero();
        for (at, [p, q, r]) in corners.iter().zip([[a, b, c], [b, c, a], [c, a, b]]) {
            let cosine = (q - p).normalize_or_zero().dot((r - p).normalize_or_zero());
            sums[*at as usize] += face * libm::acos(cosine.clamp(-1.0, 1.0));
        }
    }
    let normals = sums.into_iter().map(|sum| sum.try_normalize().unwrap_or(DVec3::X).as_vec3()).collect();
    Ok(Mesh { normals, ..mesh })
}

#[cfg(test)]
mod tests {
    use super::{in_file, smooth};
    use glam::Vec3;

    #[test]
    fn normals_are_found_or_made() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let roof =
            write("roof.obj", "v 0 0 0\nv 0 0 2\nv 1 1 0\nv 1 1 2\nv 2 0 0\nv 2 0 2\nf 1 2 4 3\nf 3 4 6 5\n");
        assert_eq!(in_file(&roof, "obj"), Ok(false));
        assert_eq!(in_file(&write("n.obj", "v 0 0 0\n vn 0 0 1\n"), "obj"), Ok(true));
        let header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n";
        assert_eq!(
            in_file(&write("a.ply", &format!("{header}end_header\nproperty float nx\n")), "ply"),
            Ok(false)
        );
        assert_eq!(
            in_file(&write("b.ply", &format!("{header}property float nx\nend_header\n")), "ply"),
            Ok(true)
        );
        assert!(in_file(&folder.path().join("none.ply"), "ply").is_err());
        let made = smooth(&roof).unwrap();
        let normal = |p: Vec3| made.normals[made.positions.iter().position(|q| *q == p).unwrap()];
        assert!((normal(Vec3::new(1.0, 1.0, 0.0)) - Vec3::Y).length() < 1e-6);
        assert!((normal(Vec3::ZERO) - Vec3::new(-1.0, 1.0, 0.0).normalize()).length() < 1e-6);
    }
}
