//! Owns access to a glTF file: entries by index, bytes of buffers and files beside it, errors with their place.

use std::borrow::Cow;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use karst_core::scene::{AssetSource, Folder, Limits};

use super::description::Root;
use crate::ConvertError;

/// Where bytes that a file names are.
#[derive(Debug)]
pub(super) enum Named {
    /// In the name itself.
    Bytes(Vec<u8>),
    /// In a file below the folder of the glTF file.
    File(PathBuf),
}

/// A file that is being read.
#[derive(Debug)]
pub(super) struct Reader<'a> {
    pub(super) root: &'a Root,
    pub(super) limits: &'a Limits,
    file: &'a str,
    folder: Option<(&'a Path, Folder)>,
    buffers: Vec<Cow<'a, [u8]>>,
}

impl<'a> Reader<'a> {
    /// A reader of `root`, with all buffers in memory. Files beside it are looked for below `folder`.
    pub(super) fn new(
        file: &'a str,
        root: &'a Root,
        binary: Option<&'a [u8]>,
        folder: Option<&'a Path>,
        limits: &'a Limits,
    ) -> Result<Self, ConvertError> {
        let open = |path: &'a Path| match Folder::new(path) {
            Ok(folder) => Ok((path, folder)),
            Err(source) => Err(ConvertError::File { path: path.to_owned(), source }),
        };
        let folder = folder.map(open).transpose()?;
        let mut reader = Self { root, limits, file, folder, buffers: Vec::new() };
        let mut left = limits.max_asset_bytes;
        for index in 0..root.buffers.len() {
            let bytes = reader.buffer(index, binary, left)?;
            if let Cow::Owned(bytes) = &bytes {
                left = left.saturating_sub(bytes.len() as u64);
            }
            reader.buffers.push(bytes);
        }
        Ok(reader)
    }

    /// A problem at a place in the file, such as `nodes[3].mesh`.
    pub(super) fn error(&self, place: impl Display, message: impl Display) -> ConvertError {
        ConvertError::scene(self.file, 0, format!("{place}: {message}"))
    }

    /// An entry of a table of the file.
    pub(super) fn get<'b, T>(
        &self,
        table: &'b [T],
        index: u32,
        place: impl Display,
        name: &str,
    ) -> Result<&'b T, ConvertError> {
        let count = table.len();
        table
            .get(index as usize)
            .ok_or_else(|| self.error(place, format!("found the index {index}, the file has {count} {name}")))
    }

    /// The number in single precision, where it is one that it can hold.
    pub(super) fn finite(&self, number: f64, place: impl Display) -> Result<f64, ConvertError> {
        if (number as f32).is_finite() {
            return Ok(number);
        }
        Err(self.error(place, format!("found {number:?}, expected at most {:e}", f32::MAX)))
    }

    fn buffer(
        &self,
        index: usize,
        binary: Option<&'a [u8]>,
        left: u64,
    ) -> Result<Cow<'a, [u8]>, ConvertError> {
        let place = format!("buffers[{index}]");
        let length = self.root.buffers[index].byte_length;
        let bytes = match (&self.root.buffers[index].uri, binary) {
            (None, Some(binary)) if index == 0 => Cow::Borrowed(binary),
            (None, _) => return Err(self.error(place, "found no uri and no binary part that it stands for")),
            (Some(uri), _) => match self.named(uri, &place)? {
                Named::Bytes(bytes) => Cow::Owned(bytes),
                Named::File(path) => Cow::Owned(self.read(&path, uri, &place, left)?),
            },
        };
        let found = bytes.len() as u64;
        if found < length {
            return Err(self.error(place, format!("found {found} bytes, byteLength says {length}")));
        }
        Ok(bytes)
    }

    /// Bytes of a file beside the glTF file, of which `left` may still be read.
    fn read(&self, path: &Path, uri: &str, place: &str, left: u64) -> Result<Vec<u8>, ConvertError> {
        let unread = |error: std::io::Error| self.error(place, format!("{uri:.200?}: {error}"));
        let size = std::fs::metadata(path).map_err(unread)?.len();
        if size > left {
            let message = format!("{uri:.200?} has {size} bytes, {left} are left of the limit for all files");
            return Err(self.error(place, message));
        }
        std::fs::read(path).map_err(unread)
    }

    /// What a uri stands for: data, or a file that is there.
    pub(super) fn named(&self, uri: &str, place: &str) -> Result<Named, ConvertError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, text)) = data.split_once(";base64,") else {
                return Err(self.error(place, format!("found {uri:.40?}, expected data in base64")));
            };
            let bytes = STANDARD.decode(text.trim_ascii());
            let wrong = |error| self.error(place, format!("the data is not base64: {error}"));
            return bytes.map(Named::Bytes).map_err(wrong);
        }
        let Some((path, folder)) = &self.folder else {
            return Err(
                self.error(place, format!("found {uri:.200?}, files beside the scene are not read here"))
            );
        };
        let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
        let parts = name.split('/');
        let inside =
            !name.contains(['\\', ':']) && parts.clone().all(|part| !matches!(part, "" | "." | ".."));
        if !inside {
            let hint = "put the file into the scene's folder or below and name it relative to the scene";
            let message = format!("found {uri:.200?}, expected a file in the scene's folder or below");
            return Err(self.error(place, message).with_hint(hint));
        }
        match folder.len(&name) {
            Ok(_) => Ok(Named::File(path.join(&*name))),
            Err(error) => Err(self.error(place, format!("{uri:.200?}: {error}"))),
        }
    }

    /// The bytes of a buffer view, and the distance of its elements where it says one.
    pub(super) fn view(&self, index: u32, place: &str) -> Result<(&[u8], Option<u64>), ConvertError> {
        let view = self.get(&self.root.buffer_views, index, place, "buffer views")?;
        let here = format!("bufferViews[{index}]");
        if let Some((name, _)) = view.extensions.first_key_value() {
            return Err(self.error(here, format!("found bytes packed by {name}, which is not read")));
        }
        let buffer = self.get(&self.buffers, view.buffer, format!("{here}.buffer"), "buffers")?;
        let end = view.byte_offset.saturating_add(view.byte_length);
        let bytes = usize::try_from(end).ok().and_then(|end| buffer.get(view.byte_offset as usize..end));
        let bytes = bytes.ok_or_else(|| {
            let length = buffer.len();
            self.error(&here, format!("ends at byte {end}, buffer {} has {length}", view.buffer))
        })?;
        Ok((bytes, view.byte_stride))
    }
}
