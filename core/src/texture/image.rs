//! Owns images: PNG and JPEG bytes to texels, and the lookup by uv.

use std::io::Cursor;
use std::sync::LazyLock;

use glam::{Vec2, Vec3};
use image::{DynamicImage, ImageReader};

use crate::texture::ColorSpace;

/// Why bytes are no image that can be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// Neither PNG nor JPEG, or damaged.
    #[error("not a PNG or JPEG image that can be read: {0}")]
    Malformed(#[from] image::ImageError),
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
}

/// The texels of an image file, as the file stores them; alpha is left out.
///
/// As a colour over a surface, u runs to the right and v **upwards**: (0, 0) is the lower left corner of the
/// image, as in OBJ files. Texel centres lie at half integers, between them the light is interpolated linearly,
/// and outside 0 to 1 the image repeats.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    /// 1 for grey, 3 for colour.
    channels: u8,
    data: Data,
}

/// Rows from the top down, texels from left to right.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Data {
    Bytes(Vec<u8>),
    Words(Vec<u16>),
}

impl Image {
    /// Reads a PNG or JPEG file of at most `left` texels; the size is checked before any texel is decoded.
    ///
    /// # Errors
    /// Damaged or foreign files, and larger ones.
    pub fn read(bytes: &[u8], left: u64) -> Result<Self, ImageError> {
        let open =
            || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(image::ImageError::IoError);
        let (width, height) = open()?.into_dimensions()?;
        let texels = u64::from(width) * u64::from(height);
        if texels > left {
            return Err(ImageError::TooLarge { width, height, left });
        }
        let mut reader = open()?;
        let mut limits = image::Limits::default();
        // At most 8 bytes a texel, twice for the decoder's own copy, and room for its tables.
        limits.max_alloc = Some(texels.saturating_mul(16) + (16 << 20));
        reader.limits(limits);
        let (channels, data) = match reader.decode()? {
            DynamicImage::ImageLuma8(image) => (1, Data::Bytes(image.into_raw())),
            DynamicImage::ImageRgb8(image) => (3, Data::Bytes(image.into_raw())),
            DynamicImage::ImageLuma16(image) => (1, Data::Words(image.into_raw())),
            DynamicImage::ImageRgb16(image) => (3, Data::Words(image.into_raw())),
            image @ DynamicImage::ImageLumaA8(_) => (1, Data::Bytes(image.into_luma8().into_raw())),
            image @ DynamicImage::ImageLumaA16(_) => (1, Data::Words(image.into_luma16().into_raw())),
            image @ DynamicImage::ImageRgba16(_) => (3, Data::Words(image.into_rgb16().into_raw())),
            image => (3, Data::Bytes(image.into_rgb8().into_raw())),
        };
        Ok(Self { width, height, channels, data })
    }

    /// Width in texels, at least 1.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in texels, at least 1.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Linear Rec.709 colour at a texture coordinate, each channel 0 to 1; black where the coordinate is not
    /// finite. `space` says what the numbers in the file mean.
    pub fn lookup(&self, uv: Vec2, space: ColorSpace) -> Vec3 {
        if !uv.is_finite() {
            return Vec3::ZERO;
        }
        let (width, height) = (self.width, self.height);
        let (x0, x1, fx) = between(uv.x, width);
        let (y0, y1, fy) = between(1.0 - (uv.y - uv.y.floor()), height);
        let row = |y: u32| self.texel(x0, y, space) * (1.0 - fx) + self.texel(x1, y, space) * fx;
        row(y0) * (1.0 - fy) + row(y1) * fy
    }

    /// Colour of a texel, rows counted from the top.
    fn texel(&self, x: u32, y: u32, space: ColorSpace) -> Vec3 {
        let channels = usize::from(self.channels);
        let first = (y as usize * self.width as usize + x as usize) * channels;
        let channel = |index: usize| match &self.data {
            Data::Bytes(bytes) => match space {
                ColorSpace::Srgb => SRGB[usize::from(bytes[first + index])],
                ColorSpace::Linear => f32::from(bytes[first + index]) / 255.0,
            },
            Data::Words(words) => {
                let value = f32::from(words[first + index]) / 65535.0;
                if space == ColorSpace::Srgb { from_srgb(value) } else { value }
            }
        };
        if channels == 1 { Vec3::splat(channel(0)) } else { Vec3::new(channel(0), channel(1), channel(2)) }
    }
}

