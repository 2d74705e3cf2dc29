//! Reads PNG and JPEG files.

use std::io::Cursor;

use image::{DynamicImage, ImageReader};

use super::{Data, Image, ImageError, check_size, jpeg};

/// Reads a file of at most `left` texels.
pub(super) fn read(bytes: &[u8], left: u64) -> Result<Image, ImageError> {
    if jpeg::has_separate_scans(bytes) {
        return Err(ImageError::SeparateScans);
    }
    let open =
        || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(image::ImageError::IoError);
    let (width, height) = open()?.into_dimensions()?;
    check_size(width, height, left)?;
    let mut reader = open()?;
    let mut limits = image::Limits::default();
    // At most 8 bytes a texel, twice for the decoder's own copy, and room for its tables.
    let texels = u64::from(width) * u64::from(height);
    limits.max_alloc = Some(texels.saturating_mul(16) + (16 << 20));
    reader.limits(limits);
    let (channels, data) = match reader.decode()? {
        DynamicImage::ImageLuma8(image) => (1, Data::Bytes(image.into_raw())),
        DynamicImage::ImageLumaA8(image) => (2, Data::Bytes(image.into_raw())),
        DynamicImage::ImageRgb8(image) => (3, Data::Bytes(image.into_raw())),
        DynamicImage::ImageRgba8(image) => (4, Data::Bytes(image.into_raw())),
        DynamicImage::ImageLuma16(image) => (1, Data::Words(image.into_raw())),
        DynamicImage::ImageLumaA16(image) => (2, Data::Words(image.into_raw())),
        DynamicImage::ImageRgb16(image) => (3, Data::Words(image.into_raw())),
        DynamicImage::ImageRgba16(image) => (4, Data::Words(image.into_raw())),
        // Neither PNG nor JPEG has others.
        image @ (DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) | _) => {
            (4, Data::Words(image.into_rgba16().into_raw()))
        }
    };
    Ok(Image { width, height, channels, data })
}
