//! Owns the scene: the document a person writes and the form that rays meet.

mod assets;
mod build;
mod compiled;
mod document;
mod object;
mod tape;

pub use assets::Assets;
pub use compiled::Scene;
pub use document::{
    Bounds, Camera, ColorTexture, Components, Crop, Description, Film, Filter, Goal, Instance, Integrator,
    Light, LookAt, Material, MeshFile, Named, Problem, Problems, Sampling, SdfNode, SdfObject, SdfSettings,
    Sphere,
};
pub use object::{Hit, PreparedMesh, Surface};
