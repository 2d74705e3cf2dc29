//! Writes 8-bit sRGB PNG files.

use glam::Vec3;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::EncodeError;
use crate::color::View;
use crate::film::{BLOCK, Film, Region};

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
    let gain = gain(exposure)?;
    check_plane("color", color.len(), width, height)?;
    png_rgb8(&exposed(color, gain, view), width, height)
}

/// [`png`] of a film's window, resolved a band of rows at a time.
///
/// # Errors
/// As [`png`].
pub fn film_png(film: &Film, exposure: f32, view: View) -> Result<Vec<u8>, EncodeError> {
    let (gain, window) = (gain(exposure)?, film.window());
    let mut pixels = Vec::with_capacity(window.area());
    for y0 in (window.y0..window.y1).step_by(BLOCK as usize) {
        let rows = Region { y0, y1: (y0 + BLOCK).min(window.y1), ..window };
        pixels.extend(exposed(&film.region(rows).color, gain, view));
    }
    png_rgb8(&pixels, window.width(), window.height())
}

fn gain(exposure: f32) -> Result<f32, EncodeError> {
    if (-64.0..=64.0).contains(&exposure) {
        Ok(libm::exp2f(exposure))
    } else {
        Err(EncodeError::Exposure { found: exposure })
    }
}

/// Linear Rec.709 light as 8-bit sRGB through the view.
pub fn rgb8(color: &[Vec3], view: View) -> Vec<[u8; 3]> {
    exposed(color, 1.0, view)
}

fn exposed(color: &[Vec3], gain: f32, view: View) -> Vec<[u8; 3]> {
    let curve = Srgb8::new();
    color
        .iter()
        .map(|&light| display(light * gain, view).to_array().map(|value| curve.encode(value)))
        .collect()
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
