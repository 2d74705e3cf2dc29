//! Owns the scene document: JSON text to a checked [`Description`] of one frame.

mod description;
mod macros;
mod named;
mod problem;

pub use description::{
    Bounds, Camera, ColorTexture, Components, Crop, Description, Film, Filter, Goal, Instance, Integrator,
    Light, LookAt, Material, MeshFile, Sampling, SdfNode, SdfObject, SdfSettings, Sphere,
};
pub use named::Named;
pub use problem::{Problem, Problems};
