//! Owns the description of one frame: plain data, checked, with all animation resolved.

mod light;
mod material;
mod medium;
mod sampling;
mod sdf;
mod surface;
mod texture;
mod transform;
mod view;

pub use light::Light;
pub use material::{Material, Model, Relief};
pub use medium::Medium;
pub use sampling::{ErrorOf, Goal, Integrator, Sampling};
pub use sdf::{Bounds, SdfNode, SdfObject, SdfSettings};
pub use surface::{Instance, MeshFile, Sphere};
pub use texture::{ColorTexture, NumberTexture, Shade, Texture};
pub use transform::{Components, LookAt, Scale};

pub(super) use transform::{from_rows, to_rows};
pub use view::{Camera, Crop, Film, Filter};

use crate::scene::Named;

/// One frame of a scene: what a document says once its animation is resolved.
///
/// Everything a document can get wrong by itself has been checked: ranges, references, limits.
/// Asset files are named, not read.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Name of the document, for messages.
    pub origin: String,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// The picture.
    pub film: Film,
    /// How many samples a pixel gets.
    pub sampling: Sampling,
    /// Limits of the light paths.
    pub integrator: Integrator,
    /// Surfaces' materials by name.
    pub materials: Named<Material>,
    /// Mesh files by name.
    pub meshes: Named<MeshFile>,
    /// Placed meshes by name.
    pub instances: Named<Instance>,
    /// Spheres by name.
    pub spheres: Named<Sphere>,
    /// Objects made of distance functions, by name.
    pub sdf_objects: Named<SdfObject>,
    /// Lights that are not surfaces, by name.
    pub lights: Named<Light>,
    /// What fills space, by name. Kept only: pictures are made as if all of it were empty.
    pub media: Named<Medium>,
    /// Name of the medium that is wherever no object's interior is.
    pub medium: Option<String>,
}
