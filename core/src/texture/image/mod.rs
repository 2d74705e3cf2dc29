//! Owns images: which format bytes have, and the texels of a file as the file stores them.

mod jpeg;
mod openexr;
mod radiance;
mod raster;
#[cfg(test)]
mod tests;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::LazyLock;

use glam::Vec3;
use half::f16;

use crate::texture::ColorSpace;

/// Why bytes are no image that can be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// Of no format that is read, or damaged.
    #[error("not a PNG, JPEG, EXR or Radiance HDR image that can be read: {0}")]
    Malformed(#[from] ::image::ImageError),
    /// A damaged EXR file, or one with a feature that is not read.
    #[error("not an EXR image that can be read: {0}")]
    Exr(#[from] exr::error::Error),
    /// An EXR file without colours.
    #[error(
        "found channels {found}; expected R, G and B, or Y, or one channel, in flat pixels, not subsampled"
    )]
    Channels {
        /// Names of the channels of all parts.
        found: String,
    },
    /// An EXR file whose values would depend on the machine that reads it.
    #[error("has {name}, which is not read: its values differ between machines; save it with ZIP or PIZ")]
    Compression {
        /// Name of the compression.
        name: String,
    },
    /// A baseline JPEG with a scan for each colour, which the decoder takes for something else.
    #[error(
        "is a baseline JPEG with a scan for each colour, which is not read; save it with one scan, or progressive"
    )]
    SeparateScans,
    /// A damaged file at which the decoder stopped in the middle.
    #[error("not an image that can be read: its decoder gave up")]
    Damaged,
    /// More texels than are left of the limit.
    #[error("has {width} x {height} texels, {left} are left of the limit for all images together")]
    TooLarge {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
        /// Texels that are left of the limit.
        left: u64,
    },
    /// A file that announces no texels.
    #[error("has {width} x {height} texels, expected at least one")]
    Empty {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
    },
    /// Fewer bytes than any compression needs for the texels that are announced.
    #[error("announces {width} x {height} texels, which {bytes} bytes cannot hold")]
    Truncated {
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
        /// Size of the file.
        bytes: usize,
    },
    /// A value that is infinite or not a number.
    #[error(
        "texel ({x}, {y}), counted from the upper left, has {value} in channel {channel}, expected a finite number; \
         replace such texels in the file"
    )]
    NotFinite {
        /// Column, from 0.
        x: u32,
        /// Row from the top, from 0.
        y: u32,
        /// Name of the channel.
        channel: String,
        /// The value found.
        value: f32,
    },
}

/// The texels of an image file, in the precision of the file: 1 or 2 bytes a channel for PNG and JPEG, 2 for EXR files
/// of halves, 4 for other EXR files and for Radiance HDR. One channel is kept for greys, three for colours, and one
/// more where the file has alpha.
///
/// EXR and HDR values may exceed 1 and are finite. The primaries are taken as those of Rec.709 and `EXPOSURE` of HDR
/// files as a remark; of EXR files the first flat part with colours is read, and of it the data window.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    /// 1 for grey, 3 for colour, one more with alpha, which comes last.
    channels: u8,
    data: Data,
}

/// Rows from the top down, texels from left to right, channels of a texel together.
#[derive(Debug, Clone, PartialEq)]
enum Data {
    Bytes(Vec<u8>),
    Words(Vec<u16>),
    Halves(Vec<f16>),
    Floats(Vec<f32>),
}

impl Image {
    /// Reads a PNG, JPEG, EXR or Radiance HDR file of at most `left` texels, told apart by its content. The size is
    /// checked before any texel is decoded.
    ///
    /// # Errors
    /// Damaged or foreign files, larger ones, and values that are not finite.
    pub fn read(bytes: &[u8], left: u64) -> Result<Self, ImageError> {
        let read = || {
            if bytes.starts_with(&openexr::MAGIC) {
                openexr::read(bytes, left)
            } else if bytes.starts_with(radiance::MAGIC) {
                radiance::read(bytes, left)
            } else {
                raster::read(bytes, left)
            }
        };
        // Decoders of foreign formats have had panics on damaged files; nothing of theirs outlives one.
        catch_unwind(AssertUnwindSafe(read)).unwrap_or(Err(ImageError::Damaged))
    }

