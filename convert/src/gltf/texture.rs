//! Owns textures: images become files of the document, samplers and transforms become fields.
//!
//! glTF counts v downwards from the top of the image, karst upwards from the bottom. The meshes say `flip_v`, so a
//! transform T of glTF becomes F T F with F: v → 1 - v.

use std::borrow::Cow;

use glam::{DAffine2, DMat2, DVec2};
use serde_json::{Value, json};

use super::description::{TextureInfo, TextureTransform};
use super::output::{Output, file_name};
use super::reader::{Named, Reader};
use crate::parts::{FLIP_V, Fields, fields, transform_uv};
use crate::{Asset, ConvertError};

/// What is taken out of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Taken {
    /// Its colour, by the sRGB curve.
    Color,
    /// Its numbers as they are.
    Data,
    /// One channel as it is.
    Channel(&'static str),
}

/// The texture as a document says it, or nothing where it is noted that it cannot be used. `set` is the number of the
/// texture coordinates that the mesh has.
pub(super) fn texture(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    info: &TextureInfo,
    set: u32,
    taken: Taken,
    place: &str,
) -> Result<Option<Value>, ConvertError> {
    let transform = info.extensions.transform.as_ref();
    let wanted = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
    if wanted != set {
        output.untranslated(
            place,
            format!("a texture on TEXCOORD_{wanted}; a mesh has one set, this one TEXCOORD_{set}"),
        );
        return Ok(None);
    }
    output.others(place, &info.extensions.others);
    let texture = reader.get(&reader.root.textures, info.index, place, "textures")?;
    let here = format!("textures[{}]", info.index);
    let Some(source) = texture.source else {
        let names: Vec<&str> = texture.extensions.keys().map(String::as_str).collect();
        output.untranslated(here, format!("has no PNG or JPEG image, only {:.100}", names.join(", ")));
        return Ok(None);
    };
    let Some(file) = image(reader, output, source, &here)? else { return Ok(None) };
    let mut fields = fields("image", [("file", json!(file))]);
    let space = if taken == Taken::Color { "srgb" } else { "linear" };
    fields.insert("color_space".to_owned(), json!(space));
    if let Taken::Channel(channel) = taken {
        fields.insert("channel".to_owned(), json!(channel));
    }
    if let Some(sampler) = texture.sampler {
        sample(reader, output, sampler, &mut fields, &here)?;
    }
    if let Some(transform) = transform {
        fields.insert("transform".to_owned(), flipped(reader, transform, place)?);
    }
    Ok(Some(Value::Object(fields)))
}

fn sample(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    index: u32,
    fields: &mut Fields,
    place: &str,
) -> Result<(), ConvertError> {
    let sampler = reader.get(&reader.root.samplers, index, place, "samplers")?;
    let here = format!("samplers[{index}]");
    let wrap = |code: Option<u32>| match code {
        None | Some(10497) => Ok("repeat"),
        Some(33071) => Ok("clamp"),
        Some(33648) => Ok("mirror"),
        Some(code) => Err(reader.error(&here, format!("found {code}, expected 10497, 33071 or 33648"))),
    };
    let (s, t) = (wrap(sampler.wrap_s)?, wrap(sampler.wrap_t)?);
    if s != t {
        output.differs(&here, format!("wrapS is {s} and wrapT is {t}: {s} is taken for both"));
    }
    if s != "repeat" {
        fields.insert("wrap".to_owned(), json!(s));
    }
    if sampler.mag_filter == Some(9728) {
        fields.insert("filter".to_owned(), json!("nearest"));
    }
    Ok(())
}

/// The transform of texture coordinates whose v runs upwards.
fn flipped(reader: &Reader<'_>, transform: &TextureTransform, place: &str) -> Result<Value, ConvertError> {
    let place = format!("{place}.KHR_texture_transform");
    let [u, v] = transform.offset;
    let [su, sv] = transform.scale;
    for number in [u, v, su, sv, transform.rotation] {
        reader.finite(number, &place)?;
    }
    // Counter-clockwise as seen is clockwise where v runs downwards.
    let there = DAffine2 {
        matrix2: DMat2::from_angle(-transform.rotation) * DMat2::from_diagonal(DVec2::new(su, sv)),
        translation: DVec2::new(u, v),
    };
    let map = FLIP_V * there * FLIP_V;
    for number in map.translation.to_array() {
        reader.finite(number, &place)?;
    }
    Ok(transform_uv(&map))
}

/// The path of the image's file in the document, or nothing where it is noted that it cannot be used.
fn image(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    index: u32,
    place: &str,
) -> Result<Option<String>, ConvertError> {
    if let Some(known) = output.images.get(&index) {
        return Ok(known.clone());
    }
    let image = reader.get(&reader.root.images, index, place, "images")?;
    let here = format!("images[{index}]");
    let named = image.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
    let name = image.name.as_deref().or_else(|| named?.rsplit('/').next()?.split('.').next());
    let path = |extension: &str| file_name("textures", index as usize, name, extension);
    let file = match (image.uri.as_deref(), image.buffer_view) {
        (Some(uri), None) => match reader.named(uri, &here)? {
            Named::File(file) => match known_extension(uri) {
                None => None,
                Some(extension) => {
                    let path = path(&extension);
                    output.assets.insert(path.clone(), Asset::File(file));
                    Some(path)
                }
            },
            Named::Bytes(bytes) => keep(reader, output, Cow::Owned(bytes), path, &here)?,
        },
        (None, Some(view)) => {
            let (bytes, _) = reader.view(view, &here)?;
            keep(reader, output, Cow::Borrowed(bytes), path, &here)?
        }
        _ => return Err(reader.error(here, "expected either uri or bufferView")),
    };
    if file.is_none() {
        output.untranslated(here, "the image is neither PNG nor JPEG");
    }
    output.images.insert(index, file.clone());
    Ok(file)
}

fn keep(
    reader: &Reader<'_>,
    output: &mut Output<'_>,
    bytes: Cow<'_, [u8]>,
    path: impl Fn(&str) -> String,
    place: &str,
) -> Result<Option<String>, ConvertError> {
    let extension = match &*bytes {
        [0x89, b'P', b'N', b'G', ..] => "png",
        [0xff, 0xd8, 0xff, ..] => "jpg",
        _ => return Ok(None),
    };
    let path = path(extension);
    output.keep(path.clone(), bytes).map_err(|message| reader.error(place, message))?;
    Ok(Some(path))
}

/// The ending of a file's name where it is that of an image that karst reads.
fn known_extension(uri: &str) -> Option<String> {
    let extension = uri.rsplit_once('.')?.1.to_ascii_lowercase();
    ["png", "jpg", "jpeg"].contains(&extension.as_str()).then_some(extension)
}
