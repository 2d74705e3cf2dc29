//! How much two pictures of the same size differ: sums in f64 over R, G, B of all finite pixels.

mod flip;
mod picture;
mod tiles;

pub(crate) use flip::flip_mean;
pub(crate) use picture::picture;
pub(crate) use tiles::{Tile, worst_tiles};

/// A picture's colours, row by row.
pub(crate) type Pixels = Vec<[f32; 3]>;

/// See `karst compare --help` for the definitions.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Difference {
    /// The same bits.
    pub(crate) identical: bool,
    pub(crate) mse: f64,
    pub(crate) rel_mse: f64,
    /// Unknown when the reference is black or a picture has no finite pixel.
    pub(crate) mean_rel_diff: Option<f64>,
    pub(crate) mean_rel_diff_stderr: Option<f64>,
    /// Pixels with an infinite value or not a number in either picture; they are left out.
    pub(crate) nonfinite_pixels: u64,
}

/// Compares `a` with the reference `b`; both have the same length.
pub(crate) fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> Difference {
    let identical = a.iter().flatten().map(|x| x.to_bits()).eq(b.iter().flatten().map(|x| x.to_bits()));
    let mut sums = Sums::default();
    for (a, b) in a.iter().zip(b) {
        sums.add(a.map(f64::from), b.map(f64::from));
    }
    let values = (3.0 * sums.pixels).max(1.0);
    let known = sums.pixels > 0.0 && sums.reference > 0.0;
    // Standard error of the mean of the per-pixel differences, relative to the reference's mean.
    let variance = (sums.diff_squared - sums.diff * sums.diff / sums.pixels) / (sums.pixels - 1.0);
    let stderr = (variance.max(0.0) * sums.pixels).sqrt() / sums.reference;
    Difference {
        identical,
        mse: sums.squared / values,
        rel_mse: sums.relative / values,
        mean_rel_diff: known.then_some(sums.diff / sums.reference),
        mean_rel_diff_stderr: (known && sums.pixels > 1.0).then_some(stderr),
        nonfinite_pixels: sums.nonfinite,
    }
}

#[derive(Default)]
struct Sums {
    pixels: f64,
    nonfinite: u64,
    squared: f64,
    relative: f64,
    reference: f64,
    diff: f64,
    diff_squared: f64,
}

impl Sums {
    fn add(&mut self, a: [f64; 3], b: [f64; 3]) {
        if !a.iter().chain(&b).all(|x| x.is_finite()) {
            self.nonfinite += 1;
            return;
        }
        let mut diff = 0.0;
        for (a, b) in a.into_iter().zip(b) {
            self.squared += (a - b) * (a - b);
            self.relative += relative_square(a - b, b);
            self.reference += b;
            diff += a - b;
        }
        self.pixels += 1.0;
        self.diff += diff;
        self.diff_squared += diff * diff;
    }
}

/// relMSE to the reference that the noise of `a` alone makes, known from the same picture with other noise: the
/// difference of both has twice the variance. Pixels that are not finite are left out.
pub(crate) fn noise(a: &[[f32; 3]], repeat: &[[f32; 3]], reference: &[[f32; 3]]) -> f64 {
    let (mut sum, mut pixels) = (0.0, 0.0);
    for ((a, repeat), b) in a.iter().zip(repeat).zip(reference) {
        if a.iter().chain(repeat).chain(b).all(|x| x.is_finite()) {
            let values = a.iter().zip(repeat).zip(b);
            for ((a, repeat), b) in values {
                sum += relative_square(f64::from(*a) - f64::from(*repeat), f64::from(*b));
            }
            pixels += 1.0;
        }
    }
    sum / (3.0 * f64::max(pixels, 1.0)) / 2.0
}

/// The square of a difference as relMSE weighs it.
fn relative_square(difference: f64, reference: f64) -> f64 {
    difference * difference / (reference * reference + 0.01)
}

#[cfg(test)]
mod tests {
    use super::difference;

    #[test]
    fn equal_pictures_are_identical() {
        let a = [[1.0, 2.0, 3.0], [0.0, 0.5, 0.25]];
        let found = difference(&a, &a);
        assert!(found.identical);
        assert_eq!((found.mse, found.rel_mse, found.mean_rel_diff), (0.0, 0.0, Some(0.0)));
    }

    #[test]
    fn signed_zeros_are_not_identical() {
        assert!(!difference(&[[0.0; 3]], &[[-0.0; 3]]).identical);
    }

    #[test]
    fn figures_by_hand() {
        // Differences 1, 0, 0 in one pixel and 0 in another; reference 1 everywhere.
        let found = difference(&[[2.0, 1.0, 1.0], [1.0; 3]], &[[1.0; 3], [1.0; 3]]);
        assert!(!found.identical);
        assert!((found.mse - 1.0 / 6.0).abs() < 1e-12);
        assert!((found.rel_mse - 1.0 / 6.0 / 1.01).abs() < 1e-12);
        assert!((found.mean_rel_diff.unwrap() - 1.0 / 6.0).abs() < 1e-12);
        // Per-pixel differences 1 and 0: variance 1/2, of the sum 1, over the reference's sum of 6.
        assert!((found.mean_rel_diff_stderr.unwrap() - 1.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn the_standard_error_is_the_spread_of_means_of_noisy_pictures() {
        // Noise of a standard deviation of 1/√12 in each of three channels over a grey of 2.
        let noisy = |seed: u64| -> Vec<[f32; 3]> {
            let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
            let mut next = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f32 / (1 << 24) as f32 + 1.5
            };
            (0..1000).map(|_| [next(), next(), next()]).collect()
        };
        let pairs = (0..200).map(|pair| difference(&noisy(2 * pair + 1), &noisy(2 * pair + 2)));
        let found: Vec<(f64, f64)> =
            pairs.map(|found| (found.mean_rel_diff.unwrap(), found.mean_rel_diff_stderr.unwrap())).collect();
        // √(2 / 12) of a value, √3000 of them, over 2.
        let expected = (2.0_f64 / 12.0 / 3000.0).sqrt() / 2.0;
        for (_, stderr) in &found {
            assert!((stderr / expected - 1.0).abs() < 0.15, "{stderr}, expected {expected}");
        }
        let spread = (found.iter().map(|(mean, _)| mean * mean).sum::<f64>() / 200.0).sqrt();
        // The spread of 200 is known within 1/√400 of itself; four times that.
        assert!((spread / expected - 1.0).abs() < 0.2, "{spread}, expected {expected}");
    }

    #[test]
    fn bad_pixels_are_counted_and_left_out() {
        let found = difference(&[[f32::NAN, 1.0, 1.0], [1.0; 3]], &[[1.0; 3], [1.0; 3]]);
        assert_eq!((found.nonfinite_pixels, found.mse), (1, 0.0));
    }

    #[test]
    fn a_black_reference_has_no_relative_mean() {
        assert_eq!(difference(&[[1.0; 3]], &[[0.0; 3]]).mean_rel_diff, None);
    }
}
