//! Owns shapes: meshes from files, and the shapes that have a formula.

use glam::{DAffine3, DMat3, DMat4, DVec3};
use karst_core::mesh::Mesh;
use serde_json::{Map, Value as Json, json};

use super::bsdf::{default_material, material, uses_uv};
use super::emitter::emission;
use super::medium::medium;
use super::normals;
use super::object::Object;
use super::output::{Output, Table};
use super::primitive;
use super::texture::ending;
use super::transform::{affine, similarity, tangents};
use crate::ConvertError;
use crate::parts::{transform, unsigned};

/// How a shape looks, whatever it is.
struct Look {
    material: String,
    emission: [f64; 3],
    flip: bool,
    /// Name of the medium inside.
    interior: Option<String>,
}

/// Adds a shape to the document.
pub(super) fn shape(out: &mut Output<'_>, index: usize) -> Result<(), ConvertError> {
    let object = out.object(index);
    let to_world = object.transform("to_world")?;
    match object.plugin.as_str() {
        "ply" | "obj" => file(out, object, &to_world),
        "sphere" => sphere(out, object, &to_world),
        "rectangle" => made(out, object, &to_world, "rectangle", primitive::rectangle),
        "cube" => made(out, object, &to_world, "cube", primitive::cube),
        "disk" => {
            out.differs(&object.place, "a disk becomes a mesh of 256 triangles");
            made(out, object, &to_world, "disk", primitive::disk)
        }
        "cylinder" => {
            out.differs(&object.place, "a cylinder becomes a mesh of 512 triangles");
            let to_world = to_world * along(object)?;
            made(out, object, &to_world, "cylinder", primitive::cylinder)
        }
        _ => {
            out.untranslated(&object.place, format!("a {}", object.title()));
            object.properties.iter().for_each(|property| property.used.set(true));
            Ok(())
        }
    }
}

/// What to call a shape.
fn title(object: &Object) -> &str {
    object.id.as_deref().unwrap_or(&object.plugin)
}

/// Material, light and side of a shape.
fn look(out: &mut Output<'_>, object: &Object, name: &str) -> Result<Look, ConvertError> {
    let (mut bsdf, mut light, mut boundary, mut interior) = (None, None, false, None);
    for (property, index) in object.nested() {
        let inner = &out.scene.objects[index];
        match inner.tag.as_str() {
            "bsdf" if bsdf.is_none() => bsdf = Some(index),
            "emitter" => light = Some(emission(out, index)?),
            "medium" => {
                boundary = true;
                let name = medium(out, index)?;
                if property.name == "interior" {
                    out.fillings.extend(name.clone());
                    interior = name;
                } else if let Some(name) = name {
                    out.surroundings.push((property.place.clone(), name));
                }
            }
            // Whatever it is, it stays unused and is noted.
            _ => continue,
        }
        property.used.set(true);
    }
    let material = match bsdf {
        Some(index) => material(out, index, name)?,
        // A light is one, however little it shines.
        None => default_material(out, light.is_some(), boundary),
    };
    let flip = object.flag("flip_normals", false)?;
    Ok(Look { material, emission: light.unwrap_or_default(), flip, interior })
}

/// Says where y of a normal map points the other way: here it runs along v, in Mitsuba along the normal × u. These are
/// opposite where an image on the surface appears mirrored, from the side of its normal; `mirrored` says whether it does
/// on the shape as it was made, which is not known of a mesh from a file.
fn note_normal_map(
    out: &mut Output<'_>,
    object: &Object,
    look: &Look,
    map: &DAffine3,
    mirrored: Option<bool>,
) {
    let mapped = |material: &Json| material.get("normal_map").is_some();
    if !out.get(Table::Materials, &look.material).is_some_and(mapped) {
        return;
    }
    let turned = (map.matrix3.determinant() < 0.0) != look.flip;
    let place = match mirrored {
        Some(mirrored) if mirrored == turned => return,
        Some(_) => "here",
        None => "where texture coordinates are mirrored",
    };
    let text = format!(
        "y of a normal map runs along v, in Mitsuba along the normal × u, which is the other way {place}"
    );
    out.differs(&object.place, text);
}

