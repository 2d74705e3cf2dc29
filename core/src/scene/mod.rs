//! Owns the scene: the document a person writes and the form that rays meet.

mod assets;
mod build;
mod compiled;
mod document;
mod object;
mod tape;

pub use assets::{AssetSource, Assets, Folder};
pub use compiled::Scene;
pub use document::{
    AssetKind, AssetRef, Bounds, Camera, ColorTexture, Components, Crop, Description, Document, Film, Filter,
    FrameRange, Goal, Instance, Integrator, Light, Limits, LookAt, Material, MeshFile, Named, Overrides,
    Problem, Problems, Sampling, Scale, SdfNode, SdfObject, SdfSettings, Sphere, json_schema, reference_page,
};
pub use object::{Hit, PreparedMesh, Surface};
