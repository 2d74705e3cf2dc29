//! Owns colours that vary over a surface.

mod image;

pub use image::{Image, ImageError};

/// What the numbers in an image file mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorSpace {
    /// The sRGB curve: pictures.
    Srgb,
    /// Proportional to light: data.
    Linear,
}
