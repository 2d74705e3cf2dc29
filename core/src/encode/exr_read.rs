//! Reads the first flat part of an EXR file of any origin into f32 planes; sizes are checked before allocation.

use std::io::Cursor;

use exr::image::FlatSamples;
use exr::image::read::image::ReadLayers;
use exr::image::read::layers::ReadChannels;
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};
use exr::meta::header::Header;

use super::EncodeError;

/// Most values (pixels times channels) read from one file: fifteen channels of an 8192 x 8192 frame.
const MAX_VALUES: u64 = 15 << 26;

/// No compression of EXR packs more values than this into a byte (deflate: 1032 bytes per byte at best).
const MAX_VALUES_PER_BYTE: u64 = 1100;

/// One decoded EXR part.
#[derive(Debug, Clone)]
pub struct ExrImage {
    /// Width of the data window in pixels.
    pub width: u32,
    /// Height of the data window in pixels.
    pub height: u32,
    /// Upper left pixel of the data window, counted from the upper left of the display window.
    pub origin: (i32, i32),
    /// Width and height of the display window (the full frame) in pixels.
    pub full: (u32, u32),
    /// Channels by name, in the file's (alphabetical) order; each row-major over the data window.
    pub channels: Vec<(String, Vec<f32>)>,
    /// What karst wrote about the picture, if karst wrote it.
    pub statistics: Option<serde_json::Value>,
}

impl ExrImage {
    /// The plane of a channel.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(other, _)| other == name).map(|(_, plane)| plane.as_slice())
    }
}

/// Decodes the first flat part of an EXR file, largest level only; halves and integers become f32.
///
/// # Errors
/// [`EncodeError::TooLarge`] and [`EncodeError::Truncated`] before anything large is allocated,
/// [`EncodeError::Unsupported`] for deep or subsampled channels, [`EncodeError::Exr`] for a broken file.
pub fn read_exr(bytes: &[u8]) -> Result<ExrImage, EncodeError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    let mut values = 0;
    for header in &meta.headers {
        values += header_values(header)?;
    }
    if values > MAX_VALUES_PER_BYTE * bytes.len() as u64 {
        return Err(EncodeError::Truncated { bytes: bytes.len(), values });
    }

    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))?;
    let (display, layer) = (image.attributes.display_window, image.layer_data);
    let position = layer.attributes.layer_position;
    let statistics = match layer.attributes.other.get(&Text::new_or_panic("karst")) {
        Some(AttributeValue::Text(text)) => serde_json::from_str(&text.to_string()).ok(),
        _ => None,
    };
    let channels = layer
        .channel_data
        .list
        .into_iter()
        .map(|channel| (channel.name.to_string(), floats(channel.sample_data)))
        .collect();
    Ok(ExrImage {
        width: layer.size.0 as u32,
        height: layer.size.1 as u32,
        origin: (
            position.0.saturating_sub(display.position.0),
            position.1.saturating_sub(display.position.1),
        ),
        full: (display.size.0 as u32, display.size.1 as u32),
        channels,
        statistics,
    })
}

/// Values that the header announces, refused when they are too many or of a kind that is not read.
fn header_values(header: &Header) -> Result<u64, EncodeError> {
    let (Vec2(width, height), channels) = (header.layer_size, header.channels.list.len());
    let values = (width as u64).saturating_mul(height as u64).saturating_mul(channels as u64);
    if values > MAX_VALUES {
        return Err(EncodeError::TooLarge { width, height, channels, limit: MAX_VALUES });
    }
    if header.deep {
        return Err(EncodeError::Unsupported("deep pixels are not read".into()));
    }
    match header.channels.list.iter().find(|channel| channel.sampling != Vec2(1, 1)) {
        Some(channel) => Err(EncodeError::Unsupported(format!(
            "channel {} is subsampled, which is not read",
            channel.name
        ))),
        None => Ok(values),
    }
}

fn floats(samples: FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F16(values) => values.into_iter().map(exr::prelude::f16::to_f32).collect(),
        FlatSamples::F32(values) => values,
        FlatSamples::U32(values) => values.into_iter().map(|value| value as f32).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::read_exr;
    use crate::encode::{EncodeError, Layers, write_exr};
    use glam::Vec3;
    use serde_json::json;

    fn file(width: u32, height: u32) -> Vec<u8> {
        let color = vec![Vec3::new(0.25, 0.5, 0.75); width as usize * height as usize];
        let layers = Layers {
            full: (width, height),
            window: (0, 0, width, height),
            color: &color,
            albedo: None,
            normal: None,
            depth: None,
            samples: None,
            error: None,
            evaluations: None,
            denoised: None,
        };
        write_exr(&layers, &json!({"a": 1})).unwrap()
    }

    /// Replaces both windows of the header.
    fn resize(bytes: &mut [u8], width: i32, height: i32) {
        for name in [b"dataWindow\0box2i\0".as_slice(), b"displayWindow\0box2i\0"] {
            let at = bytes.windows(name.len()).position(|window| window == name).unwrap() + name.len() + 4;
            bytes[at + 8..at + 12].copy_from_slice(&(width - 1).to_le_bytes());
            bytes[at + 12..at + 16].copy_from_slice(&(height - 1).to_le_bytes());
        }
    }

    #[test]
    fn a_header_that_lies_about_its_size_is_refused_before_allocation() {
        let mut bytes = file(8, 8);
        resize(&mut bytes, i32::MAX, i32::MAX);
        assert!(read_exr(&bytes).is_err());
        resize(&mut bytes, 1 << 20, 1 << 20);
        let error = read_exr(&bytes).unwrap_err();
        assert!(matches!(error, EncodeError::TooLarge { .. }), "{error}");
        resize(&mut bytes, 8192, 8192);
        assert!(matches!(read_exr(&bytes), Err(EncodeError::Truncated { .. })));
    }

    #[test]
    fn damaged_files_give_errors_or_pictures_but_never_a_panic() {
        let bytes = file(33, 20);
        for length in 0..bytes.len() {
            assert!(read_exr(&bytes[..length]).is_err(), "cut to {length} bytes");
        }
        for at in 0..bytes.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] ^= flip;
                let _ = read_exr(&damaged);
            }
        }
        assert!(read_exr(b"").is_err());
        assert!(read_exr(b"not an exr file at all").is_err());
    }
}
