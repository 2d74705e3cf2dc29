//! Writes one EXR part: beauty in `R G B`, the other layers as `Layer.Channel`, statistics as one JSON attribute.
//!
//! Channel names are the ones Blender writes and Nuke groups into layers: colours end in `R G B`, vectors in
//! `X Y Z`, depth is `Depth.Z`, single values end in `X` (as in Blender's `IndexOB.X`).

use std::io::{Cursor, Seek, Write};
use std::ops::Range;

use exr::block::BlockIndex;
use exr::block::UncompressedBlock;
use exr::image::write::WritableImage;
use exr::image::write::channels::{ChannelsWriter, WritableChannels};
use exr::image::{Blocks, Encoding, Image, Layer};
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, ChannelList, Chromaticities, IntegerBounds, LevelMode, LineOrder,
    SampleType, Text,
};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::Compression;
use glam::Vec3;

use crate::film::{Film, Picture, Region};

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

impl<'a> Layers<'a> {
    /// All layers of a picture, and the denoised one if there is one.
    fn of(picture: &'a Picture, denoised: Option<&'a [Vec3]>) -> Self {
        let window = &picture.window;
        Self {
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
        }
    }

    /// The same planes over some of their pixels.
    fn rows(&self, range: Range<usize>) -> Self {
        let vector = |plane: &'a [Vec3]| &plane[range.clone()];
        let scalar = |plane: &'a [f32]| &plane[range.clone()];
        Self {
            full: self.full,
            window: self.window,
            color: vector(self.color),
            albedo: self.albedo.map(vector),
            normal: self.normal.map(vector),
            depth: self.depth.map(scalar),
            samples: self.samples.map(scalar),
            error: self.error.map(scalar),
            evaluations: self.evaluations.map(scalar),
            denoised: self.denoised.map(vector),
        }
    }

    /// The channels in the order of the file, which is that of their names.
    fn channels(&self) -> Vec<Channel<'a>> {
        let mut channels = Vec::with_capacity(16);
        let vectors = [
            ("color", ["R", "G", "B"], Some(self.color)),
            ("albedo", ["Albedo.R", "Albedo.G", "Albedo.B"], self.albedo),
            ("normal", ["Normal.X", "Normal.Y", "Normal.Z"], self.normal),
            ("denoised", ["Denoised.R", "Denoised.G", "Denoised.B"], self.denoised),
        ];
        for (plane, names, pixels) in vectors {
            let Some(pixels) = pixels else { continue };
            let axes = names.into_iter().enumerate();
            channels.extend(axes.map(|(axis, name)| Channel {
                plane,
                name,
                values: Values::Axis(pixels, axis),
            }));
        }
        let scalars = [
            ("depth", "Depth.Z", self.depth),
            ("samples", "Samples.X", self.samples),
            ("error", "Error.X", self.error),
            ("evaluations", "Evaluations.X", self.evaluations),
        ];
        for (plane, name, values) in scalars {
            channels.extend(values.map(|values| Channel { plane, name, values: Values::Numbers(values) }));
        }
        channels.sort_unstable_by_key(|channel| channel.name);
        channels
    }
}

/// A channel of the file.
struct Channel<'a> {
    /// The plane that it belongs to.
    plane: &'static str,
    name: &'static str,
    values: Values<'a>,
}

/// Where a channel's numbers are.
enum Values<'a> {
    /// One axis of vectors.
    Axis(&'a [Vec3], usize),
    Numbers(&'a [f32]),
}

impl Values<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Axis(pixels, _) => pixels.len(),
            Self::Numbers(numbers) => numbers.len(),
        }
    }

    fn at(&self, index: usize) -> f32 {
        match self {
            Self::Axis(pixels, axis) => pixels[index][*axis],
            Self::Numbers(numbers) => numbers[index],
        }
    }
}

/// Width and height of a window, checked against the frame.
fn size(full: (u32, u32), window: (u32, u32, u32, u32)) -> Result<(u32, u32), EncodeError> {
    let (x0, y0, x1, y1) = window;
    let (width, height) = full;
    if x0 >= x1 || y0 >= y1 || x1 > width || y1 > height || width.max(height) > i32::MAX as u32 {
        return Err(EncodeError::Window { x0, y0, x1, y1, width, height });
    }
    Ok((x1 - x0, y1 - y0))
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
    write_exr(&Layers::of(picture, denoised), statistics)
}

