//! Owns accessors: typed numbers in buffers, read one at a time and never beyond their bytes.

use std::collections::BTreeMap;

use super::description;
use super::reader::Reader;
use crate::ConvertError;

/// Most elements of an accessor that has no bytes of its own: its size is not bounded by that of the file.
const MAX_ZEROS: u64 = 1 << 22;

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Kind {
    fn new(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    const fn size(self) -> u64 {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The number at the start of the bytes; 0 where there are too few, which the bounds of an accessor rule out.
    fn number(self, bytes: &[u8]) -> f64 {
        fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
            bytes.first_chunk::<N>().copied().unwrap_or([0; N])
        }
        match self {
            Self::I8 => i8::from_le_bytes(first(bytes)).into(),
            Self::U8 => u8::from_le_bytes(first(bytes)).into(),
            Self::I16 => i16::from_le_bytes(first(bytes)).into(),
            Self::U16 => u16::from_le_bytes(first(bytes)).into(),
            Self::U32 => u32::from_le_bytes(first(bytes)).into(),
            Self::F32 => f32::from_le_bytes(first(bytes)).into(),
        }
    }

    /// What a stored integer is divided by where it stands for a share.
    const fn unit(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 | Self::F32 => 1.0,
        }
    }
}

/// Numbers of `N` components in a row.
#[derive(Debug)]
pub(super) struct Accessor<'a, const N: usize> {
    /// From the first element on; empty where all of them are 0.
    bytes: &'a [u8],
    stride: usize,
    kind: Kind,
    unit: f64,
    count: u64,
    /// Elements that are not where the others are.
    replaced: BTreeMap<u32, [f64; N]>,
}

impl<'a, const N: usize> Accessor<'a, N> {
    /// The accessor with an index; `elements` is what may still be read of numbers outside the others' place.
    pub(super) fn open(
        reader: &'a Reader<'_>,
        index: u32,
        place: &str,
        elements: &mut u64,
    ) -> Result<Self, ConvertError> {
        let described = reader.get(&reader.root.accessors, index, place, "accessors")?;
        let place = format!("accessors[{index}]");
        let shape = ["SCALAR", "VEC2", "VEC3"][N - 1];
        if described.shape != shape {
            let found = &described.shape;
            return Err(reader.error(place, format!("found the type {found:.20?}, expected {shape:?}")));
        }
        let kind = kind(reader, described.component_type, &place)?;
        let count = described.count;
        if count == 0 || count > u64::from(u32::MAX) {
            return Err(reader.error(place, format!("found the count {count}, expected 1 to {}", u32::MAX)));
        }
        let size = kind.size() * N as u64;
        let (bytes, stride) = match described.buffer_view {
            Some(view) => slice(reader, view, described.byte_offset, count, size, &place)?,
            None if count > MAX_ZEROS => {
                let message = format!("found {count} elements without bytes, the limit is {MAX_ZEROS}");
                return Err(reader.error(place, message));
            }
            None => (&[][..], 0),
        };
        let unit = if described.normalized { kind.unit() } else { 1.0 };
        let mut accessor = Self { bytes, stride, kind, unit, count, replaced: BTreeMap::new() };
        if let Some(sparse) = &described.sparse {
            accessor.replace(reader, sparse, &place, elements)?;
        }
        Ok(accessor)
    }

    /// Number of elements, at least 1.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Whether its numbers are integers, as indices are.
    pub(super) fn is_unsigned(&self) -> bool {
        matches!(self.kind, Kind::U8 | Kind::U16 | Kind::U32)
    }

    /// An element; integers that stand for shares are divided.
    pub(super) fn get(&self, index: u32) -> [f64; N] {
        if let Some(replaced) = self.replaced.get(&index) {
            return *replaced;
        }
        self.element(self.bytes.get(index as usize * self.stride..).unwrap_or_default())
    }

    fn element(&self, bytes: &[u8]) -> [f64; N] {
        let size = self.kind.size() as usize;
        std::array::from_fn(|component| {
            let number = self.kind.number(bytes.get(component * size..).unwrap_or_default());
            if self.unit == 1.0 { number } else { (number / self.unit).max(-1.0) }
        })
    }

    fn replace(
        &mut self,
        reader: &'a Reader<'_>,
        sparse: &description::Sparse,
        place: &str,
        elements: &mut u64,
    ) -> Result<(), ConvertError> {
        let place = format!("{place}.sparse");
        let count = sparse.count;
        let wrong = count > self.count || count > *elements;
        if wrong {
            let most = self.count.min(*elements);
            return Err(reader.error(place, format!("found {count} elements, expected at most {most}")));
        }
        *elements -= count;
        let kind = kind(reader, sparse.indices.component_type, &place)?;
        let (view, offset) = (sparse.indices.buffer_view, sparse.indices.byte_offset);
        let (indices, step) = slice(reader, view, offset, count, kind.size(), &place)?;
        let size = self.kind.size() * N as u64;
        let (view, offset) = (sparse.values.buffer_view, sparse.values.byte_offset);
        let (values, stride) = slice(reader, view, offset, count, size, &place)?;
        for at in 0..count as usize {
            let index = kind.number(indices.get(at * step..).unwrap_or_default());
            if !(index >= 0.0 && index < self.count as f64 && index.fract() == 0.0) {
                let message = format!("found the index {index}, the accessor has {} elements", self.count);
                return Err(reader.error(place, message));
            }
            let value = self.element(values.get(at * stride..).unwrap_or_default());
            self.replaced.insert(index as u32, value);
        }
        Ok(())
    }
}

fn kind(reader: &Reader<'_>, code: u32, place: &str) -> Result<Kind, ConvertError> {
    Kind::new(code).ok_or_else(|| {
        let expected = "5120, 5121, 5122, 5123, 5125 or 5126";
        reader.error(place, format!("found the componentType {code}, expected {expected}"))
    })
}

/// The bytes of `count` elements of `size` bytes and their distance, once it is sure that they are all there.
fn slice<'a>(
    reader: &'a Reader<'_>,
    view: u32,
    offset: u64,
    count: u64,
    size: u64,
    place: &str,
) -> Result<(&'a [u8], usize), ConvertError> {
    let (bytes, stride) = reader.view(view, place)?;
    let stride = stride.unwrap_or(size);
    if stride < size {
        let message = format!("found the byteStride {stride}, its elements have {size} bytes");
        return Err(reader.error(place, message));
    }
    let length = count.saturating_sub(1).saturating_mul(stride).saturating_add(size);
    let end = if count == 0 { offset } else { offset.saturating_add(length) };
    let found = usize::try_from(end).ok().and_then(|end| bytes.get(offset as usize..end));
    match found {
        Some(found) => Ok((found, stride as usize)),
        None => {
            let has = bytes.len();
            Err(reader.error(place, format!("ends at byte {end}, buffer view {view} has {has}")))
        }
    }
}
