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

/// What an image is outside 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    /// It repeats.
    Repeat,
    /// It repeats, every second copy mirrored.
    Mirror,
    /// The texels at the edge go on.
    Clamp,
}

/// What lies between texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextureFilter {
    /// Values change linearly.
    Bilinear,
    /// The value of the nearest texel.
    Nearest,
}

/// Which channel of an image is taken as a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Luminance of the colour.
    Luminance,
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// Alpha, 1 where there is none.
    Alpha,
}
