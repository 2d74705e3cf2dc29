//! Owns the scene: the document a person writes and the form that rays meet.

/// Whether this build renders plain scenes only, those of meshes, spheres and lamps: what others need is not there, so that a
/// bench can tell what it costs those who do not use it.
const PLAIN: bool = cfg!(karst_plain);

mod albedo;
mod assets;
mod batch;
mod build;
mod compiled;
mod document;
mod material;
mod materials;
mod media;
mod object;
mod tally;
mod tape;
mod trees;

pub use albedo::AlbedoPeak;
pub use assets::{AssetSource, Assets, Folder};
pub use batch::Marching;
pub use compiled::{Scene, Strategy};
pub use document::{
    AssetKind, AssetRef, Bounds, Camera, ColorTexture, Components, Crop, Description, Document, ErrorOf,
    Film, Filter, FrameRange, Goal, Instance, Integrator, Light, Limits, LookAt, Material, Medium, MeshFile,
    Model, Named, NumberTexture, Overrides, Problem, Problems, Relief, Sampling, Scale, SdfNode, SdfObject,
    SdfSettings, Shade, Sphere, Texture, json_schema, reference_page,
};
pub use media::{Interiors, Stretch};
pub use object::{Hit, PreparedMesh, Surface};
pub use tally::Tally;
