//! What goes through the pipes between karst and `karst-oidn`; all numbers little-endian.
//!
//! Request: magic (8 bytes), version, mode, threads, width, height (u32 each), then the planes color, albedo, normal
//! (the last two in full mode only), three f32 per pixel, row-major. The first two fields never change their place.
//!
//! Answer: magic (8 bytes), version, status (u32 each), length in bytes (u64), then the denoised plane (status 0) or
//! an error text in UTF-8 (status 1).

use std::io::{self, Read, Write};

/// First bytes of requests and answers.
pub const MAGIC: [u8; 8] = *b"KARSTDNZ";

/// Version of this format; both ends come from one build.
pub const VERSION: u32 = 1;

/// Most pixels of a picture: twice 8192 x 8192.
pub const MAX_PIXELS: u64 = 1 << 27;

/// Longest error text in bytes.
const MAX_TEXT: u64 = 1 << 16;

/// What OIDN is given besides the noisy radiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Nothing else.
    Color,
    /// Albedo and normal, each denoised first.
    Full,
}

/// What precedes the planes of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Which planes follow and how they are used.
    pub mode: Mode,
    /// Most threads to use; 0 means one for each processor.
    pub threads: u32,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

/// An answer of `karst-oidn`.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// The denoised plane.
    Denoised(Vec<[f32; 3]>),
    /// What went wrong.
    Failed(String),
    /// The other end speaks this other version.
    OtherVersion(u32),
}

/// What can be wrong with a request or an answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WireError {
    /// The pipe ended early or broke.
    #[error("the pipe broke: {0}")]
    Io(#[from] io::Error),
    /// The other end is not karst.
    #[error("found {found:?} at the start, expected {MAGIC:?}")]
    Magic {
        /// First bytes of the stream.
        found: [u8; 8],
    },
    /// The request is of another version.
    #[error("found version {found}, expected {VERSION}")]
    Version {
        /// Version of the request.
        found: u32,
    },
    /// A field has a value that means nothing.
    #[error("{field}: found {found}, expected at most {limit}")]
    Field {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        found: u64,
        /// Largest value allowed.
        limit: u64,
    },
    /// The picture is empty or larger than allowed.
    #[error("picture: found {width} x {height} pixels, expected from 1 to {MAX_PIXELS} in all")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// A plane does not hold one entry per pixel.
    #[error("{plane}: found {found} pixels, expected {expected}")]
    Plane {
        /// Name of the plane.
        plane: String,
        /// Entries found.
        found: usize,
        /// Pixels of the picture.
        expected: usize,
    },
}

impl Header {
    /// Pixels of the picture.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Refuses empty and oversize pictures.
    ///
    /// # Errors
    /// [`WireError::Size`].
    pub fn check(&self) -> Result<(), WireError> {
        let pixels = u64::from(self.width) * u64::from(self.height);
        if pixels == 0 || pixels > MAX_PIXELS {
            return Err(WireError::Size { width: self.width, height: self.height });
        }
        Ok(())
    }

    /// Writes the head of a request.
    ///
    /// # Errors
    /// The pipe's.
    pub fn write(&self, to: &mut impl Write) -> io::Result<()> {
        let mode = match self.mode {
            Mode::Color => 0,
            Mode::Full => 1,
        };
        to.write_all(&MAGIC)?;
        write_u32s(to, &[VERSION, mode, self.threads, self.width, self.height])
    }

    /// Reads and checks the head of a request.
    ///
    /// # Errors
    /// Every kind of [`WireError`] but [`WireError::Plane`]; nothing is allocated.
    pub fn read(from: &mut impl Read) -> Result<Self, WireError> {
        read_magic(from)?;
        let found = read_u32(from)?;
        if found != VERSION {
            return Err(WireError::Version { found });
        }
        let mode = match read_u32(from)? {
            0 => Mode::Color,
            1 => Mode::Full,
            found => return Err(WireError::Field { field: "mode", found: found.into(), limit: 1 }),
        };
        let header = Self { mode, threads: read_u32(from)?, width: read_u32(from)?, height: read_u32(from)? };
        header.check()?;
        Ok(header)
    }
}

/// Refuses a plane of the wrong length.
///
/// # Errors
/// [`WireError::Plane`].
pub fn check_plane(plane: &str, found: usize, header: &Header) -> Result<(), WireError> {
    let expected = header.pixels();
    if found == expected { Ok(()) } else { Err(WireError::Plane { plane: plane.into(), found, expected }) }
}