fn placed(map: &DAffine3, object: &Object) -> Result<Json, ConvertError> {
    let place = object.get("to_world").map_or(&object.place, |property| &property.place);
    let sound = map.is_finite() && map.matrix3.determinant() != 0.0 && map.inverse().is_finite();
    if !sound {
        let error =
            place.error("found a transform that cannot be inverted, expected one that flattens nothing");
        return Err(error.with_hint("a scale of 0 along one direction is one cause"));
    }
    Ok(transform(map))
}

/// Places a mesh.
fn instance(
    out: &mut Output<'_>,
    object: &Object,
    (name, mesh): (String, String),
    map: &DAffine3,
    look: &Look,
) -> Result<(), ConvertError> {
    let mut fields = Map::new();
    fields.insert("mesh".to_owned(), json!(mesh));
    fields.insert("material".to_owned(), json!(look.material));
    let transform = placed(map, object)?;
    if *map != DAffine3::IDENTITY {
        fields.insert("transform".to_owned(), transform);
    }
    shine(&mut fields, look);
    out.add(Table::Instances, name, fields);
    Ok(())
}

fn shine(fields: &mut Map<String, Json>, look: &Look) {
    if look.emission != [0.0; 3] {
        fields.insert("emission".to_owned(), json!(look.emission));
    }
    if look.flip {
        fields.insert("flip_normals".to_owned(), json!(true));
    }
    if let Some(interior) = &look.interior {
        fields.insert("interior".to_owned(), json!(interior));
    }
}

/// A mesh in a file.
fn file(out: &mut Output<'_>, object: &Object, to_world: &DMat4) -> Result<(), ConvertError> {
    let Some(file_name) = object.text("filename")? else {
        return Err(object.place.error(format!("found a {} without \"filename\"", object.title())));
    };
    let place = object.get("filename").map_or(&object.place, |property| &property.place);
    let source = out.find(file_name, place)?;
    let kind = ending(&source);
    if kind != object.plugin {
        let expected = &object.plugin;
        return Err(
            place.error(format!("found the file {file_name:?}, expected a name that ends in .{expected}"))
        );
    }
    object.ignore(&["collapse", "srgb"]);
    if object.integer("shape_index")?.is_some_and(|index| index >= 0) {
        out.untranslated(&object.place, "shape_index: the whole file is placed, not one of its meshes");
    }
    if object.flag("load_materials", false)? {
        out.untranslated(&object.place, "load_materials: the materials of the .mtl file");
    }
    if object.number("max_smooth_angle")?.is_some() {
        out.differs(&object.place, "edges over max_smooth_angle are smooth too");
    }
    let stem = source.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let name = out.name(Table::Instances, object.id.as_deref().unwrap_or(&stem));
    let mut look = look(out, object, &name)?;
    let face_normals = object.flag("face_normals", false)?;
    let flipped = object.flag("flip_tex_coords", kind == "obj")?;
    let textured = out.get(Table::Materials, &look.material).is_some_and(uses_uv);
    // Without normals in the file Mitsuba makes smooth ones.
    let without =
        !face_normals && !normals::in_file(&source, &kind).map_err(|message| place.error(message))?;
    // Mitsuba looks at the winding after the transform, karst before.
    if (face_normals || without) && affine(to_world).matrix3.determinant() < 0.0 {
        look.flip = !look.flip;
    }
    let options = [("face_normals", face_normals), ("flip_v", !flipped && textured)];
    let key = format!("{}|{options:?}|{without}", source.display());
    let mesh = if let Some(mesh) = out.meshes.get(&key) {
        mesh.clone()
    } else {
        let path = if without {
            let smooth = normals::smooth(&source).map_err(|message| place.error(message))?;
            out.bytes("meshes", &format!("{stem}-smooth.ply"), smooth.to_ply())
        } else {
            out.file("meshes", &source)
        };
        let mut entry = Map::from_iter([("file".to_owned(), json!(path))]);
        entry.extend(options.iter().filter(|(_, on)| *on).map(|(name, _)| ((*name).to_owned(), json!(true))));
        let mesh = out.name(Table::Meshes, &stem);
        out.add(Table::Meshes, mesh.clone(), entry);
        out.meshes.insert(key, mesh.clone());
        mesh
    };
    let map = affine(to_world);
    note_normal_map(out, object, &look, &map, None);
    instance(out, object, (name, mesh), &map, &look)
}

