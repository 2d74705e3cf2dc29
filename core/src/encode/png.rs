//! Writes 8-bit sRGB PNG files.

use glam::Vec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::EncodeError;
use crate::color::View;

use super::exr_write::check_plane;
use super::view::{Srgb8, display};

/// Encodes linear Rec.709 light, row-major, as a PNG: scaled by 2^`exposure`, then through the view.
///
/// # Errors
/// [`EncodeError::PlaneSize`] when `color` does not hold `width` x `height` pixels, [`EncodeError::Window`] for an
/// empty picture, [`EncodeError::Exposure`] outside -64 to 64 stops.
pub fn png(
    color: &[Vec3],
    width: u32,
    height: u32,
    exposure: f32,
    view: View,
) -> Result<Vec<u8>, EncodeError> {
    if !(-64.0..=64.0).contains(&exposure) {
        return Err(EncodeError::Exposure { found: exposure });
    }
    check_plane("color", color.len(), width, height)?;
    let gain = libm::exp2f(exposure);
    let light: Vec<Vec3> = color.iter().map(|&light| light * gain).collect();
    png_rgb8(&rgb8(&light, view), width, height)
}

/// Linear Rec.709 light as 8-bit sRGB through the view.
pub fn rgb8(color: &[Vec3], view: View) -> Vec<[u8; 3]> {
    let curve = Srgb8::new();
    color.iter().map(|&light| display(light, view).to_array().map(|value| curve.encode(value))).collect()
}

/// Encodes 8-bit sRGB pixels, row-major, as a PNG.
///
/// # Errors
/// [`EncodeError::PlaneSize`] when `pixels` does not hold `width` x `height` pixels, [`EncodeError::Window`] for an
/// empty picture.
pub fn png_rgb8(pixels: &[[u8; 3]], width: u32, height: u32) -> Result<Vec<u8>, EncodeError> {
    check_plane("color", pixels.len(), width, height)?;
    if pixels.is_empty() {
        return Err(EncodeError::Window { x0: 0, y0: 0, x1: width, y1: height, width, height });
    }
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive).write_image(
        pixels.as_flattened(),
        width,
        height,
        ExtendedColorType::Rgb8,
    )?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::png;
    use crate::color::View;
    use crate::encode::EncodeError;
    use glam::Vec3;

    #[test]
    fn pixels_come_back_as_the_view_says() {
        let color = [Vec3::ZERO, Vec3::splat(0.25), Vec3::new(1.0, 0.5, 4.0), Vec3::splat(f32::NAN)];
        let decode = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().to_rgb8().into_raw();
        let standard = decode(&png(&color, 2, 2, 1.0, View::Standard).unwrap());
        assert_eq!(standard, [0, 0, 0, 188, 188, 188, 255, 255, 255, 0, 0, 0]);
        let grey = decode(&png(&[Vec3::splat(0.09)], 1, 1, 1.0, View::Filmic).unwrap());
        assert_eq!(grey, [118, 118, 118]);
        let first = png(&color, 4, 1, 0.0, View::Filmic).unwrap();
        assert_eq!(first, png(&color, 4, 1, 0.0, View::Filmic).unwrap());
    }

    #[test]
    fn nonsense_is_refused() {
        let color = [Vec3::ONE; 4];
        assert!(matches!(png(&color, 3, 2, 0.0, View::Standard), Err(EncodeError::PlaneSize { .. })));
        assert!(matches!(png(&color, 2, 2, f32::NAN, View::Standard), Err(EncodeError::Exposure { .. })));
        assert!(matches!(png(&[], 0, 0, 0.0, View::Standard), Err(EncodeError::Window { .. })));
    }
}
