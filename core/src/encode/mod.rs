//! Pictures to bytes: EXR with named layers, PNG through a view curve, false colours for maps; and EXR back.
//!
//! Identical pixels give identical bytes: no times, no versions, no machine names, no unordered maps.

mod exr_read;
mod exr_write;
mod heat;
mod png;
mod statistics;
mod view;

pub use exr_read::{ExrImage, read_exr};
pub use exr_write::{Layers, exr, film_exr, write_exr};
pub use heat::{false_color, heat_map};
pub use png::{film_png, png, png_rgb8, rgb8};
pub use statistics::{MAX_OBJECTS, object_statistics, statistics};
pub use view::display;

/// Why a picture could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// A plane does not hold one value per pixel.
    #[error("{plane}: found {found} pixels, expected {expected} ({width} x {height})")]
    PlaneSize {
        /// Name of the plane.
        plane: &'static str,
        /// Pixels in the plane.
        found: usize,
        /// Pixels that the window has.
        expected: usize,
        /// Width of the window in pixels.
        width: u32,
        /// Height of the window in pixels.
        height: u32,
    },
    /// The window is empty or not inside the frame.
    #[error(
        "window: found {x0},{y0} to {x1},{y1}, expected a rectangle of at least one pixel inside {width} x {height}"
    )]
    Window {
        /// Left edge, inclusive.
        x0: u32,
        /// Top edge, inclusive.
        y0: u32,
        /// Right edge, exclusive.
        x1: u32,
        /// Bottom edge, exclusive.
        y1: u32,
        /// Width of the frame in pixels.
        width: u32,
        /// Height of the frame in pixels.
        height: u32,
    },
    /// The exposure is not a number that makes sense.
    #[error("exposure: found {found} stops, expected a number from -64 to 64")]
    Exposure {
        /// The value given.
        found: f32,
    },
    /// The file is larger than this program reads.
    #[error("exr: found {width} x {height} pixels with {channels} channels, at most {limit} values are read")]
    TooLarge {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Channels in the file.
        channels: usize,
        /// Largest number of values (pixels times channels).
        limit: u64,
    },
    /// The file says that it holds more than its length can carry.
    #[error("exr: found {bytes} bytes, too few for the {values} values that the header announces")]
    Truncated {
        /// Length of the file.
        bytes: usize,
        /// Values that the header announces.
        values: u64,
    },
    /// The file uses something that karst does not read.
    #[error("exr: {0}")]
    Unsupported(String),
    /// The EXR library refused.
    #[error("exr: {0}")]
    Exr(#[from] ::exr::error::Error),
    /// The PNG library refused.
    #[error("png: {0}")]
    Png(#[from] ::image::ImageError),
    /// The statistics could not be written as JSON.
    #[error("statistics: {0}")]
    Statistics(#[from] serde_json::Error),
}