    /// Width in texels, at least 1.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels, at least 1.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whether the file holds floating-point numbers (EXR, HDR), which are proportional to light unless told otherwise.
    pub fn is_float(&self) -> bool {
        matches!(self.data, Data::Halves(_) | Data::Floats(_))
    }

    /// Linear Rec.709 colour of a texel, rows counted from the top. `space` says what the numbers in the file mean.
    ///
    /// # Panics
    /// Where `y` is not below the height, or the texel is not in the image.
    #[inline]
    pub fn texel(&self, x: u32, y: u32, space: ColorSpace) -> Vec3 {
        let first = self.first(x, y);
        if self.channels < 3 {
            return Vec3::splat(self.value(first, space));
        }
        match (&self.data, space) {
            // What most textures are, without asking what they are for every channel.
            (Data::Bytes(bytes), ColorSpace::Srgb) => {
                let curve = &*SRGB_BYTES;
                let texel: [u8; 3] = std::array::from_fn(|channel| bytes[first + channel]);
                Vec3::from(texel.map(|byte| curve[usize::from(byte)]))
            }
            (Data::Halves(halves), ColorSpace::Linear) => {
                Vec3::from_array(std::array::from_fn(|channel| halves[first + channel].to_f32()))
            }
            (Data::Floats(floats), ColorSpace::Linear) => Vec3::from_slice(&floats[first..]),
            _ => Vec3::from_array(std::array::from_fn(|channel| self.value(first + channel, space))),
        }
    }

    /// Alpha of a texel, rows counted from the top; 1 where the file has none.
    ///
    /// # Panics
    /// As [`Image::texel`].
    pub fn alpha(&self, x: u32, y: u32) -> f32 {
        if self.channels % 2 == 1 {
            return 1.0;
        }
        self.value(self.first(x, y) + usize::from(self.channels) - 1, ColorSpace::Linear)
    }

    /// Where the values of a texel begin.
    fn first(&self, x: u32, y: u32) -> usize {
        (y as usize * self.width as usize + x as usize) * usize::from(self.channels)
    }

    fn value(&self, index: usize, space: ColorSpace) -> f32 {
        let float = match &self.data {
            Data::Bytes(bytes) => {
                let byte = bytes[index];
                return match space {
                    ColorSpace::Srgb => SRGB_BYTES[usize::from(byte)],
                    ColorSpace::Linear => f32::from(byte) / 255.0,
                };
            }
            Data::Words(words) => {
                let word = words[index];
                return match space {
                    ColorSpace::Srgb => SRGB_WORDS[usize::from(word)],
                    ColorSpace::Linear => f32::from(word) / 65535.0,
                };
            }
            Data::Halves(halves) => halves[index].to_f32(),
            Data::Floats(floats) => floats[index],
        };
        // The curve takes the largest floats beyond what a float holds.
        if space == ColorSpace::Srgb { from_srgb(float).min(f32::MAX) } else { float }
    }
}

/// Refuses what has no texels, or more than are left of the limit.
fn check_size(width: u32, height: u32, left: u64) -> Result<(), ImageError> {
    if width == 0 || height == 0 {
        return Err(ImageError::Empty { width, height });
    }
    if u64::from(width) * u64::from(height) > left {
        return Err(ImageError::TooLarge { width, height, left });
    }
    Ok(())
}

/// Linear light of the sRGB curve (IEC 61966-2-1), which goes on above 1; below 0 it is the line at 0.
fn from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { crate::math::powf((value + 0.055) / 1.055, 2.4) }
}

/// The curve for each byte.
static SRGB_BYTES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| from_srgb(byte as f32 / 255.0)));

/// The curve for each number of 16 bits.
static SRGB_WORDS: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..=u16::MAX).map(|word| from_srgb(f32::from(word) / 65535.0)).collect());
