//! Bytes with their digest: what is uploaded.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use crate::Error;

/// Bytes to upload, named by their SHA-256.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blob {
    pub(crate) digest: String,
    pub(crate) size: u64,
    pub(crate) source: Source,
}

/// Where a blob's bytes are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    Memory(Arc<[u8]>),
    File(PathBuf),
}

impl Blob {
    /// A blob of these bytes.
    pub fn of_bytes(bytes: &[u8]) -> Self {
        let mut hash = Sha256::new();
        hash.update(bytes);
        Self { digest: hex(&hash.finalize()), size: bytes.len() as u64, source: Source::Memory(bytes.into()) }
    }

    /// A blob of a file's bytes; they are read once for the digest and again while uploading.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_file(path: &Path) -> Result<Self, Error> {
        let (digest, size) = digest_of(path).map_err(|source| Error::file(path, source))?;
        Ok(Self { digest, size, source: Source::File(path.to_owned()) })
    }

    /// SHA-256 of the bytes, 64 lower-case hexadecimal digits.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Number of bytes.
    pub fn size(&self) -> u64 {
        self.size
    }
}

fn digest_of(path: &Path) -> io::Result<(String, u64)> {
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 256 << 10];
    let mut size = 0;
    loop {
        let read = file.read(&mut buffer)?;
        if read == 0 {
            return Ok((hex(&hash.finalize()), size));
        }
        hash.update(&buffer[..read]);
        size += read as u64;
    }
}

/// Lower-case hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(bytes.len() * 2), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::Blob;

    #[test]
    fn file_and_bytes_agree_with_the_standard() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "abc").unwrap();
        let blob = Blob::of_file(file.path()).unwrap();
        assert_eq!(blob.digest(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!(blob.digest(), Blob::of_bytes(b"abc").digest());
        assert_eq!(blob.size(), 3);
    }
}
