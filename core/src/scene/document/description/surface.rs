//! Owns materials, mesh files, instances and spheres.

use glam::{DAffine3, Vec3};

use crate::scene::document::macros::{object, variants};
use crate::texture::ColorSpace;

variants! {
    "material";
    /// How a surface scatters light.
    pub enum Material {
        /// Lambert's law: the same radiance in all directions, on both sides.
        "diffuse" => Diffuse {
            /// Share of the light that is scattered back, linear Rec.709, each channel 0 to 1.
            reflectance: ColorTexture = or(ColorTexture::Constant(Vec3::splat(0.5))).from(0.0).to(1.0);
        }
    }
}

/// A colour that may vary over a surface.
#[derive(Debug, Clone, PartialEq)]
pub enum ColorTexture {
    /// The same everywhere, linear Rec.709.
    Constant(Vec3),
    /// An image over the surface's uv.
    Image {
        /// Path of the file, relative to the document; PNG or JPEG.
        file: String,
        /// What the numbers in the file mean.
        color_space: ColorSpace,
    },
}

object! {
    "mesh";
    /// A mesh file.
    pub struct MeshFile {
        /// Path of an OBJ or PLY file, relative to the document.
        file: String = required().file(AssetKind::Mesh);
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
        /// Radiance that the front side sends out, linear Rec.709; the front is the side from which the
        /// vertices of a triangle run counter-clockwise.
        emission: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Turns front and back around.
        flip_normals: bool = or(false);
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
        /// Radiance that the front side, the outside, sends out, linear Rec.709.
        emission: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Turns front and back around: the inside shines.
        flip_normals: bool = or(false);
    }
}
