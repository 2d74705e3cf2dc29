//! False colours for error and sample maps.

/// Colour of `t` from 0 (nothing) to 1 (most), as 8-bit sRGB; NaN is magenta, values outside are clamped.
///
/// Matplotlib's `inferno` (van der Walt and Smith 2015, CC0), as fitted by Matt Zucker (2019, public domain) with a
/// polynomial of degree six: perceptually uniform, dark to bright in grey print too.
pub fn false_color(t: f32) -> [u8; 3] {
    if t.is_nan() {
        return [255, 0, 255];
    }
    let t = t.clamp(0.0, 1.0);
    INFERNO.map(|c| {
        let value = c.iter().rev().fold(0.0, |sum, &coefficient| sum * t + coefficient);
        (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    })
}

/// Coefficients of red, green and blue, constant term first.
const INFERNO: [[f32; 7]; 3] = [
    [0.000_218_94, 0.106_513_42, 11.602_493, -41.703_995, 77.162_93, -71.319_43, 25.131_126],
    [0.001_651, 0.563_956_44, -3.972_854, 17.436_39, -33.402_36, 32.626_064, -12.242_669],
    [-0.019_480_9, 3.932_712_4, -15.942_394, 44.354_145, -81.807_31, 73.209_52, -23.070_325],
];

/// False colours of a map on a logarithmic scale from `low` (black) to `high` (bright), both positive.
pub fn heat_map(values: &[f32], low: f32, high: f32) -> Vec<[u8; 3]> {
    let (from, to) = (libm::log2f(low), libm::log2f(high));
    let span = (to - from).max(f32::MIN_POSITIVE);
    // The logarithm of a negative value is NaN and shows as such; that of 0 is -inf and shows as the lowest.
    values.iter().map(|&value| false_color((libm::log2f(value) - from) / span)).collect()
}

#[cfg(test)]
mod tests {
    use super::{false_color, heat_map};

    /// Matplotlib's table at 0, 64, 128, 192 and 255 of 255; the polynomial is within 3 % of it.
    #[test]
    fn agrees_with_the_published_table() {
        let table = [
            (0.0, [0, 0, 4]),
            (64.0 / 255.0, [87, 16, 110]),
            (128.0 / 255.0, [188, 55, 84]),
            (192.0 / 255.0, [249, 142, 9]),
            (1.0, [252, 255, 164]),
        ];
        for (t, expected) in table {
            let found = false_color(t);
            let worst = found.iter().zip(expected).map(|(&a, b)| a.abs_diff(b)).max().unwrap();
            assert!(worst <= 8, "{t}: {found:?} instead of {expected:?}");
        }
    }

    #[test]
    fn the_scale_is_logarithmic_and_marks_what_is_not_a_number() {
        let colors = heat_map(&[0.01, 0.1, 1.0, 0.0, 50.0, f32::NAN, -1.0], 0.01, 1.0);
        assert_eq!(colors[0], false_color(0.0));
        assert_eq!(colors[1], false_color(0.5));
        assert_eq!(colors[2], false_color(1.0));
        assert_eq!(colors[3], false_color(0.0));
        assert_eq!(colors[4], false_color(1.0));
        assert_eq!(colors[5], [255, 0, 255]);
        assert_eq!(colors[6], [255, 0, 255]);
    }
}
