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
}
