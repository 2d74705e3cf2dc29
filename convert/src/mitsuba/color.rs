//! Owns colours: what a scene writes, as linear Rec.709.

use super::cie;
use super::value::{number, numbers, triple, words};

/// A colour as the scene writes it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Color {
    /// Linear Rec.709.
    Rgb([f64; 3]),
    /// The same at all wavelengths.
    Uniform(f64),
    /// Wavelengths in nm, growing, each with its value.
    Spectrum(Vec<[f64; 2]>),
}

/// What a colour is of; spectra mean another colour as light than as a share of light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Light that is sent out.
    Light,
    /// What happens to white light.
    Share,
}

/// Steps of the sum over wavelengths.
const STEPS: usize = 1000;

impl Color {
    /// `<rgb>`: one or three linear numbers, or `#rrggbb`, which is linear too.
    pub(super) fn rgb(text: &str) -> Result<Self, String> {
        if text.trim_start().starts_with('#') { hex(text) } else { triple(text) }.map(Self::Rgb)
    }

    /// `<srgb>`: one or three numbers, or `#rrggbb`, along the curve of sRGB.
    pub(super) fn srgb(text: &str) -> Result<Self, String> {
        let encoded = if text.trim_start().starts_with('#') { hex(text) } else { triple(text) }?;
        Ok(Self::Rgb(encoded.map(decode)))
    }

    /// `<spectrum>`: one number, pairs `wavelength:value`, or three numbers, which are a colour.
    pub(super) fn spectrum(text: &str) -> Result<Self, String> {
        if text.contains(':') {
            let pair = |word: &str| {
                let (wavelength, value) =
                    word.split_once(':').ok_or(format!("found {word:?}, expected wavelength:value"))?;
                Ok([number(wavelength)?, number(value)?])
            };
            return Self::table(words(text).map(pair).collect::<Result<_, String>>()?);
        }
        match numbers(text)?[..] {
            [one] => Ok(Self::Uniform(one)),
            [r, g, b] => Ok(Self::Rgb([r, g, b])),
            _ => Err(format!("found {text:.80?}, expected one number, or pairs wavelength:value")),
        }
    }

    /// A table of wavelengths and values.
    pub(super) fn table(pairs: Vec<[f64; 2]>) -> Result<Self, String> {
        if pairs.len() < 2 {
            return Err(format!("found a spectrum of {} wavelengths, expected at least 2", pairs.len()));
        }
        match pairs.windows(2).find(|two| two[1][0] <= two[0][0]) {
            Some(two) => {
                Err(format!("found the wavelength {} after {}, expected them to grow", two[1][0], two[0][0]))
            }
            None => Ok(Self::Spectrum(pairs)),
        }
    }

    /// The lines of a file of wavelengths and values.
    pub(super) fn table_file(text: &str) -> Result<Self, String> {
        let lines =
            text.lines().zip(1_u32..).filter(|(line, _)| !line.trim().is_empty() && !line.starts_with('#'));
        let pair = |(line, at): (&str, u32)| match numbers(line).as_deref() {
            Ok(&[wavelength, value]) => Ok([wavelength, value]),
            Ok(_) | Err(_) => Err(format!("line {at}: found {line:.80?}, expected a wavelength and a value")),
        };
        Self::table(lines.map(pair).collect::<Result<_, String>>()?)
    }

    /// The radiance of a black body of a temperature in kelvins, in W/(m² sr nm), times a factor (Planck's law).
    pub(super) fn blackbody(kelvin: f64, scale: f64) -> Result<Self, String> {
        // Planck's constant, the speed of light and Boltzmann's constant in units of the SI.
        const H: f64 = 6.626_069_57e-34;
        const C: f64 = 299_792_458.0;
        const K: f64 = 1.380_648_8e-23;
        if !(kelvin > 0.0 && kelvin <= 1.0e9) {
            return Err(format!("found a temperature of {kelvin} K, expected one above 0 and up to 1e9"));
        }
        let radiance = |wavelength: f64| {
            let energy = libm::expm1(H * C / (wavelength * K * kelvin));
            2.0 * H * C * C / (libm::pow(wavelength, 5.0) * energy)
        };
        let nanometre = 1.0e-9;
        let wavelengths = (0..=(cie::LAST - cie::FIRST) as u32).map(|step| cie::FIRST + f64::from(step));
        Self::table(wavelengths.map(|at| [at, scale * nanometre * radiance(at * nanometre)]).collect())
    }

    /// Linear Rec.709; channels outside the gamut become 0.
    pub(super) fn linear(&self, role: Role) -> [f64; 3] {
        match self {
            Self::Rgb(rgb) => *rgb,
            Self::Uniform(value) => [*value; 3],
            Self::Spectrum(pairs) => integrate(pairs, role),
        }
    }
}

/// `#rrggbb` from 0 to 1.
fn hex(text: &str) -> Result<[f64; 3], String> {
    let wrong = || format!("found {text:?}, expected # and six hexadecimal digits");
    let digits = text.trim().strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii());
    let digits = digits.ok_or_else(wrong)?;
    let channel = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).map(|byte| f64::from(byte) / 255.0);
    match [channel(0), channel(2), channel(4)] {
        [Ok(r), Ok(g), Ok(b)] if !digits.contains('+') => Ok([r, g, b]),
        _ => Err(wrong()),
    }
}

/// The curve of sRGB (IEC 61966-2-1) to linear light.
fn decode(value: f64) -> f64 {
    if value <= 0.040_45 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
}