/// Writes one plane.
///
/// # Errors
/// The pipe's.
pub fn write_plane<T: Copy + Into<[f32; 3]>>(to: &mut impl Write, plane: &[T]) -> io::Result<()> {
    let mut bytes = Vec::with_capacity(CHUNK * 12);
    for pixels in plane.chunks(CHUNK) {
        bytes.clear();
        for &pixel in pixels {
            let values: [f32; 3] = pixel.into();
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        to.write_all(&bytes)?;
    }
    Ok(())
}

/// Reads one plane of `pixels` entries; memory grows as they arrive.
///
/// # Errors
/// The pipe's, when it ends early.
pub fn read_plane(from: &mut impl Read, pixels: usize) -> io::Result<Vec<[f32; 3]>> {
    let mut plane = Vec::new();
    let mut bytes = vec![0; CHUNK * 12];
    while plane.len() < pixels {
        let count = CHUNK.min(pixels - plane.len());
        from.read_exact(&mut bytes[..count * 12])?;
        let value = |at: &[u8]| f32::from_le_bytes([at[0], at[1], at[2], at[3]]);
        plane
            .extend(bytes[..count * 12].chunks_exact(12).map(|p| [value(p), value(&p[4..]), value(&p[8..])]));
    }
    Ok(plane)
}

/// Pixels moved at a time.
const CHUNK: usize = 8192;

/// Writes the answer to a request.
///
/// # Errors
/// The pipe's.
pub fn write_answer(to: &mut impl Write, answer: Result<&[[f32; 3]], &str>) -> io::Result<()> {
    to.write_all(&MAGIC)?;
    match answer {
        Ok(plane) => {
            write_u32s(to, &[VERSION, 0])?;
            to.write_all(&(plane.len() as u64 * 12).to_le_bytes())?;
            write_plane(to, plane)?;
        }
        Err(text) => {
            write_u32s(to, &[VERSION, 1])?;
            let text = &text.as_bytes()[..text.len().min(MAX_TEXT as usize)];
            to.write_all(&(text.len() as u64).to_le_bytes())?;
            to.write_all(text)?;
        }
    }
    to.flush()
}

/// Reads the answer to a request with this head.
///
/// # Errors
/// A broken pipe, a foreign program, or a length other than the picture's.
pub fn read_answer(from: &mut impl Read, header: &Header) -> Result<Answer, WireError> {
    read_magic(from)?;
    let version = read_u32(from)?;
    if version != VERSION {
        return Ok(Answer::OtherVersion(version));
    }
    let status = read_u32(from)?;
    let mut length = [0; 8];
    from.read_exact(&mut length)?;
    let length = u64::from_le_bytes(length);
    match status {
        0 if length == header.pixels() as u64 * 12 => {
            Ok(Answer::Denoised(read_plane(from, header.pixels())?))
        }
        1 if length <= MAX_TEXT => {
            let mut text = vec![0; length as usize];
            from.read_exact(&mut text)?;
            Ok(Answer::Failed(String::from_utf8_lossy(&text).into_owned()))
        }
        0 => Err(WireError::Field { field: "length", found: length, limit: header.pixels() as u64 * 12 }),
        1 => Err(WireError::Field { field: "length", found: length, limit: MAX_TEXT }),
        _ => Err(WireError::Field { field: "status", found: status.into(), limit: 1 }),
    }
}

fn write_u32s(to: &mut impl Write, values: &[u32]) -> io::Result<()> {
    values.iter().try_for_each(|value| to.write_all(&value.to_le_bytes()))
}

fn read_u32(from: &mut impl Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    from.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

fn read_magic(from: &mut impl Read) -> Result<(), WireError> {
    let mut found = [0; 8];
    from.read_exact(&mut found)?;
    if found == MAGIC { Ok(()) } else { Err(WireError::Magic { found }) }
}

#[cfg(test)]
mod tests {
    use super::{Answer, Header, MAGIC, MAX_PIXELS, Mode, WireError, read_answer, write_answer};

    const HEADER: Header = Header { mode: Mode::Full, threads: 3, width: 5, height: 2 };

    #[test]
    fn requests_and_answers_come_back() {
        let mut bytes = Vec::new();
        HEADER.write(&mut bytes).unwrap();
        assert_eq!(Header::read(&mut bytes.as_slice()).unwrap(), HEADER);

        let plane: Vec<[f32; 3]> = (0..10).map(|i| [i as f32, -0.5, f32::INFINITY]).collect();
        let mut bytes = Vec::new();
        write_answer(&mut bytes, Ok(&plane)).unwrap();
        assert_eq!(read_answer(&mut bytes.as_slice(), &HEADER).unwrap(), Answer::Denoised(plane));
        for length in 0..bytes.len() {
            let answer = read_answer(&mut &bytes[..length], &HEADER);
            assert!(matches!(answer, Err(WireError::Io(_))), "cut to {length}");
        }
        bytes.clear();
        write_answer(&mut bytes, Err("out of memory")).unwrap();
        let answer = read_answer(&mut bytes.as_slice(), &HEADER).unwrap();
        assert_eq!(answer, Answer::Failed("out of memory".into()));
    }

    #[test]
    fn hostile_heads_are_refused_before_anything_is_allocated() {
        let request = |fields: [u32; 5]| {
            let mut bytes = MAGIC.to_vec();
            bytes.extend(fields.iter().flat_map(|field| field.to_le_bytes()));
            Header::read(&mut bytes.as_slice()).map(|_| ()).map_err(|error| error.to_string())
        };
        assert_eq!(request([1, 0, 0, 4, 4]), Ok(()));
        assert_eq!(request([2, 0, 0, 4, 4]).unwrap_err(), "found version 2, expected 1");
        assert_eq!(request([1, 7, 0, 4, 4]).unwrap_err(), "mode: found 7, expected at most 1");
        for (width, height) in [(0, 4), (4, 0), (u32::MAX, u32::MAX), (MAX_PIXELS as u32 + 1, 1)] {
            assert!(request([1, 0, 0, width, height]).unwrap_err().starts_with("picture: found"));
        }

        let mut answer = MAGIC.to_vec();
        answer.extend([1_u32, 0].iter().flat_map(|field| field.to_le_bytes()));
        answer.extend(u64::MAX.to_le_bytes());
        let error = read_answer(&mut answer.as_slice(), &HEADER).unwrap_err();
        assert!(matches!(error, WireError::Field { field: "length", .. }), "{error}");
    }
}
