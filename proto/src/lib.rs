//! The `karst.v1` wire: generated messages and services, error details, and the translation to core types.
//!
//! The files under `proto/karst/v1/` are the specification; this crate adds no rule that they do not state.

pub mod connect;
pub mod convert;
pub mod errors;

/// Messages, clients and servers of package `karst.v1`, generated from the proto files.
#[allow(
    clippy::all,
    clippy::pedantic,
    clippy::restriction,
    missing_docs,
    unreachable_pub,
    unused_qualifications,
    rustdoc::all,
    reason = "generated code; its comments are those of the proto files"
)]
pub mod v1 {
    tonic::include_proto!("karst.v1");
}

/// All descriptors of `karst.v1` and what it imports, encoded: for the reflection service.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/karst.v1.descriptors"));

/// Most bytes of one message, in both directions.
pub const MAX_MESSAGE_BYTES: usize = 1 << 20;

/// Most bytes of one message of `Workers.UpdateWorkerSession`, which carries results.
pub const MAX_WORKER_MESSAGE_BYTES: usize = 4 << 20;

/// Most bytes of one chunk of an upload or a download.
pub const MAX_CHUNK_BYTES: usize = 256 << 10;

/// Most digests that one `FindMissing` asks for.
pub const MAX_DIGESTS: usize = 4096;

/// Most asset files of one scene.
pub const MAX_SCENE_FILES: usize = 2048;