/// What the standard observer sees, as linear Rec.709: under D65 where the spectrum is a share, so that 1 everywhere is
/// white; a spectrum of light is scaled so that 1 everywhere has the luminance 1.
fn integrate(pairs: &[[f64; 2]], role: Role) -> [f64; 3] {
    let (mut xyz, mut white) = ([0.0; 3], 0.0);
    for step in 0..STEPS {
        let wavelength = cie::FIRST + (cie::LAST - cie::FIRST) * step as f64 / (STEPS - 1) as f64;
        let at = |table: &[f64; cie::COUNT]| {
            let place = (wavelength - cie::FIRST) / (cie::LAST - cie::FIRST) * (cie::COUNT - 1) as f64;
            let index = (place as usize).min(cie::COUNT - 2);
            let part = place - index as f64;
            table[index] * (1.0 - part) + table[index + 1] * part
        };
        let light = if role == Role::Share { at(&cie::D65) } else { 1.0 };
        white += at(&cie::Y) * light;
        let value = interpolate(pairs, wavelength) * light;
        for (sum, table) in xyz.iter_mut().zip([&cie::X, &cie::Y, &cie::Z]) {
            *sum += at(table) * value;
        }
    }
    let [x, y, z] = xyz.map(|sum| sum / white);
    [
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ]
    .map(|channel| channel.max(0.0))
}

/// The value at a wavelength; 0 outside the table.
fn interpolate(pairs: &[[f64; 2]], wavelength: f64) -> f64 {
    let after = pairs.partition_point(|pair| pair[0] <= wavelength);
    match (after.checked_sub(1).map(|before| pairs[before]), pairs.get(after)) {
        (Some([w0, v0]), Some([w1, v1])) => v0 + (v1 - v0) * (wavelength - w0) / (w1 - w0),
        (Some([w0, v0]), None) if w0 == wavelength => v0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::{Color, Role};

    fn near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
        let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance);
        assert!(close, "{found:?} is not {expected:?}");
    }

    #[test]
    fn colours_are_read_in_every_spelling() {
        assert_eq!(Color::rgb("0.1, 0.2 0.3"), Ok(Color::Rgb([0.1, 0.2, 0.3])));
        assert_eq!(Color::rgb("2"), Ok(Color::Rgb([2.0; 3])));
        assert_eq!(Color::rgb("#ff0033"), Ok(Color::Rgb([1.0, 0.0, 0.2])));
        assert_eq!(Color::spectrum("0.5"), Ok(Color::Uniform(0.5)));
        assert_eq!(Color::spectrum("1 2 3"), Ok(Color::Rgb([1.0, 2.0, 3.0])));
        assert_eq!(
            Color::spectrum("400:0.1, 700:0.2"),
            Ok(Color::Spectrum(vec![[400.0, 0.1], [700.0, 0.2]]))
        );
        assert_eq!(Color::table_file("# nm\n400 0.1\n\n700 0.2\n"), Color::spectrum("400:0.1 700:0.2"));
        for wrong in ["#ff003", "#ff00zz", "#+f+f+f", "1 2"] {
            assert!(Color::rgb(wrong).is_err() && Color::srgb(wrong).is_err(), "{wrong}");
        }
        for wrong in ["400:1", "500:1 400:1", "400:1 500", "a:1 b:2", "1 2 3 4"] {
            assert!(Color::spectrum(wrong).is_err(), "{wrong}");
        }
        assert!(Color::table_file("400 1 2\n").is_err());
    }

    #[test]
    fn srgb_is_decoded() {
        let Ok(Color::Rgb(rgb)) = Color::srgb("#ff8000") else { panic!() };
        near(rgb, [1.0, 0.215_860_5, 0.0], 1e-6);
    }

    #[test]
    fn a_share_of_white_light_is_grey_and_flat_light_has_its_luminance() {
        let flat = Color::spectrum("300:0.5 900:0.5").unwrap();
        near(flat.linear(Role::Share), [0.5; 3], 1e-3);
        let [r, g, b] = flat.linear(Role::Light);
        assert!((0.212_671 * r + 0.715_160 * g + 0.072_169 * b - 0.5).abs() < 1e-4);
        // The white of equal energy in Rec.709, which is a little purple.
        near([r, g, b], [0.602_4, 0.474_1, 0.454_4], 1e-3);
    }

    #[test]
    fn hot_bodies_shine_as_they_are_known_to() {
        let linear = |kelvin: f64| Color::blackbody(kelvin, 1.0).unwrap().linear(Role::Light);
        let luminance = |[r, g, b]: [f64; 3]| 0.212_671 * r + 0.715_160 * g + 0.072_169 * b;
        // Illuminant A: chromaticity (0.4476, 0.4074), in Rec.709 at luminance 1.
        let bulb = linear(2856.0);
        near(bulb.map(|channel| channel / luminance(bulb)), [1.845, 0.826, 0.233], 4e-3);
        // Freezing platinum was the candela: 60 for each square centimetre. 683 lm are a watt, and the integral of the
        // observer's curve is 106.857 nm.
        let platinum = luminance(linear(2041.4)) * 683.0 * 106.857;
        assert!((platinum / 6.0e5 - 1.0).abs() < 0.01, "{platinum}");
        assert_eq!(linear(1.0), [0.0; 3]);
        let [half, whole] =
            [0.5, 1.0].map(|scale| Color::blackbody(5000.0, scale).unwrap().linear(Role::Light));
        near(half.map(|channel| channel * 2.0), whole, 1e-6 * whole[0]);
        for kelvin in [0.0, -1.0, 1.0e10] {
            assert!(Color::blackbody(kelvin, 1.0).unwrap_err().starts_with("found a temperature of"));
        }
    }

    #[test]
    fn outside_its_table_a_spectrum_is_dark() {
        // Only the middle of the table: outside it there is nothing.
        let green = Color::spectrum("520:1 540:1").unwrap().linear(Role::Share);
        assert!(green[1] > 0.2 && green[0] == 0.0 && green[2] < 0.02, "{green:?}");
    }
}
