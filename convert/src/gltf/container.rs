//! Owns the container of a `.glb` file: the JSON and the one binary part.

use super::description::Root;
use crate::ConvertError;

/// What a file consists of.
#[derive(Debug)]
pub(super) struct Parts<'a> {
    pub(super) json: &'a [u8],
    /// The binary part of a `.glb` file.
    pub(super) binary: Option<&'a [u8]>,
}

const JSON: &[u8] = b"JSON";
const BINARY: &[u8] = b"BIN\0";

/// Takes a file apart; whether it is binary is told by its first bytes, not by its name.
pub(super) fn split<'a>(bytes: &'a [u8], file: &str) -> Result<Parts<'a>, ConvertError> {
    let error = |message: String| ConvertError::scene(file, 0, message);
    let Some(rest) = bytes.strip_prefix(b"glTF") else {
        return Ok(Parts { json: bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes), binary: None });
    };
    let (Some((version, rest)), true) = (word(rest), rest.len() >= 8) else {
        return Err(error(format!("found {} bytes, expected a header of 12", bytes.len())));
    };
    if version != 2 {
        return Err(error(format!("found version {version} of the container, expected 2")));
    }
    // The length in the header must hold, bytes after it do not count.
    let length = word(rest).map_or(0, |(length, _)| length as usize);
    let Some(mut rest) = bytes.get(12..length) else {
        return Err(error(format!("the header says {length} bytes, the file has {}", bytes.len())));
    };
    let (mut json, mut binary) = (None, None);
    while rest.len() >= 8 {
        let (head, body) = rest.split_at(8);
        let size = word(head).map_or(0, |(size, _)| size as usize);
        let Some(chunk) = body.get(..size) else {
            let at = length - rest.len();
            let left = body.len();
            return Err(error(format!("offset {at}: found a chunk of {size} bytes, {left} follow")));
        };
        match &head[4..] {
            JSON if json.is_none() => json = Some(chunk),
            BINARY if binary.is_none() => binary = Some(chunk),
            // The format says that other chunks are passed over.
            _ => {}
        }
        rest = &body[size..];
    }
    let json = json.ok_or_else(|| error("found no JSON chunk, expected one first".to_owned()))?;
    Ok(Parts { json, binary })
}

/// A number of 32 bits and what follows it.
fn word(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (word, rest) = bytes.split_first_chunk::<4>()?;
    Some((u32::from_le_bytes(*word), rest))
}

/// Reads the JSON; it may have `max_objects` objects, so that its size in memory is bounded before it is taken.
pub(super) fn read_json(json: &[u8], file: &str, max_objects: u64) -> Result<Root, ConvertError> {
    let objects = json.iter().filter(|&&byte| byte == b'{').count() as u64;
    if objects > max_objects {
        let message = format!("found {objects} JSON objects, the limit is {max_objects}");
        return Err(ConvertError::scene(file, 0, message));
    }
    let root: Root = serde_json::from_slice(json)
        .map_err(|error| ConvertError::scene(file, error.line() as u32, format!("not glTF: {error}")))?;
    let version = &root.asset.version;
    if !version.starts_with("2.") {
        let message = format!("asset.version: found {version:.20?}, expected \"2.0\"");
        return Err(ConvertError::scene(file, 0, message)
            .with_hint("convert the file to glTF 2.0 with the program that made it"));
    }
    Ok(root)
}