/// The two texels around a coordinate of a repeating image of `size` texels, and the weight of the second.
fn between(coordinate: f32, size: u32) -> (u32, u32, f32) {
    let wrapped = coordinate - coordinate.floor();
    let position = wrapped * size as f32 - 0.5;
    let low = position.floor();
    // `low` is -1 to `size`: one step of wrapping is enough.
    let wrap = |index: i64| index.rem_euclid(i64::from(size)) as u32;
    (wrap(low as i64), wrap(low as i64 + 1), position - low)
}

/// Linear light of the sRGB curve (IEC 61966-2-1), 0 to 1.
fn from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { libm::powf((value + 0.055) / 1.055, 2.4) }
}

/// The curve for each byte.
static SRGB: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| from_srgb(byte as f32 / 255.0)));

#[cfg(test)]
mod tests {
    use super::{Image, ImageError};
    use crate::texture::ColorSpace;
    use glam::{Vec2, Vec3};
    use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, Rgba};
    use std::io::Cursor;

    fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    /// Red and green above, blue and white below.
    fn corners() -> Vec<u8> {
        let texels = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
        png(ImageBuffer::<Rgb<u8>, _>::from_vec(2, 2, texels.concat()).unwrap())
    }

    fn lookup(bytes: &[u8], space: ColorSpace, uv: Vec2) -> Vec3 {
        Image::read(bytes, 1 << 20).unwrap().lookup(uv, space)
    }

    #[test]
    fn v_runs_upwards_and_the_image_repeats() {
        let image = Image::read(&corners(), 1 << 20).unwrap();
        let (red, green, blue, white) = (Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE);
        for (u, v, expected) in [
            (0.25, 0.75, red),
            (0.75, 0.75, green),
            (0.25, 0.25, blue),
            (0.75, 0.25, white),
            (0.5, 0.75, (red + green) / 2.0),
            (0.25, 0.5, (red + blue) / 2.0),
            (1.0, 0.75, (red + green) / 2.0),
            (0.25, 0.0, (red + blue) / 2.0),
            (-0.75, 1.75, red),
            (7.25, -2.75, blue),
        ] {
            let found = image.lookup(Vec2::new(u, v), ColorSpace::Srgb);
            assert!(
                (found - expected).abs().max_element() < 1.0e-6,
                "({u}, {v}): {found}, expected {expected}"
            );
        }
    }

    #[test]
    fn any_coordinate_is_safe() {
        let image = Image::read(&corners(), 1 << 20).unwrap();
        for value in [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN, -1.0e-30, 1.0 - f32::EPSILON / 2.0, 1.0e9]
        {
            let found = image.lookup(Vec2::splat(value), ColorSpace::Linear);
            assert!(
                found.is_finite() && found.min_element() >= 0.0 && found.max_element() <= 1.0,
                "{value}: {found}"
            );
        }
    }

    #[test]
    fn color_spaces_and_depths() {
        let grey = png(ImageBuffer::<Luma<u8>, _>::from_vec(1, 1, vec![188]).unwrap());
        let near =
            |found: Vec3, expected: f32| assert!((found - expected).abs().max_element() < 1.0e-4, "{found}");
        // 188/255 on the sRGB curve is 0.502886.
        near(lookup(&grey, ColorSpace::Srgb, Vec2::ZERO), 0.502_886);
        near(lookup(&grey, ColorSpace::Linear, Vec2::ZERO), 188.0 / 255.0);
        let deep = png(ImageBuffer::<Luma<u16>, _>::from_vec(1, 1, vec![100]).unwrap());
        near(lookup(&deep, ColorSpace::Linear, Vec2::ZERO), 100.0 / 65535.0);
        let clear = png(ImageBuffer::<Rgba<u8>, _>::from_vec(1, 1, vec![255, 255, 255, 0]).unwrap());
        near(lookup(&clear, ColorSpace::Srgb, Vec2::ZERO), 1.0);
    }

    #[test]
    fn bad_files_are_refused_before_memory_is_taken() {
        let bytes = corners();
        assert!(matches!(Image::read(&bytes, 3), Err(ImageError::TooLarge { width: 2, height: 2, left: 3 })));
        // A header that announces 2^31 - 1 by 2^31 - 1 texels; its checksum is right.
        let mut huge = bytes.clone();
        huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
        let crc = crc(&huge[12..29]);
        huge[29..33].copy_from_slice(&crc.to_be_bytes());
        let error = Image::read(&huge, 1 << 29).unwrap_err().to_string();
        assert!(error.contains("2147483647 x 2147483647") || error.contains("not a PNG"), "{error}");
        for length in 0..bytes.len() {
            assert!(Image::read(&bytes[..length], 1 << 20).is_err() || length > bytes.len() - 13, "{length}");
        }
    }

    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0_u32, |crc, &byte| {
            (0..8).fold(
                crc ^ u32::from(byte),
                |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 },
            )
        })
    }
}
