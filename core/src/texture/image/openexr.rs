//! Reads EXR files: the first flat part with colours, its data window, largest level.

use std::io::Cursor;

use exr::block::samples::FromNativeSample;
use exr::image::read::image::ReadLayers;
use exr::image::read::layers::ReadChannels;
use exr::image::read::specific_channels::ReadSpecificChannel;
use exr::image::{Image as ExrFile, Layer, SpecificChannels};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{ChannelDescription, SampleType, Text};
use exr::meta::header::Header;
use half::f16;

use super::{Data, Image, ImageError, check_size};

/// The first bytes of such files.
pub(super) const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// No compression of EXR packs more values into a byte: deflate makes 1032 bytes of one, DWA 64 values of two.
const MAX_VALUES_PER_BYTE: u64 = 32 * 1032;

/// Reads a file of at most `left` texels. Every part is held against the limit, though only one is kept.
pub(super) fn read(bytes: &[u8], left: u64) -> Result<Image, ImageError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    for header in &meta.headers {
        check_header(header, bytes.len(), left)?;
    }
    let Some(choice) = meta.headers.iter().find_map(Choice::of) else {
        let names = meta.headers.iter().flat_map(|header| &header.channels.list);
        let names: Vec<String> = names.take(16).map(|channel| channel.name.to_string()).collect();
        return Err(ImageError::Channels { found: names.join(" ") });
    };
    if choice.half {
        choice.image(choice.decode(bytes)?, Data::Halves, f16::to_f32)
    } else {
        choice.image(choice.decode(bytes)?, Data::Floats, f32::from)
    }
}

/// Refuses sizes that are over the limit or that the bytes cannot hold.
fn check_header(header: &Header, bytes: usize, left: u64) -> Result<(), ImageError> {
    let Vec2(width, height) = header.layer_size;
    let limit = |size: usize| u32::try_from(size).unwrap_or(u32::MAX);
    let (width, height) = (limit(width), limit(height));
    check_size(width, height, left)?;
    let values = (u64::from(width) * u64::from(height)).saturating_mul(header.channels.list.len() as u64);
    if values > MAX_VALUES_PER_BYTE * bytes as u64 {
        return Err(ImageError::Truncated { width, height, bytes });
    }
    Ok(())
}

/// The channels of a part that are read.
struct Choice {
    /// Red, green and blue, or one grey; then alpha, if there is one.
    names: Vec<Text>,
    /// Whether halves hold all values.
    half: bool,
}

/// The values of the chosen channels, those of a texel together.
struct Values<S> {
    size: Vec2<usize>,
    channels: usize,
    values: Vec<S>,
}

impl<S: FromNativeSample> Values<S> {
    fn new(size: Vec2<usize>, channels: usize) -> Self {
        Self { size, channels, values: vec![S::default(); size.area() * channels] }
    }

    /// Takes a texel; alpha comes last and is left out where there is no room for it.
    fn set<const N: usize>(&mut self, position: Vec2<usize>, texel: [S; N]) {
        let first = position.flat_index_for_size(self.size) * self.channels;
        self.values[first..first + self.channels].copy_from_slice(&texel[..self.channels]);
    }
}

impl Choice {
    /// The colours of a part, if it has some that can be read.
    fn of(header: &Header) -> Option<Self> {
        let list = &header.channels.list;
        let find = |name: &str| list.iter().find(|channel| channel.name == *name);
        let colors = match (find("R"), find("G"), find("B"), find("Y")) {
            (Some(r), Some(g), Some(b), _) => vec![r, g, b],
            (_, _, _, Some(y)) => vec![y],
            _ if list.len() == 1 && find("A").is_none() => vec![&list[0]],
            _ => return None,
        };
        let chosen: Vec<&ChannelDescription> = colors.into_iter().chain(find("A")).collect();
        let flat = !header.deep && chosen.iter().all(|channel| channel.sampling == Vec2(1, 1));
        flat.then(|| Self {
            names: chosen.iter().map(|channel| channel.name.clone()).collect(),
            half: chosen.iter().all(|channel| channel.sample_type == SampleType::F16),
        })
    }

    /// Decodes the first part that has the chosen channels.
    fn decode<S: FromNativeSample>(&self, bytes: &[u8]) -> Result<Values<S>, ImageError> {
        let part = exr::prelude::read().no_deep_data().largest_resolution_level().specific_channels();
        let (one, channels) = (S::from_f32(1.0), self.names.len());
        // Alpha is asked for even where it is left out: there are two kinds of reader then, not four.
        if let [r, g, b, ..] = self.names.as_slice() {
            let reader = part
                .required(r.clone())
                .required(g.clone())
                .required(b.clone())
                .optional("A", one)
                .collect_pixels(
                    |size, _: &_| Values::new(size, channels),
                    |values: &mut Values<S>, position, (r, g, b, a): (S, S, S, S)| {
                        values.set(position, [r, g, b, a]);
                    },
                );
            let file: ExrFile<Layer<SpecificChannels<Values<S>, _>>> = reader
                .first_valid_layer()
                .all_attributes()
                .non_parallel()
                .from_buffered(Cursor::new(bytes))?;
            return Ok(file.layer_data.channel_data.pixels);
        }
        let reader = part.required(self.names[0].clone()).optional("A", one).collect_pixels(
            |size, _: &_| Values::new(size, channels),
            |values: &mut Values<S>, position, (y, a): (S, S)| values.set(position, [y, a]),
        );
        let file: ExrFile<Layer<SpecificChannels<Values<S>, _>>> =
            reader.first_valid_layer().all_attributes().non_parallel().from_buffered(Cursor::new(bytes))?;
        Ok(file.layer_data.channel_data.pixels)
    }

    /// The image, if all its values are finite.
    fn image<S: Copy>(
        &self,
        decoded: Values<S>,
        data: fn(Vec<S>) -> Data,
        float: fn(S) -> f32,
    ) -> Result<Image, ImageError> {
        let Values { size: Vec2(width, height), channels, values } = decoded;
        if let Some(index) = values.iter().position(|&value| !float(value).is_finite()) {
            let texel = index / channels;
            return Err(ImageError::NotFinite {
                x: (texel % width) as u32,
                y: (texel / width) as u32,
                channel: self.names[index % channels].to_string(),
                value: float(values[index]),
            });
        }
        Ok(Image { width: width as u32, height: height as u32, channels: channels as u8, data: data(values) })
    }
}
