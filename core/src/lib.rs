//! karst's render core: scene to pixels, pure.
//!
//! A pixel is a function of (scene, frame, seed, pixel, sample range) and of nothing else: not of the tile,
//! the thread, the machine, the order of arrival or the clock.
//! Everything in this crate keeps that rule, and everything around it (retries, many workers, resuming)
//! rests on it.
//!
//! Modules in reading order; each one uses only those before it:
//!
//! | modules | own |
//! |---|---|
//! | [`math`] [`color`] | vectors, boxes, frames, error bounds; linear Rec.709 colours |
//! | [`sampler`] [`warp`] | random numbers keyed by pixel and sample; maps from the unit square |
//! | [`texture`] | images looked up by uv |
//! | [`sdf`] [`mesh`] [`bvh`] | distance functions, triangle meshes, the tree that rays walk |
//! | [`bsdf`] | how a surface scatters light |
//! | [`light`] [`camera`] [`film`] | where light comes from, where it goes, where it is summed |
//! | [`scene`] | the scene document and its compiled form |
//! | [`integrator`] | the path tracer: stages over slices of paths |
//! | [`render`] | rounds, tiles, frames |
//! | [`encode`] | EXR and PNG |

/// Names this build of the core: equal names mean equal bits for the same scene. Version, then a hash over sources,
/// locked dependencies, compiler and instruction sets.
pub const BUILD: &str = env!("KARST_CORE_BUILD");

pub mod cpu;

pub mod color;
pub mod math;

pub mod sampler;
pub mod warp;

pub mod texture;

pub mod sdf;

pub mod mesh;

pub mod bvh;

pub mod bsdf;
pub mod medium;

pub mod light;

pub mod camera;

pub mod film;

pub mod scene;

pub mod integrator;

pub mod render;

pub mod encode;
