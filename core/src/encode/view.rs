//! From scene light to display values: exposure, then the standard or the filmic view, then the sRGB curve.

use glam::{Mat3, Vec3};

use crate::color::View;

/// Linear light as display-linear values from 0 to 1, before the sRGB curve.
///
/// The filmic view is Stephen Hill's fit of the ACES RRT and sRGB ODT (`BakingLab`, `ACES.hlsl`, 2016, MIT), exposed
/// so that middle grey (0.18) keeps its value: switching views changes the contrast, not the brightness.
pub fn display(light: Vec3, view: View) -> Vec3 {
    match view {
        View::Standard => light.clamp(Vec3::ZERO, Vec3::ONE),
        View::Filmic => hill(light * MIDDLE_GREY_GAIN).clamp(Vec3::ZERO, Vec3::ONE),
    }
}

/// Factor for which the fitted curve maps 0.18 to 0.18.
const MIDDLE_GREY_GAIN: f32 = 1.461_93;

/// sRGB to the rendering space of the fit: sRGB => XYZ => D65 to D60 => AP1 => RRT saturation (columns).
const INPUT: Mat3 = Mat3::from_cols(
    Vec3::new(0.59719, 0.07600, 0.02840),
    Vec3::new(0.35458, 0.90834, 0.13383),
    Vec3::new(0.04823, 0.01566, 0.83777),
);

/// ODT saturation => XYZ => D60 to D65 => sRGB (columns).
const OUTPUT: Mat3 = Mat3::from_cols(
    Vec3::new(1.60475, -0.10208, -0.00327),
    Vec3::new(-0.53108, 1.10813, -0.07276),
    Vec3::new(-0.07367, -0.00605, 1.07602),
);

/// The fit itself.
fn hill(light: Vec3) -> Vec3 {
    // Beyond this the curve is flat; infinities would become NaN in the quotient.
    let v = (INPUT * light.clamp(Vec3::ZERO, Vec3::splat(1e6))).max(Vec3::ZERO);
    let a = v * (v + 0.024_578_6) - 0.000_090_537;
    let b = v * (0.983_729 * v + 0.432_951) + 0.238_081;
    OUTPUT * (a / b)
}

/// sRGB curve (IEC 61966-2-1), encoded to display-linear.
fn srgb_decode(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// Rounds display-linear values to 8-bit sRGB exactly, by comparing with the 255 rounding points.
#[derive(Debug)]
pub(super) struct Srgb8 {
    thresholds: [f32; 255],
}

impl Srgb8 {
    pub(super) fn new() -> Self {
        Self { thresholds: std::array::from_fn(|code| srgb_decode((code as f64 + 0.5) / 255.0) as f32) }
    }

    /// NaN becomes 0.
    pub(super) fn encode(&self, linear: f32) -> u8 {
        self.thresholds.partition_point(|&threshold| threshold <= linear) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::{Srgb8, display, srgb_decode};
    use crate::color::View;
    use glam::Vec3;

    #[test]
    fn every_code_survives_decoding_and_encoding() {
        let curve = Srgb8::new();
        for code in 0..=255_u8 {
            assert_eq!(curve.encode(srgb_decode(f64::from(code) / 255.0) as f32), code);
        }
        assert_eq!(curve.encode(-1.0), 0);
        assert_eq!(curve.encode(2.0), 255);
        assert_eq!(curve.encode(f32::NAN), 0);
        // 0.5 linear is 187.5 of 255 in sRGB (0.735357).
        assert_eq!(curve.encode(0.5), 188);
    }

    #[test]
    fn filmic_keeps_middle_grey_rises_and_reaches_white() {
        let grey = display(Vec3::splat(0.18), View::Filmic);
        assert!((grey - 0.18).abs().max_element() < 5e-4, "{grey}");
        let mut last = -1.0;
        for step in 0..2000 {
            let value = display(Vec3::splat(step as f32 * 0.01), View::Filmic).x;
            assert!(value >= last, "falls at {step}");
            last = value;
        }
        assert!(last > 0.995, "{last}");
        assert_eq!(display(Vec3::ZERO, View::Filmic), Vec3::ZERO);
    }

    /// Figures computed in float64 from the published matrices and curve.
    #[test]
    fn filmic_agrees_with_the_published_fit() {
        for (light, expected) in FIT {
            let found = super::hill(Vec3::from_array(light));
            assert!((found - Vec3::from_array(expected)).abs().max_element() < 2e-6, "{light:?}: {found}");
        }
    }

    const FIT: [([f32; 3], [f32; 3]); 3] = [
        ([0.18, 0.18, 0.18], [0.105_591_25, 0.105_591_25, 0.105_590_19]),
        ([1.0, 0.5, 0.25], [0.634_990_4, 0.384_600_07, 0.203_160_36]),
        ([8.0, 1.0, 0.1], [1.079_254_4, 0.723_296_64, 0.302_199_55]),
    ];

    #[test]
    fn bright_saturated_light_goes_to_white_without_nan() {
        let torch = display(Vec3::new(400.0, 60.0, 4.0), View::Filmic);
        assert!(torch.min_element() > 0.8, "{torch}");
        for value in [f32::INFINITY, f32::MAX, -1.0] {
            assert!(display(Vec3::splat(value), View::Filmic).is_finite());
        }
    }
}
