//! Writes one EXR part: beauty in `R G B`, the other layers as `Layer.Channel`, statistics as one JSON attribute.
//!
//! Channel names are the ones Blender writes and Nuke groups into layers: colours end in `R G B`, vectors in
//! `X Y Z`, depth is `Depth.Z`, single values end in `X` (as in Blender's `IndexOB.X`).

use std::io::Cursor;

use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, LineOrder, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{Compression, SmallVec};
use glam::Vec3;

use crate::film::Picture;

use super::EncodeError;

/// Planes of one picture, all row-major over the window; an absent plane is not written.
#[derive(Debug, Clone, Copy)]
pub struct Layers<'a> {
    /// Width and height of the whole frame in pixels.
    pub full: (u32, u32),
    /// Part of the frame that the planes cover: `x0, y0, x1, y1`, half open, in frame pixels.
    pub window: (u32, u32, u32, u32),
    /// Linear Rec.709 radiance.
    pub color: &'a [Vec3],
    /// Reflectance of the first rough hit, 0 to 1.
    pub albedo: Option<&'a [Vec3]>,
    /// World-space shading normal.
    pub normal: Option<&'a [Vec3]>,
    /// Distance along the camera ray in world units, `+inf` where nothing was hit.
    pub depth: Option<&'a [f32]>,
    /// Samples per pixel.
    pub samples: Option<&'a [f32]>,
    /// Estimate of the relative error per pixel.
    pub error: Option<&'a [f32]>,
    /// Evaluations of distance functions per sample.
    pub evaluations: Option<&'a [f32]>,
    /// Denoised radiance.
    pub denoised: Option<&'a [Vec3]>,
}

impl Layers<'_> {
    /// Width and height of the window, checked against the frame.
    fn size(&self) -> Result<(u32, u32), EncodeError> {
        let (x0, y0, x1, y1) = self.window;
        let (width, height) = self.full;
        if x0 >= x1 || y0 >= y1 || x1 > width || y1 > height || width.max(height) > i32::MAX as u32 {
            return Err(EncodeError::Window { x0, y0, x1, y1, width, height });
        }
        Ok((x1 - x0, y1 - y0))
    }
}

/// Encodes every layer of a picture, and the denoised one if there is one, as an EXR file; see [`write_exr`].
///
/// # Errors
/// Those of [`write_exr`].
pub fn exr(
    picture: &Picture,
    denoised: Option<&[Vec3]>,
    statistics: &serde_json::Value,
) -> Result<Vec<u8>, EncodeError> {
    let window = &picture.window;
    let layers = Layers {
        full: (picture.size.width, picture.size.height),
        window: (window.x0, window.y0, window.x1, window.y1),
        color: &picture.color,
        albedo: Some(&picture.albedo),
        normal: Some(&picture.normal),
        depth: Some(&picture.depth),
        samples: Some(&picture.samples),
        error: Some(&picture.error),
        evaluations: (!picture.evaluations.is_empty()).then_some(&picture.evaluations),
        denoised,
    };
    write_exr(&layers, statistics)
}

