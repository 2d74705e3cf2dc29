//! Owns PLY: reading ascii, binary little endian and binary big endian, and writing.

mod body;
mod header;
mod write;

use glam::{Vec2, Vec3};

use crate::mesh::{Mesh, MeshError, check_count};
use body::Body;
use header::{Element, Header, Property};

/// Reads a PLY file: `x y z` of each `vertex`, normals `nx ny nz` and coordinates `u v` or `s t` where they
/// are, and the `vertex_indices` of each `face`. Everything else is skipped.
pub(super) fn read(bytes: &[u8], max_triangles: u64) -> Result<Mesh, MeshError> {
    let header = Header::read(bytes)?;
    let mut body = Body::new(header.format, &bytes[header.length..], header.length);
    let mut mesh = Mesh::default();
    for element in &header.elements {
        body.expect(element)?;
        match element.name.as_str() {
            "vertex" => read_vertices(&mut mesh, element, &mut body)?,
            "face" => read_faces(&mut mesh, element, &mut body, max_triangles)?,
            // Skipped, it would be a mesh without triangles, and nobody would know why.
            "tristrips" if element.count > 0 => {
                return Err(MeshError::new("header", "found triangle strips, expected the element face"));
            }
            _ => skip(element, &mut body)?,
        }
    }
    Ok(mesh)
}

/// Where the properties of a vertex go: positions, normals, texture coordinates.
const SLOTS: [&[&str]; 8] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["u", "s", "texture_u", "texture_s"],
    &["v", "t", "texture_v", "texture_t"],
];

fn read_vertices(mesh: &mut Mesh, element: &Element, body: &mut Body<'_>) -> Result<(), MeshError> {
    let slot_of = |property: &Property| {
        let scalar = property.list.is_none();
        SLOTS.iter().position(|names| scalar && names.contains(&property.name.as_str()))
    };
    let slots: Vec<Option<usize>> = element.properties.iter().map(slot_of).collect();
    let has = |slot: usize| slots.contains(&Some(slot));
    if !(has(0) && has(1) && has(2)) {
        return Err(MeshError::new("header", "found vertices without the properties x, y and z"));
    }
    let (normals, uvs) = (has(3) && has(4) && has(5), has(6) && has(7));
    if u32::try_from(element.count).is_err() {
        return Err(MeshError::new(
            "header",
            format!("found {} vertices, the limit is 2^32 - 1", element.count),
        ));
    }
    for _ in 0..element.count {
        let mut values = [0.0_f32; 8];
        for (property, slot) in element.properties.iter().zip(&slots) {
            match (slot, property.list) {
                (Some(slot), _) => values[*slot] = body.number(property.kind)? as f32,
                (None, None) => drop(body.number(property.kind)?),
                (None, Some(_)) => skip_list(property, body)?,
            }
        }
        let [x, y, z, nx, ny, nz, u, v] = values;
        mesh.positions.push(Vec3::new(x, y, z));
        if normals {
            mesh.normals.push(Vec3::new(nx, ny, nz));
        }
        if uvs {
            mesh.uvs.push(Vec2::new(u, v));
        }
    }
    Ok(())
}

fn read_faces(mesh: &mut Mesh, element: &Element, body: &mut Body<'_>, left: u64) -> Result<(), MeshError> {
    let is_corners =
        |p: &Property| p.list.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index");
    if !element.properties.iter().any(is_corners) {
        return Err(MeshError::new("header", "found faces without the list property vertex_indices"));
    }
    let mut corners: Vec<u32> = Vec::new();
    for face in 0..element.count {
        for property in &element.properties {
            match property.list {
                Some(_) if is_corners(property) => {
                    let fits = |more| check_count(mesh.triangles.len() as u64 + more, left);
                    read_corners(&mut corners, face, property, body, fits)?;
                }
                Some(_) => skip_list(property, body)?,
                None => drop(body.number(property.kind)?),
            }
        }
        for pair in corners[1..].windows(2) {
            mesh.triangles.push([corners[0], pair[0], pair[1]]);
        }
    }
    Ok(())
}

fn read_corners(
    corners: &mut Vec<u32>,
    face: u64,
    list: &Property,
    body: &mut Body<'_>,
    fits: impl Fn(u64) -> Result<(), MeshError>,
) -> Result<(), MeshError> {
    let place = || format!("face {face}");
    let count = body.length(list)?;
    if count < 3 {
        return Err(MeshError::new(place(), format!("found {count} corners, expected at least 3")));
    }
    fits(count - 2)?;
    corners.clear();
    for _ in 0..count {
        let index = body.number(list.kind)?;
        // Indices beyond the vertices are found when all elements have been read.
        if !(index >= 0.0 && index <= f64::from(u32::MAX) && index.fract() == 0.0) {
            return Err(MeshError::new(
                place(),
                format!("found the vertex index {index}, expected one from 0"),
            ));
        }
        corners.push(index as u32);
    }
    Ok(())
}

fn skip(element: &Element, body: &mut Body<'_>) -> Result<(), MeshError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            match property.list {
                Some(_) => skip_list(property, body)?,
                None => drop(body.number(property.kind)?),
            }
        }
    }
    Ok(())
}

fn skip_list(list: &Property, body: &mut Body<'_>) -> Result<(), MeshError> {
    for _ in 0..body.length(list)? {
        body.number(list.kind)?;
    }
    Ok(())
}
