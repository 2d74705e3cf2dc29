//! How different two pictures look: the metric FLIP (Andersson et al. 2020), by NVIDIA's own code.

use karst_core::color::View;
use karst_core::encode::rgb8;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8, flip};

use super::Pixels;

/// Largest picture that is judged: the library needs about a hundred bytes a pixel.
const MAX_PIXELS: usize = 1 << 26;

/// Mean FLIP of two pictures of the same size in the standard view, 0 (look the same) to 1, seen from 0.7 m on a screen
/// of 0.7 m and 3840 pixels; nothing for empty and gigantic pictures.
pub(crate) fn flip_mean(a: &Pixels, b: &Pixels, width: u32, height: u32) -> Option<f64> {
    let size = width as usize * height as usize;
    if size == 0 || size > MAX_PIXELS || a.len() != size || b.len() != size {
        return None;
    }
    let image = |pixels: &Pixels| {
        let color: Vec<_> = pixels.iter().map(|pixel| (*pixel).into()).collect();
        FlipImageRgb8::with_data(width, height, rgb8(&color, View::Standard).as_flattened())
    };
    let map = flip(image(b), image(a), DEFAULT_PIXELS_PER_DEGREE).to_vec();
    Some(map.iter().map(|&error| f64::from(error)).sum::<f64>() / size as f64)
}

#[cfg(test)]
mod tests {
    use super::flip_mean;
    use karst_core::math::powf;

    #[test]
    fn what_looks_the_same_is_0_and_black_against_white_is_1() {
        let grey = vec![[0.2; 3]; 64 * 48];
        assert_eq!(flip_mean(&grey, &grey, 64, 48), Some(0.0));
        let (black, white) = (vec![[0.0; 3]; 64 * 48], vec![[1.0; 3]; 64 * 48]);
        let found = flip_mean(&black, &white, 64, 48).unwrap();
        assert!(found > 0.95 && found <= 1.0, "{found}");
        // Above white nothing is seen.
        assert_eq!(flip_mean(&vec![[7.0; 3]; 64 * 48], &white, 64, 48), Some(0.0));
        assert_eq!(flip_mean(&Vec::new(), &Vec::new(), 0, 0), None);
    }

    /// The figure is that of the authors' Python package (flip-evaluator 1.7, LDR-FLIP) for the same 8-bit pictures.
    #[test]
    fn the_figure_is_that_of_another_build_of_the_metric() {
        let linear = |code: u32| {
            let code = code.min(255) as f32 / 255.0;
            if code <= 0.04045 { code / 12.92 } else { powf((code + 0.055) / 1.055, 2.4) }
        };
        let pixels = |noise: fn(u32, u32) -> u32| -> Vec<[f32; 3]> {
            let places = (0..48).flat_map(|y| (0..64).map(move |x| (x, y)));
            places.map(|(x, y)| [4 * x + noise(x, y), 5 * y, 128 - noise(x, y)].map(linear)).collect()
        };
        let found = flip_mean(&pixels(|x, y| (7 * x + 13 * y) % 32), &pixels(|_, _| 0), 64, 48).unwrap();
        assert!((found - 0.227_290).abs() < 1.0e-4, "{found}");
    }
}
