//! Owns uploads that are not complete yet: one file per digest, whose length is how far it has come.
//!
//! There is no row in the database: the file is the truth. After a crash it may be shorter than the last bytes
//! that came, but never shorter than an answered `committed_size`, because that is synced first; bytes that were
//! damaged meanwhile fail the digest at the end, and the upload begins again.

use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use tokio::fs::{File, OpenOptions};
use tokio::io::{AsyncReadExt, AsyncWriteExt};

use crate::blobs::{Blobs, Kind};
use crate::digest::Digest;
use crate::error::Error;

/// All incomplete uploads.
#[derive(Debug, Clone)]
pub struct Uploads {
    folder: PathBuf,
    blobs: Blobs,
    /// Digests that a stream is writing now; one writer each.
    busy: Arc<Mutex<HashSet<Digest>>>,
}

/// How far an upload has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Committed {
    /// Bytes that would survive a crash.
    pub size: u64,
    /// All bytes are there and right.
    pub complete: bool,
}

impl Uploads {
    /// Opens the uploads kept in `folder`, which is made if it is not there.
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub fn open(folder: &Path, blobs: Blobs) -> Result<Self, Error> {
        std::fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned(), blobs, busy: Arc::default() })
    }

    /// How far the upload of `digest` has come.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn committed(&self, digest: Digest) -> Result<Committed, Error> {
        if let Some(size) = self.blobs.size(Kind::Asset, &digest).await? {
            return Ok(Committed { size, complete: true });
        }
        let size = match File::open(self.path(digest)).await {
            Ok(file) => {
                file.sync_all().await?;
                file.metadata().await?.len()
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => 0,
            Err(e) => return Err(e.into()),
        };
        Ok(Committed { size, complete: false })
    }

    /// Begins or goes on with an upload; `None` when the blob is complete already.
    ///
    /// # Errors
    /// [`Error::UploadBusy`], [`Error::Offset`], or a failing disk.
    pub async fn begin(&self, digest: Digest, total: u64, offset: u64) -> Result<Option<Upload>, Error> {
        let claim = Claim::take(&self.busy, digest).ok_or(Error::UploadBusy(digest))?;
        let committed = self.committed(digest).await?;
        if committed.complete {
            return Ok(None);
        }
        let mut size = committed.size;
        if size > total {
            // The earlier attempt announced more bytes; nobody can tell which of them was wrong.
            let _ = tokio::fs::remove_file(self.path(digest)).await;
            size = 0;
        }
        if offset != size {
            return Err(Error::Offset { found: offset, expected: size });
        }
        let file = OpenOptions::new().create(true).append(true).open(self.path(digest)).await?;
        Ok(Some(Upload { uploads: self.clone(), _claim: claim, digest, total, size, file }))
    }

    fn path(&self, digest: Digest) -> PathBuf {
        self.folder.join(digest.to_string())
    }
}

/// The right to write one digest; given back when dropped.
#[derive(Debug)]
struct Claim {
    busy: Arc<Mutex<HashSet<Digest>>>,
    digest: Digest,
}

impl Claim {
    fn take(busy: &Arc<Mutex<HashSet<Digest>>>, digest: Digest) -> Option<Self> {
        let new = busy.lock().unwrap_or_else(PoisonError::into_inner).insert(digest);
        new.then(|| Self { busy: Arc::clone(busy), digest })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.busy.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.digest);
    }
}

/// One stream's upload.
#[derive(Debug)]
pub struct Upload {
    uploads: Uploads,
    _claim: Claim,
    digest: Digest,
    total: u64,
    size: u64,
    file: File,
}

impl Upload {
    /// Adds the next bytes.
    ///
    /// # Errors
    /// When they are more than was announced; nothing of them is kept. When the disk is full or fails.
    pub async fn write(&mut self, chunk: &[u8]) -> Result<(), Error> {
        let size = self.size + chunk.len() as u64;
        if size > self.total {
            return Err(Error::field("chunk", format!("more than the announced {} bytes came", self.total)));
        }
        self.file.write_all(chunk).await?;
        self.size = size;
        Ok(())
    }

    /// The stream broke off: keeps what came.
    ///
    /// # Errors
    /// A failing disk.
    pub async fn keep(mut self) -> Result<(), Error> {
        self.file.flush().await?;
        Ok(self.file.sync_all().await?)
    }

