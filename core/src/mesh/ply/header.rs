//! Owns the header of a PLY file.

use crate::mesh::MeshError;

/// Longest header, in bytes.
const MAX_HEADER: usize = 1 << 16;

/// What a PLY file announces.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) format: Format,
    pub(super) elements: Vec<Element>,
    /// Bytes up to the body.
    pub(super) length: usize,
}

/// How the numbers of the body are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A table of the body.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

/// A column of a table.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// Type of the number, or of the numbers in the list.
    pub(super) kind: Kind,
    /// Type of the length, when it is a list.
    pub(super) list: Option<Kind>,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size in binary files, in bytes.
    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

impl Element {
    /// Fewest bytes that one row takes.
    pub(super) fn least_bytes(&self, format: Format) -> u64 {
        let least = |property: &Property| match format {
            // A digit and a separator; the last row may lack the separator.
            Format::Ascii => 2,
            Format::LittleEndian | Format::BigEndian => property.list.unwrap_or(property.kind).size() as u64,
        };
        self.properties.iter().map(least).sum()
    }
}

impl Header {
    /// Reads the header at the start of a file.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, MeshError> {
        let (mut format, mut elements) = (None, Vec::<Element>::new());
        let mut at = 0;
        let mut number = 0_u64;
        loop {
            number += 1;
            let rest = &bytes[at..];
            let within = &rest[..rest.len().min(MAX_HEADER.saturating_sub(at))];
            let error = |message: String| MeshError::new(format!("line {number}"), message);
            let end = within.iter().position(|&byte| byte == b'\n');
            let end = end.ok_or_else(|| error("found no end_header within 64 KiB".to_owned()))?;
            let line = std::str::from_utf8(&rest[..end]).map_err(|_| error("expected text".to_owned()))?;
            at += end + 1;
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            let unknown = || error(format!("found {line:.80?}, expected a PLY header"));
            match words[..] {
                ["ply"] if number == 1 => {}
                _ if number == 1 => return Err(unknown()),
                ["format", word, "1.0"] => format = Some(parse_format(word).ok_or_else(unknown)?),
                ["comment" | "obj_info", ..] | [] => {}
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| unknown())?;
                    if elements.iter().any(|element| element.name == name) {
                        return Err(error(format!("found the element {name:?} twice")));
                    }
                    elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ref rest @ ..] => {
                    let element = elements.last_mut().ok_or_else(unknown)?;
                    element.properties.push(parse_property(rest).ok_or_else(unknown)?);
                }
                ["end_header"] => {
                    let format =
                        format.ok_or_else(|| error("found no format before end_header".to_owned()))?;
                    return Ok(Self { format, elements, length: at });
                }
                _ => return Err(unknown()),
            }
        }
    }
}

fn parse_format(word: &str) -> Option<Format> {
    match word {
        "ascii" => Some(Format::Ascii),
        "binary_little_endian" => Some(Format::LittleEndian),
        "binary_big_endian" => Some(Format::BigEndian),
        _ => None,
    }
}

fn parse_property(words: &[&str]) -> Option<Property> {
    match *words {
        ["list", length, kind, name] => {
            let list = Kind::parse(length).filter(|kind| !matches!(kind, Kind::F32 | Kind::F64))?;
            Some(Property { name: name.to_owned(), kind: Kind::parse(kind)?, list: Some(list) })
        }
        [kind, name] => Some(Property { name: name.to_owned(), kind: Kind::parse(kind)?, list: None }),
        _ => None,
    }
}