/// Writes [`exr()`] of a film's window, resolved a band of rows at a time: however large it is, no second picture of it is in
/// memory.
///
/// # Errors
/// Those of [`write_exr`], and what `to` cannot take.
pub fn film_exr(
    film: &Film,
    denoised: Option<&[Vec3]>,
    statistics: &serde_json::Value,
    to: impl Write + Seek,
) -> Result<(), EncodeError> {
    let (size, window) = (film.size(), film.window());
    if let Some(denoised) = denoised {
        check_plane("denoised", denoised.len(), window.width(), window.height())?;
    }
    let width = window.width() as usize;
    let band = |rows: Range<usize>, take: &mut dyn FnMut(&Layers<'_>)| {
        let part = Region { y0: window.y0 + rows.start as u32, y1: window.y0 + rows.end as u32, ..window };
        let denoised = denoised.map(|plane| &plane[rows.start * width..rows.end * width]);
        take(&Layers::of(&film.region(part), denoised));
    };
    let full = (size.width, size.height);
    write_bands(full, (window.x0, window.y0, window.x1, window.y1), statistics, band, to)
}

/// Encodes the layers as an EXR file: one part, f32, ZIP in scan-line blocks, the window placed in the frame.
///
/// `statistics` becomes the text attribute `karst`, as JSON in ASCII with the object's own key order.
///
/// # Errors
/// [`EncodeError::Window`] for an empty window or one outside the frame, [`EncodeError::PlaneSize`] for a plane
/// of another size than the window.
pub fn write_exr(layers: &Layers<'_>, statistics: &serde_json::Value) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = size(layers.full, layers.window)?;
    for channel in layers.channels() {
        check_plane(channel.plane, channel.values.len(), width, height)?;
    }
    let width = width as usize;
    let band = |rows: Range<usize>, take: &mut dyn FnMut(&Layers<'_>)| {
        take(&layers.rows(rows.start * width..rows.end * width));
    };
    let mut bytes = Cursor::new(Vec::new());
    write_bands(layers.full, layers.window, statistics, band, &mut bytes)?;
    Ok(bytes.into_inner())
}

/// Writes the file: `band` hands over the layers of some rows of the window.
fn write_bands<B>(
    full: (u32, u32),
    window: (u32, u32, u32, u32),
    statistics: &serde_json::Value,
    band: B,
    to: impl Write + Seek,
) -> Result<(), EncodeError>
where
    B: Fn(Range<usize>, &mut dyn FnMut(&Layers<'_>)) + Sync,
{
    let (width, height) = size(full, window)?;
    let mut own = LayerAttributes {
        layer_position: Vec2(window.0 as i32, window.1 as i32),
        software_name: Some(Text::new_or_panic("karst")),
        ..LayerAttributes::default()
    };
    // Exactly one attribute in this map: the library writes maps in an order that changes from run to run.
    own.other.insert(
        Text::new_or_panic("karst"),
        AttributeValue::Text(Text::new_or_panic(ascii_json(statistics)?)),
    );

    let frame = IntegerBounds::from_dimensions((full.0 as usize, full.1 as usize));
    let shared = ImageAttributes { chromaticities: Some(REC709), ..ImageAttributes::new(frame) };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new((width as usize, height as usize), own, encoding, Bands(band));
    Image { attributes: shared, layer_data: layer }.write().to_buffered(to)?;
    Ok(())
}

/// ITU-R BT.709 primaries and D65, as CIE xy.
const REC709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Layers that are asked for as the file is written, a block of rows at a time.
struct Bands<B>(B);

impl<'a, B> WritableChannels<'a> for Bands<B>
where
    B: Fn(Range<usize>, &mut dyn FnMut(&Layers<'_>)) + Sync + 'a,
{
    type Writer = &'a Self;

    fn infer_channel_list(&self) -> ChannelList {
        let mut list = Vec::new();
        // Every row has the same channels.
        (self.0)(0..1, &mut |layers| {
            let of = |channel: &Channel<'_>| {
                ChannelDescription::named(Text::new_or_panic(channel.name), SampleType::F32)
            };
            list = layers.channels().iter().map(of).collect();
        });
        ChannelList::new(list.into())
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_writer(&'a self, _: &Header) -> &'a Self {
        self
    }
}

impl<B> ChannelsWriter for &Bands<B>
where
    B: Fn(Range<usize>, &mut dyn FnMut(&Layers<'_>)) + Sync,
{
    fn extract_uncompressed_block(&self, header: &Header, block: BlockIndex) -> Vec<u8> {
        let first = block.pixel_position.y();
        let mut bytes = Vec::new();
        (self.0)(first..first + block.pixel_size.height(), &mut |layers| {
            let channels = layers.channels();
            bytes = UncompressedBlock::collect_block_data_from_lines(&header.channels, block, |line| {
                let Vec2(x, y) = line.location.position;
                let start = (y - first) * header.layer_size.width() + x;
                let values = &channels[line.location.channel].values;
                // The line is as long as it has to be: such a write cannot fail.
                let _ = line.write_samples(|index| values.at(start + index));
            });
        });
        bytes
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