    /// The stream has ended: completes the blob if all bytes are there, else keeps what came.
    ///
    /// # Errors
    /// [`Error::DigestMismatch`], after which nothing is kept; a failing disk.
    pub async fn finish(mut self) -> Result<Committed, Error> {
        self.file.flush().await?;
        self.file.sync_all().await?;
        if self.size < self.total {
            return Ok(Committed { size: self.size, complete: false });
        }
        let path = self.uploads.path(self.digest);
        let found = digest_of(&path).await?;
        if found != self.digest {
            tokio::fs::remove_file(&path).await?;
            return Err(Error::DigestMismatch { expected: self.digest, found });
        }
        let (blobs, digest) = (self.uploads.blobs.clone(), self.digest);
        tokio::task::spawn_blocking(move || blobs.adopt(Kind::Asset, &digest, &path)).await??;
        Ok(Committed { size: self.size, complete: true })
    }
}

/// The digest of a file, read piece by piece.
async fn digest_of(path: &Path) -> Result<Digest, Error> {
    let mut file = File::open(path).await?;
    let mut hasher = Digest::hasher();
    let mut buffer = vec![0; 256 << 10];
    loop {
        let read = file.read(&mut buffer).await?;
        if read == 0 {
            return Ok(hasher.finish());
        }
        hasher.update(&buffer[..read]);
    }
}

#[cfg(test)]
mod tests {
    use super::{Committed, Uploads};
    use crate::blobs::{Blobs, Kind};
    use crate::digest::Digest;
    use crate::error::Error;

    fn open(dir: &std::path::Path) -> (Uploads, Blobs) {
        let blobs = Blobs::open(&dir.join("blobs")).unwrap();
        (Uploads::open(&dir.join("uploads"), blobs.clone()).unwrap(), blobs)
    }

    #[tokio::test]
    async fn a_broken_upload_goes_on_where_it_stopped() {
        let dir = tempfile::tempdir().unwrap();
        let digest = Digest::of(b"hello world");
        let (uploads, _) = open(dir.path());
        let mut upload = uploads.begin(digest, 11, 0).await.unwrap().unwrap();
        upload.write(b"hello").await.unwrap();
        assert_eq!(upload.finish().await.unwrap(), Committed { size: 5, complete: false });

        let (uploads, blobs) = open(dir.path());
        assert_eq!(uploads.committed(digest).await.unwrap().size, 5);
        let wrong = uploads.begin(digest, 11, 0).await;
        assert!(matches!(wrong, Err(Error::Offset { found: 0, expected: 5 })));
        let mut upload = uploads.begin(digest, 11, 5).await.unwrap().unwrap();
        assert!(matches!(uploads.begin(digest, 11, 5).await, Err(Error::UploadBusy(_))));
        assert!(upload.write(b" world and more").await.is_err(), "more than announced");
        upload.write(b" world").await.unwrap();
        assert!(upload.finish().await.unwrap().complete);
        assert_eq!(blobs.get(Kind::Asset, digest).await.unwrap(), b"hello world");
        assert!(uploads.begin(digest, 11, 0).await.unwrap().is_none(), "complete");
    }

    #[tokio::test]
    async fn wrong_bytes_are_dropped() {
        let dir = tempfile::tempdir().unwrap();
        let (uploads, blobs) = open(dir.path());
        let digest = Digest::of(b"right");
        let mut upload = uploads.begin(digest, 5, 0).await.unwrap().unwrap();
        upload.write(b"wrong").await.unwrap();
        assert!(matches!(upload.finish().await, Err(Error::DigestMismatch { .. })));
        assert_eq!(uploads.committed(digest).await.unwrap(), Committed { size: 0, complete: false });
        assert_eq!(blobs.size(Kind::Asset, &digest).await.unwrap(), None);
    }

    #[tokio::test]
    async fn nothing_at_all_is_a_blob_too() {
        let dir = tempfile::tempdir().unwrap();
        let (uploads, _) = open(dir.path());
        let upload = uploads.begin(Digest::of(b""), 0, 0).await.unwrap().unwrap();
        assert!(upload.finish().await.unwrap().complete);
    }
}