/// Encodes the layers as an EXR file: one part, f32, ZIP in scan-line blocks, the window placed in the frame.
///
/// `statistics` becomes the text attribute `karst`, as JSON in ASCII with the object's own key order.
///
/// # Errors
/// [`EncodeError::Window`] for an empty window or one outside the frame, [`EncodeError::PlaneSize`] for a plane
/// of another size than the window.
pub fn write_exr(layers: &Layers<'_>, statistics: &serde_json::Value) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = layers.size()?;
    let mut planes = Planes { width, height, list: SmallVec::new() };
    planes.vector(["R", "G", "B"], "color", Some(layers.color))?;
    planes.vector(["Albedo.R", "Albedo.G", "Albedo.B"], "albedo", layers.albedo)?;
    planes.vector(["Normal.X", "Normal.Y", "Normal.Z"], "normal", layers.normal)?;
    planes.scalar("Depth.Z", "depth", layers.depth)?;
    planes.scalar("Samples.X", "samples", layers.samples)?;
    planes.scalar("Error.X", "error", layers.error)?;
    planes.scalar("Evaluations.X", "evaluations", layers.evaluations)?;
    planes.vector(["Denoised.R", "Denoised.G", "Denoised.B"], "denoised", layers.denoised)?;

    let mut own = LayerAttributes {
        layer_position: Vec2(layers.window.0 as i32, layers.window.1 as i32),
        software_name: Some(Text::new_or_panic("karst")),
        ..LayerAttributes::default()
    };
    // Exactly one attribute in this map: the library writes maps in an order that changes from run to run.
    own.other.insert(
        Text::new_or_panic("karst"),
        AttributeValue::Text(Text::new_or_panic(ascii_json(statistics)?)),
    );

    let frame = IntegerBounds::from_dimensions((layers.full.0 as usize, layers.full.1 as usize));
    let shared = ImageAttributes { chromaticities: Some(REC709), ..ImageAttributes::new(frame) };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new((width as usize, height as usize), own, encoding, AnyChannels::sort(planes.list));
    let mut bytes = Cursor::new(Vec::new());
    Image { attributes: shared, layer_data: layer }.write().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

/// ITU-R BT.709 primaries and D65, as CIE xy.
const REC709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Channels collected so far, each checked to have the size of the window.
struct Planes {
    width: u32,
    height: u32,
    list: SmallVec<[AnyChannel<FlatSamples>; 4]>,
}

impl Planes {
    fn vector(
        &mut self,
        names: [&str; 3],
        plane: &'static str,
        pixels: Option<&[Vec3]>,
    ) -> Result<(), EncodeError> {
        let Some(pixels) = pixels else { return Ok(()) };
        check_plane(plane, pixels.len(), self.width, self.height)?;
        for (axis, name) in names.into_iter().enumerate() {
            self.push(name, pixels.iter().map(|pixel| pixel[axis]).collect());
        }
        Ok(())
    }

    fn scalar(&mut self, name: &str, plane: &'static str, pixels: Option<&[f32]>) -> Result<(), EncodeError> {
        let Some(pixels) = pixels else { return Ok(()) };
        check_plane(plane, pixels.len(), self.width, self.height)?;
        self.push(name, pixels.to_vec());
        Ok(())
    }

    fn push(&mut self, name: &str, values: Vec<f32>) {
        self.list.push(AnyChannel::new(Text::new_or_panic(name), FlatSamples::F32(values)));
    }
}

/// Refuses a plane that does not hold one value per pixel of `width` x `height`.
pub(super) fn check_plane(
    plane: &'static str,
    found: usize,
    width: u32,
    height: u32,
) -> Result<(), EncodeError> {
    let expected = width as usize * height as usize;
    if found == expected {
        Ok(())
    } else {
        Err(EncodeError::PlaneSize { plane, found, expected, width, height })
    }
}

/// JSON in ASCII: EXR text is bytes, so everything beyond ASCII is written as an escape of four hex digits.
fn ascii_json(value: &serde_json::Value) -> Result<String, EncodeError> {
    use std::fmt::Write as _;

    let text = serde_json::to_string(value)?;
    let mut ascii = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_ascii() {
            ascii.push(character);
        } else {
            for unit in character.encode_utf16(&mut [0; 2]) {
                // Writing to a string cannot fail.
                let _ = write!(ascii, "\\u{unit:04x}");
            }
        }
    }
    Ok(ascii)
}

#[cfg(test)]
mod tests {
    use super::{Layers, write_exr};
    use crate::encode::{EncodeError, read_exr};
    use glam::Vec3;
    use serde_json::json;

    fn ramp(count: usize, scale: f32) -> Vec<Vec3> {
        (0..count)
            .map(|i| {
                let x = i as f32 * scale;
                Vec3::new(x, x * 0.5 + 0.1, 1.0 / (x + 1.0))
            })
            .collect()
    }

