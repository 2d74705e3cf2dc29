//! Reads karst's own sources, so that the rules of its structure can be ordinary tests (`tests/`).

pub mod graph;
pub mod paths;
pub mod source;

use std::path::PathBuf;

/// The root of the repository.
pub fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}
