//! Owns rendering: which samples a round takes, a tile of a round, a whole frame.

mod accumulate;
mod frame;
mod rounds;
mod tile;

pub use frame::{FrameObserver, Progress, render_frame};
pub use rounds::next_round;
pub use tile::{render_tile, render_tile_observed};
