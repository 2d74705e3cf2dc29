//! Reads Radiance HDR files (RGBE); the texels become f32, in which they are exact.

use std::io::Read;

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};

use super::{Data, Image, ImageError, check_size};

/// How such files begin; the name of the program that wrote it follows.
pub(super) const MAGIC: &[u8] = b"#?";

/// The only name of a program that the decoder takes.
const SIGNATURE: &[u8] = b"#?RADIANCE";

/// Reads a file of at most `left` texels.
pub(super) fn read(bytes: &[u8], left: u64) -> Result<Image, ImageError> {
    // What follows the name on its line, here the line of the file itself, is skipped.
    let decoder = HdrDecoder::new(SIGNATURE.chain(bytes))?;
    let (width, height) = decoder.dimensions();
    check_size(width, height, left)?;
    let texels = DynamicImage::from_decoder(decoder)?.into_rgb32f().into_raw();
    Ok(Image { width, height, channels: 3, data: Data::Floats(texels) })
}