/// A shape that becomes a mesh of its own, shared by all of its kind.
fn made(
    out: &mut Output<'_>,
    object: &Object,
    to_world: &DMat4,
    kind: &str,
    make: fn() -> Mesh,
) -> Result<(), ConvertError> {
    let name = out.name(Table::Instances, title(object));
    let mut look = look(out, object, &name)?;
    object.ignore(&["face_normals"]);
    let map = affine(to_world);
    // Their normals come from the round shape, which Mitsuba turns around when it is mirrored.
    if matches!(kind, "sphere" | "cylinder") && map.matrix3.determinant() < 0.0 {
        look.flip = !look.flip;
    }
    // An image on these three appears mirrored.
    note_normal_map(out, object, &look, &map, Some(matches!(kind, "rectangle" | "disk" | "cylinder")));
    let key = format!("made|{kind}");
    let mesh = if let Some(mesh) = out.meshes.get(&key) {
        mesh.clone()
    } else {
        let path = out.bytes("meshes", &format!("{kind}.ply"), make().to_ply());
        let mesh = out.name(Table::Meshes, kind);
        out.add(Table::Meshes, mesh.clone(), json!({ "file": path }));
        out.meshes.insert(key, mesh.clone());
        mesh
    };
    instance(out, object, (name, mesh), &map, &look)
}

fn sphere(out: &mut Output<'_>, object: &Object, to_world: &DMat4) -> Result<(), ConvertError> {
    let center = object.vector("center")?.unwrap_or(DVec3::ZERO);
    let radius = object.number_or("radius", 1.0)?;
    let whole = *to_world * DMat4::from_translation(center) * DMat4::from_scale(DVec3::splat(radius));
    let map = affine(&whole);
    let bsdf =
        object.nested().find(|(_, index)| out.scene.objects[*index].tag == "bsdf").map(|(_, index)| index);
    let textured = match bsdf {
        Some(index) => {
            let name = material(out, index, title(object))?;
            out.get(Table::Materials, &name).is_some_and(uses_uv)
        }
        None => false,
    };
    let Some(scale) = similarity(&map).filter(|_| !textured) else {
        let why = if textured { "with a texture" } else { "that its transform stretches" };
        out.differs(&object.place, format!("a sphere {why} becomes a mesh of 65024 triangles"));
        return made(out, object, &whole, "sphere", primitive::sphere);
    };
    let name = out.name(Table::Spheres, title(object));
    let mut look = look(out, object, &name)?;
    look.flip ^= map.matrix3.determinant() < 0.0;
    let radius = if *to_world == DMat4::IDENTITY { radius.abs() } else { scale };
    let mut fields = Map::new();
    fields.insert("center".to_owned(), json!(map.translation.to_array().map(unsigned)));
    fields.insert("radius".to_owned(), json!(radius));
    fields.insert("material".to_owned(), json!(look.material));
    shine(&mut fields, &look);
    out.add(Table::Spheres, name, fields);
    Ok(())
}

/// From the cylinder of length and radius 1 along z to that of the object.
fn along(object: &Object) -> Result<DMat4, ConvertError> {
    let from = object.vector("p0")?.unwrap_or(DVec3::ZERO);
    let to = object.vector("p1")?.unwrap_or(DVec3::Z);
    let radius = object.number_or("radius", 1.0)?;
    let length = (to - from).length();
    let Some(axis) = (to - from).try_normalize() else {
        return Err(object.place.error("found a cylinder without length, expected p0 and p1 apart"));
    };
    let (s, t) = tangents(axis);
    let map = DMat3::from_cols(s * radius, t * radius, axis * length);
    Ok(DMat4::from_translation(from) * DMat4::from_mat3(map))
}
