//! Owns the picture in the making: its geometry (regions, blocks, tiles), the plan of a round, the result of a tile,
//! and the film that results are merged into.

mod cross;
mod error;
mod filter;
mod grid;
mod picture;
mod result;
mod round;
mod store;

pub use cross::{CrossError, cross_error};
pub(crate) use error::{Level, Seen, levels};
pub use filter::{FilterKind, PixelFilter};
pub use grid::{BLOCK, FrameSize, Region, TileGrid};
pub use picture::Picture;
pub use result::{BlockResult, Counters, PixelSums, ResultError, TileResult};
pub use round::{Round, SampleRange};
pub use store::{BlockStats, Film, FrameSummary};
