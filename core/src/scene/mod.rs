//! Owns the scene: the document a person writes and the form that rays meet.

mod document;

pub use document::{
    Bounds, Camera, ColorTexture, Components, Crop, Description, Film, Filter, Goal, Instance, Integrator,
    Light, LookAt, Material, MeshFile, Named, Sampling, SdfNode, SdfObject, SdfSettings, Sphere,
};