    fn sample() -> Vec<u8> {
        let (color, albedo, normal) = (ramp(35 * 21, 0.37), ramp(35 * 21, 0.01), ramp(35 * 21, 0.02));
        let depth: Vec<f32> =
            (0..35 * 21).map(|i| if i % 7 == 0 { f32::INFINITY } else { i as f32 }).collect();
        let samples = vec![64.0; 35 * 21];
        let layers = Layers {
            full: (100, 60),
            window: (10, 20, 45, 41),
            color: &color,
            albedo: Some(&albedo),
            normal: Some(&normal),
            depth: Some(&depth),
            samples: Some(&samples),
            error: Some(&samples),
            evaluations: Some(&depth),
            denoised: Some(&color),
        };
        write_exr(&layers, &json!({"scene": "höhle 🦇", "spp_mean": 64.5, "seed": 0})).unwrap()
    }

    #[test]
    fn every_value_comes_back_exactly_and_in_place() {
        let image = read_exr(&sample()).unwrap();
        assert_eq!((image.width, image.height), (35, 21));
        assert_eq!(image.origin, (10, 20));
        assert_eq!(image.full, (100, 60));
        let names: Vec<&str> = image.channels.iter().map(|(name, _)| name.as_str()).collect();
        let expected = "Albedo.B Albedo.G Albedo.R B Denoised.B Denoised.G Denoised.R Depth.Z Error.X Evaluations.X \
                        G Normal.X Normal.Y Normal.Z R Samples.X";
        assert_eq!(names.join(" "), expected);
        let color = ramp(35 * 21, 0.37);
        for (axis, name) in ["R", "G", "B"].into_iter().enumerate() {
            let plane = image.channel(name).unwrap();
            assert!(plane.iter().zip(&color).all(|(a, b)| a.to_bits() == b[axis].to_bits()), "{name}");
        }
        assert_eq!(image.channel("Depth.Z").unwrap()[7], f32::INFINITY);
        assert_eq!(image.channel("Normal.Y").unwrap()[1], ramp(2, 0.02)[1].y);
        assert_eq!(image.statistics.unwrap()["scene"], "höhle 🦇");
    }

    #[test]
    fn identical_pixels_give_identical_bytes() {
        let first = sample();
        for _ in 0..8 {
            assert!(first == sample(), "two encodings of the same picture differ");
        }
    }

    /// The bytes must not depend on anything that differs between two runs of the program (hash seeds, times).
    #[test]
    fn another_process_writes_the_same_bytes() {
        let digest = |bytes: &[u8]| {
            use sha2::{Digest, Sha256};
            Sha256::digest(bytes).iter().fold(String::new(), |text, byte| format!("{text}{byte:02x}"))
        };
        let own = digest(&sample());
        println!("digest={own}");
        if std::env::args().any(|argument| argument == "--exact") {
            return;
        }
        let name = "encode::exr_write::tests::another_process_writes_the_same_bytes";
        let output = std::process::Command::new(std::env::current_exe().unwrap())
            .args([name, "--exact", "--nocapture"])
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(text.contains(&format!("digest={own}")), "expected {own} in: {text}");
    }

    #[test]
    fn wrong_sizes_are_refused_with_figures() {
        let color = ramp(12, 1.0);
        let mut layers = Layers {
            full: (4, 4),
            window: (0, 0, 4, 3),
            color: &color,
            albedo: None,
            normal: None,
            depth: None,
            samples: None,
            error: None,
            evaluations: None,
            denoised: Some(&color[1..]),
        };
        let error = write_exr(&layers, &json!({})).unwrap_err();
        assert_eq!(error.to_string(), "denoised: found 11 pixels, expected 12 (4 x 3)");
        for window in [(0, 0, 0, 3), (2, 0, 6, 3), (3, 1, 1, 3), (0, 2, 4, 5)] {
            layers.window = window;
            assert!(matches!(write_exr(&layers, &json!({})), Err(EncodeError::Window { .. })), "{window:?}");
        }
    }
}
