//! Owns objects made of signed-distance functions: trees of nodes, compiled to flat tapes, and rays against them.
//!
//! [`TapeBuilder`] turns a tree into a [`Tape`], which gives the distance at a point in any [`Real`]; [`Sdf`] adds
//! bounds and [`Settings`] and answers rays, normals and offsets. Everything is in **object space**: the caller
//! brings rays there, so that far-away objects cost no precision.

mod builder;
mod cells;
mod closed;
mod error;
mod march;
mod node;
mod noise;
mod object;
mod pace;
mod packet;
mod prune;
mod real;
mod root;
mod tape;
#[cfg(test)]
mod tests;
mod traps;

pub use builder::{MAX_NODES, NodeId, TapeBuilder};
pub use error::SdfError;
pub use march::MarchStats;
pub use noise::{Noise, NoiseParameters};
pub use object::{Resolved, Sdf, SdfRay, Settings};
pub use real::{Point, Real};
pub use tape::{MAX_DEPTH, Tape};
pub use traps::{Trap, Traps};
