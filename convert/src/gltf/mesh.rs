//! Owns primitives: each becomes one mesh file, with the vertices that its triangles use.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};
use karst_core::mesh::Mesh;
use serde_json::json;

use super::accessor::Accessor;
use super::description::Primitive;
use super::output::{Output, add, file_name};
use super::reader::Reader;
use crate::ConvertError;

/// Triangles, each on three corners of its own.
const TRIANGLES: u32 = 4;
/// Triangles, each on the last two corners of the one before and a new one.
const STRIP: u32 = 5;
/// Triangles, each on the first corner of all, the last one of the one before and a new one.
const FAN: u32 = 6;

/// A mesh of the document.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    /// Name in the document.
    pub(super) name: String,
    /// Smallest coordinates of its vertices.
    pub(super) low: DVec3,
    /// Largest coordinates of its vertices.
    pub(super) high: DVec3,
}

/// Adds the primitive of a mesh to the document, with the texture coordinates of number `set`; nothing where it has
/// no triangles, which is noted.
pub(super) fn shape(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    mesh: u32,
    primitive: usize,
    set: u32,
) -> Result<Option<Shape>, ConvertError> {
    let described = &reader.root.meshes[mesh as usize];
    let place = format!("meshes[{mesh}].primitives[{primitive}]");
    let found = read(reader, output, &described.primitives[primitive], set, &place)?;
    let Some(found) = found.filter(|found| !found.triangles.is_empty()) else {
        output.untranslated(place, "has no triangles");
        return Ok(None);
    };
    let name = described.name.as_deref();
    let path = file_name("meshes", output.meshes.len(), name, "ply");
    let ply = found.to_ply().into();
    output.keep(path.clone(), ply).map_err(|message| reader.error(&place, message))?;
    let entry =
        if found.uvs.is_empty() { json!({"file": path}) } else { json!({"file": path, "flip_v": true}) };
    let name = add(&mut output.meshes, name, &format!("mesh_{mesh}"), entry);
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = found.positions.iter().fold(start, |(low, high), p| (low.min(*p), high.max(*p)));
    Ok(Some(Shape { name, low: low.as_dvec3(), high: high.as_dvec3() }))
}

/// What a primitive says of its vertices.
struct Vertices<'a> {
    positions: Accessor<'a, 3>,
    normals: Option<Accessor<'a, 3>>,
    uvs: Option<Accessor<'a, 2>>,
}

fn read(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    primitive: &Primitive,
    set: u32,
    place: &str,
) -> Result<Option<Mesh>, ConvertError> {
    if primitive.extensions.contains_key("KHR_draco_mesh_compression") {
        let hint = "write the file again without compression of meshes";
        return Err(reader
            .error(place, "packed by KHR_draco_mesh_compression, which is not read")
            .with_hint(hint));
    }
    output.others(place, &primitive.extensions);
    match primitive.mode {
        0..TRIANGLES => return Ok(None),
        TRIANGLES..=FAN => {}
        mode => return Err(reader.error(place, format!("found the mode {mode}, expected 0 to 6"))),
    }
    if !primitive.targets.is_empty() {
        output.untranslated(place, "morph targets: the mesh is as it is without them");
    }
    if primitive.attributes.keys().any(|name| name.starts_with("COLOR_")) {
        output.untranslated(place, "colours of vertices");
    }
    let Some(vertices) = vertices(reader, output, primitive, set, place)? else { return Ok(None) };
    let indices = match primitive.indices {
        None => None,
        Some(index) => {
            let here = format!("{place}.indices");
            let found = Accessor::<1>::open(reader, index, &here, &mut output.elements)?;
            if !found.is_unsigned() {
                return Err(reader.error(here, "expected unsigned integers"));
            }
            Some(found)
        }
    };
    let count = indices.as_ref().map_or(vertices.positions.count(), Accessor::count);
    let triangles = if primitive.mode == TRIANGLES { count / 3 } else { count.saturating_sub(2) };
    let left = output.triangles.min(output.elements / 3);
    if triangles > left {
        let message = format!("has {triangles} triangles, {left} are left of the limit for all meshes");
        return Err(reader.error(place, message));
    }
    output.triangles -= triangles;
    output.elements -= 3 * triangles;
    let mut made = Made { reader, place, vertices, numbers: HashMap::new(), mesh: Mesh::default() };
    for triangle in 0..triangles as u32 {
        let corners = corners(primitive.mode, triangle)
            .map(|corner| indices.as_ref().map_or(corner, |indices| indices.get(corner)[0] as u32));
        made.push(corners)?;
    }
    Ok(Some(made.mesh))
}

