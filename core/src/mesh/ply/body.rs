//! Owns the numbers of a PLY file's body, in any of its formats.

use crate::mesh::MeshError;
use crate::mesh::ply::header::{Element, Format, Kind, Property};

/// The body of a file, read from front to back.
#[derive(Debug)]
pub(super) struct Body<'a> {
    format: Format,
    bytes: &'a [u8],
    at: usize,
    /// Offset of the body in the file, for messages.
    offset: usize,
}

impl<'a> Body<'a> {
    /// The body of a file, which begins at `offset`.
    pub(super) fn new(format: Format, bytes: &'a [u8], offset: usize) -> Self {
        Self { format, bytes, at: 0, offset }
    }

    fn error(&self, message: impl Into<String>) -> MeshError {
        MeshError::new(format!("offset {}", self.offset + self.at), message)
    }

    /// Refuses a table that announces more rows than there are bytes for, before memory is taken for it.
    pub(super) fn expect(&self, element: &Element) -> Result<(), MeshError> {
        let left = (self.bytes.len() - self.at) as u64;
        // The separator after the last number of an ascii file may be missing.
        let needed = element.count.saturating_mul(element.least_bytes(self.format)).saturating_sub(1);
        if needed <= left {
            return Ok(());
        }
        let Element { name, count, .. } = element;
        Err(self
            .error(format!("found {left} bytes for {count} rows of {name:?}, expected at least {needed}")))
    }

    /// The length of a list, which is checked against the bytes that are left.
    pub(super) fn length(&mut self, list: &Property) -> Result<u64, MeshError> {
        let length = self.number(list.list.unwrap_or(list.kind))?;
        let size = if self.format == Format::Ascii { 1 } else { list.kind.size() };
        let left = ((self.bytes.len() - self.at) / size) as f64;
        if length >= 0.0 && length <= left && length.fract() == 0.0 {
            return Ok(length as u64);
        }
        Err(self.error(format!("found a list of {length} numbers, at most {left} follow")))
    }

    /// The next number.
    pub(super) fn number(&mut self, kind: Kind) -> Result<f64, MeshError> {
        match self.format {
            Format::Ascii => self.word(),
            Format::LittleEndian => self.binary(kind, false),
            Format::BigEndian => self.binary(kind, true),
        }
    }

    fn binary(&mut self, kind: Kind, big: bool) -> Result<f64, MeshError> {
        match kind {
            Kind::I8 => self.take(big).map(|bytes| f64::from(i8::from_le_bytes(bytes))),
            Kind::U8 => self.take(big).map(|bytes| f64::from(u8::from_le_bytes(bytes))),
            Kind::I16 => self.take(big).map(|bytes| f64::from(i16::from_le_bytes(bytes))),
            Kind::U16 => self.take(big).map(|bytes| f64::from(u16::from_le_bytes(bytes))),
            Kind::I32 => self.take(big).map(|bytes| f64::from(i32::from_le_bytes(bytes))),
            Kind::U32 => self.take(big).map(|bytes| f64::from(u32::from_le_bytes(bytes))),
            Kind::F32 => self.take(big).map(|bytes| f64::from(f32::from_le_bytes(bytes))),
            Kind::F64 => self.take(big).map(f64::from_le_bytes),
        }
    }

    /// The next bytes, turned around where the file is big endian.
    fn take<const N: usize>(&mut self, big: bool) -> Result<[u8; N], MeshError> {
        let Some(&found) = self.bytes[self.at..].first_chunk::<N>() else {
            return Err(self.error("found the end of the file, expected a number"));
        };
        self.at += N;
        let mut bytes = found;
        if big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn word(&mut self) -> Result<f64, MeshError> {
        let space = |byte: &u8| byte.is_ascii_whitespace();
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|byte| !space(byte)).unwrap_or(rest.len());
        self.at += start;
        let rest = &rest[start..];
        let length = rest.iter().position(space).unwrap_or(rest.len());
        let word = String::from_utf8_lossy(&rest[..length]);
        let number = word.parse().map_err(|_| self.error(format!("found {word:.40?}, expected a number")))?;
        self.at += length;
        Ok(number)
    }
}
