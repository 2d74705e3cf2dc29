//! Owns the translation between `karst.v1` and the farm, the state and the blobs: convert, ask, convert.

pub mod assets;
pub(crate) mod convert;
pub mod frames;
pub mod jobs;
mod outlet;
pub mod previews;
mod watch;
pub mod workers;
