//! The difference of two pictures as a picture: where, how much, and in which direction.

use karst_core::math::ln;

/// Difference that is drawn in the brightest colour, as a part of the reference.
const MOST: f32 = 1.0;

/// Colours of what is brighter than the reference, from no difference to most, 8-bit sRGB.
const BRIGHTER: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.0], [150.0, 20.0, 10.0], [250.0, 130.0, 20.0], [255.0, 245.0, 200.0]];

/// Colours of what is darker.
const DARKER: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.0], [15.0, 45.0, 165.0], [40.0, 160.0, 235.0], [215.0, 245.0, 255.0]];

/// Colour of pixels with an infinite value or not a number.
const BAD: [u8; 3] = [255, 0, 255];

/// A colour per pixel, 8-bit sRGB: black where nothing differs, red to yellow where `a` is brighter than the reference
/// `b`, blue to white where it is darker. The amount is the root of the mean square over the channels of
/// |a − b| / (|b| + 0.1), on a scale on which 1 %, 10 % and 100 % stand at 0.15, 0.52 and 1.
pub(crate) fn picture(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<[u8; 3]> {
    a.iter().zip(b).map(|(a, b)| color(*a, *b)).collect()
}

fn color(a: [f32; 3], b: [f32; 3]) -> [u8; 3] {
    let mut squares = 0.0;
    let mut sum = 0.0;
    for (a, b) in a.into_iter().zip(b) {
        let part = (a - b) / (b.abs() + 0.1);
        squares += part * part / 3.0;
        sum += a - b;
    }
    if !(squares.is_finite() && sum.is_finite()) {
        return BAD;
    }
    let ramp = if sum < 0.0 { &DARKER } else { &BRIGHTER };
    // The scale is logarithmic beyond a hundredth, and straight below it.
    let share = (ln(1.0 + 100.0 * squares.sqrt() / MOST) / ln(101.0)).min(1.0);
    let place = share * (ramp.len() - 1) as f32;
    let first = (place as usize).min(ramp.len() - 2);
    let weight = place - first as f32;
    std::array::from_fn(|channel| {
        (ramp[first][channel] * (1.0 - weight) + ramp[first + 1][channel] * weight + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::{BAD, color, picture};

    #[test]
    fn equal_is_black_brighter_is_red_and_darker_is_blue() {
        assert_eq!(color([0.5; 3], [0.5; 3]), [0, 0, 0]);
        let (brighter, darker) = (color([0.55; 3], [0.5; 3]), color([0.45; 3], [0.5; 3]));
        assert!(brighter[0] > 2 * brighter[2] && darker[2] > 2 * darker[0], "{brighter:?} {darker:?}");
        // Brighter in one channel by more than it is darker in another, and the other way round.
        assert!(color([0.9, 0.4, 0.5], [0.5; 3])[0] > 100);
        assert!(color([0.6, 0.1, 0.5], [0.5; 3])[2] > 100);
    }

    #[test]
    fn the_amount_is_that_of_the_formula() {
        // |1.1 - 1| / 1.1 in every channel is 1/11: ln(1 + 100/11) / ln 101 = 0.500722, halfway into the second part.
        let place = 3.0 * 0.500_722;
        let expected =
            [150.0 + 100.0 * (place - 1.0), 20.0 + 110.0 * (place - 1.0), 10.0 + 10.0 * (place - 1.0)];
        for (found, expected) in color([1.1; 3], [1.0; 3]).into_iter().zip(expected) {
            assert!((f32::from(found) - expected).abs() <= 0.51, "{found}, expected {expected}");
        }
        // All of the reference, and more, in one colour; 1 % can be seen.
        assert_eq!(color([1000.0; 3], [1.0; 3]), [255, 245, 200]);
        assert_eq!(color([-1000.0; 3], [1.0; 3]), [215, 245, 255]);
        assert!(color([1.01; 3], [1.0; 3])[0] > 50);
    }

    #[test]
    fn bad_pixels_are_magenta() {
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
        for value in bad {
            assert_eq!(picture(&[[value, 0.0, 0.0]], &[[0.0; 3]]), [BAD], "{value}");
        }
        assert_eq!(picture(&[[1.0; 3]], &[[f32::NAN; 3]]), [BAD]);
    }
}