fn vertices<'a>(
    reader: &'a Reader<'_>,
    output: &mut Output<'_>,
    primitive: &Primitive,
    set: u32,
    place: &str,
) -> Result<Option<Vertices<'a>>, ConvertError> {
    let attribute =
        |name: &str| Some((*primitive.attributes.get(name)?, format!("{place}.attributes.{name}")));
    let left = &mut output.elements;
    let Some((index, here)) = attribute("POSITION") else { return Ok(None) };
    let positions = Accessor::<3>::open(reader, index, &here, left)?;
    let normals = match attribute("NORMAL") {
        None => None,
        Some((index, here)) => Some(Accessor::<3>::open(reader, index, &here, left)?),
    };
    let uvs = match attribute(&format!("TEXCOORD_{set}")) {
        None => None,
        Some((index, here)) => Some(Accessor::<2>::open(reader, index, &here, left)?),
    };
    let counts = [normals.as_ref().map(Accessor::count), uvs.as_ref().map(Accessor::count)];
    let count = positions.count();
    if let Some(other) = counts.into_iter().flatten().find(|other| *other != count) {
        let message = format!("found {count} positions and {other} of another attribute");
        return Err(reader.error(format!("{place}.attributes"), message));
    }
    Ok(Some(Vertices { positions, normals, uvs }))
}

/// Which corners of the row a triangle has, as the format says.
fn corners(mode: u32, triangle: u32) -> [u32; 3] {
    match mode {
        STRIP => {
            let odd = triangle % 2;
            [triangle, triangle + 1 + odd, triangle + 2 - odd]
        }
        FAN => [triangle + 1, triangle + 2, 0],
        _ => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
    }
}

/// A mesh while its triangles are added.
struct Made<'a> {
    reader: &'a Reader<'a>,
    place: &'a str,
    vertices: Vertices<'a>,
    /// Numbers that the vertices of the primitive have in the mesh.
    numbers: HashMap<u32, u32>,
    mesh: Mesh,
}

impl Made<'_> {
    fn push(&mut self, corners: [u32; 3]) -> Result<(), ConvertError> {
        let mut triangle = [0; 3];
        for (number, vertex) in triangle.iter_mut().zip(corners) {
            *number = match self.numbers.get(&vertex) {
                Some(number) => *number,
                None => self.vertex(vertex)?,
            };
        }
        self.mesh.triangles.push(triangle);
        Ok(())
    }

    /// Adds a vertex of the primitive to the mesh and gives its number there.
    fn vertex(&mut self, vertex: u32) -> Result<u32, ConvertError> {
        let Vertices { positions, normals, uvs } = &self.vertices;
        let count = positions.count();
        if u64::from(vertex) >= count {
            let message = format!("found the vertex index {vertex}, the primitive has {count} vertices");
            return Err(self.reader.error(format!("{}.indices", self.place), message));
        }
        let position = DVec3::from(positions.get(vertex)).as_vec3();
        let normal = normals.as_ref().map(|normals| DVec3::from(normals.get(vertex)).as_vec3());
        let uv = uvs.as_ref().map(|uvs| DVec2::from(uvs.get(vertex)).as_vec2());
        let finite = position.is_finite()
            && normal.is_none_or(|normal| normal.is_finite())
            && uv.is_none_or(|uv| uv.is_finite());
        if !finite {
            let found = [
                Some(format!("position {position}")),
                normal.map(|normal| format!("normal {normal}")),
                uv.map(|uv| format!("texture coordinate {uv}")),
            ];
            let found = found.into_iter().flatten().collect::<Vec<_>>().join(", ");
            let message = format!("vertex {vertex}: found {found}, expected finite numbers");
            return Err(self.reader.error(self.place, message));
        }
        let number = self.mesh.positions.len() as u32;
        self.mesh.positions.push(position);
        self.mesh.normals.extend(normal);
        self.mesh.uvs.extend(uv);
        self.numbers.insert(vertex, number);
        Ok(number)
    }
}
