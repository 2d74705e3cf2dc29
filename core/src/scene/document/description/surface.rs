//! Owns materials, mesh files, instances and spheres.

use glam::{DAffine3, Vec3};
use serde_json::{Value as Json, json};

use crate::scene::document::asset::AssetKind;
use crate::scene::document::cursor::Cursor;
use crate::scene::document::decode::Decode;
use crate::scene::document::macros::{object, variants};
use crate::scene::document::rule::{Allowed, Table, or, required};
use crate::scene::document::schema::Definitions;
use crate::scene::document::tree::Value;
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

variants! {
    "texture";
    /// A colour that varies over a surface.
    enum Texture {
        /// An image over the surface's uv: u to the right, v upwards from the bottom of the image, repeated
        /// outside 0 to 1.
        "image" => Image {
            /// Path of a PNG or JPEG file, relative to the document. Cannot be animated.
            file: String = required().file(AssetKind::Image);
            /// What the numbers in the file mean.
            color_space: ColorSpace = or(ColorSpace::Srgb);
        }
    }
}

impl Decode for ColorTexture {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        match at.node.value {
            Value::List(_) => Vec3::decode(at, allowed).map(Self::Constant),
            Value::Object(_) => {
                let Texture::Image { file, color_space } = Texture::decode(at, allowed)?;
                Some(Self::Image { file, color_space })
            }
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::Text(_) => {
                at.expected(&Self::expected(allowed));
                None
            }
        }
    }

    fn expected(allowed: &Allowed) -> String {
        format!("{} or a texture object", Vec3::expected(allowed))
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        json!({"anyOf": [Vec3::schema(allowed, definitions), Texture::schema(allowed, definitions)]})
    }

    fn show(&self) -> Json {
        match self {
            Self::Constant(color) => color.show(),
            Self::Image { file, color_space } => {
                Texture::Image { file: file.clone(), color_space: *color_space }.show()
            }
        }
    }
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
        /// Whether front and back change places.
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
        /// Radiance that the front side sends out, linear Rec.709; the front is the outside.
        emission: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Whether front and back change places: the sphere shines inwards.
        flip_normals: bool = or(false);
    }
}
