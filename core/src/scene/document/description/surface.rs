//! Owns mesh files, instances and spheres.

use glam::{DAffine3, Vec3};

use crate::scene::document::asset::AssetKind;
use crate::scene::document::macros::object;
use crate::scene::document::rule::{Table, optional, or, required};

object! {
    "mesh";
    /// A mesh file.
    pub struct MeshFile {
        /// Path of an OBJ or PLY file, relative to the document.
        file: String = required().file(AssetKind::Mesh);
        /// Whether triangles are flat, and the normals of the file are left aside.
        face_normals: bool = or(false);
        /// Whether v runs downwards in the file: it becomes 1 - v.
        flip_v: bool = or(false);
    }
}

object! {
    "instance";
    /// A mesh placed in the world.
    pub struct Instance {
        /// Name of the mesh.
        mesh: String = required().naming(Table::Meshes);
        /// Name of the material.
        material: String = required().naming(Table::Materials);
        /// Places the mesh.
        transform: DAffine3 = or(DAffine3::IDENTITY);
        /// Radiance that the front side sends out, linear Rec.709; the front is the side of the normals in the mesh
        /// file, or without them the side from which the vertices of a triangle run counter-clockwise.
        emission: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Whether front and back change places.
        flip_normals: bool = or(false);
        /// Name of the medium inside, where the surface is closed.
        interior: Option<String> = optional().naming(Table::Media);
    }
}

object! {
    "sphere";
    /// A sphere.
    pub struct Sphere {
        /// Centre, in world units.
        center: Vec3 = required();
        /// Radius, in world units.
        radius: f32 = required().above(0.0);
        /// Name of the material.
        material: String = required().naming(Table::Materials);
        /// Radiance that the front side sends out, linear Rec.709; the front is the outside.
        emission: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Whether front and back change places: the sphere shines inwards.
        flip_normals: bool = or(false);
        /// Name of the medium inside, where the surface is closed.
        interior: Option<String> = optional().naming(Table::Media);
    }
}
