//! Owns the bytes that a worker has fetched: files by digest in a folder that stays under a number of bytes.
//!
//! Several workers may share the folder: files appear whole by renaming, are checked whenever they are read, and one
//! that another worker has deleted is fetched again.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use karst_core::scene::AssetSource;
use karst_proto::MAX_MESSAGE_BYTES;
use karst_proto::v1::DownloadRequest;
use karst_proto::v1::assets_client::AssetsClient;
use tonic::Status;
use uuid::Uuid;

use crate::digest::Digest;
use crate::work::connection::Link;

/// The folder.
#[derive(Debug, Clone)]
pub(crate) struct Cache {
    folder: PathBuf,
    max_bytes: u64,
}

/// Why a blob cannot be had.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FetchError {
    /// The server did not send it.
    #[error("blob {digest} cannot be fetched: {}", .status.message())]
    Server {
        /// Which.
        digest: Digest,
        /// What it said.
        status: Box<Status>,
    },
    /// What came is something else.
    #[error("blob {0} came as something else: {1}")]
    Damaged(Digest, Digest),
    /// The cache cannot be used.
    #[error("cache {}: {cause}", .folder.display())]
    Disk {
        /// Where it is.
        folder: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
}

impl Cache {
    /// Opens the folder, which is made if it is not there.
    ///
    /// # Errors
    /// When it cannot be made.
    pub(crate) fn open(folder: &Path, max_bytes: u64) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned(), max_bytes })
    }

    /// Makes sure that a blob is here, unless it is gone again by the time it is read.
    pub(crate) async fn fetch(&self, digest: Digest, link: &Link) -> Result<(), FetchError> {
        let path = self.path(digest);
        if let Ok(file) = File::open(&path) {
            // Used now; which matters only for what is deleted first.
            let _ = file.set_modified(now());
            return Ok(());
        }
        let disk = |cause| FetchError::Disk { folder: self.folder.clone(), cause };
        let folder = path.parent().unwrap_or(&self.folder);
        fs::create_dir_all(folder).map_err(disk)?;
        let partial = folder.join(format!("{}.part", Uuid::new_v4()));
        let fetched = self.download(digest, &partial, link).await;
        match fetched {
            Ok(()) => fs::rename(&partial, &path).map_err(disk)?,
            Err(e) => {
                let _ = fs::remove_file(&partial);
                return Err(e);
            }
        }
        self.shrink(digest).map_err(disk)
    }

    async fn download(&self, digest: Digest, to: &Path, link: &Link) -> Result<(), FetchError> {
        let disk = |cause| FetchError::Disk { folder: self.folder.clone(), cause };
        let server = |status| FetchError::Server { digest, status: Box::new(status) };
        let mut file = File::create(to).map_err(disk)?;
        let mut hasher = Digest::hasher();
        let mut calls = AssetsClient::new(link.line.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES);
        let request = DownloadRequest { digest: digest.to_string(), offset: 0 };
        let mut stream = calls.download(request).await.map_err(server)?.into_inner();
        while let Some(part) = stream.message().await.map_err(server)? {
            hasher.update(&part.chunk);
            file.write_all(&part.chunk).map_err(disk)?;
        }
        let found = hasher.finish();
        if found == digest { Ok(()) } else { Err(FetchError::Damaged(digest, found)) }
    }

    /// The bytes of a blob that was fetched; damaged ones are deleted.
    fn read(&self, digest: Digest) -> io::Result<Vec<u8>> {
        let path = self.path(digest);
        let bytes = fs::read(&path)?;
        if Digest::of(&bytes) == digest {
            return Ok(bytes);
        }
        let _ = fs::remove_file(&path);
        Err(io::Error::other(format!("{} was damaged and is deleted: try again", path.display())))
    }

    /// Deletes what was not used for longest until the folder is small enough, but never `keep`.
    fn shrink(&self, keep: Digest) -> io::Result<()> {
        let mut files = Vec::new();
        for folder in fs::read_dir(&self.folder)? {
            let Ok(entries) = fs::read_dir(folder?.path()) else { continue };
            for entry in entries {
                let entry = entry?;
                let Ok(facts) = entry.metadata() else { continue };
                files.push((facts.modified()?, facts.len(), entry.path()));
            }
        }
        let mut total: u64 = files.iter().map(|f| f.1).sum();
        files.sort();
        for (_, size, path) in files {
            if total <= self.max_bytes {
                break;
            }
            if path != self.path(keep) && fs::remove_file(&path).is_ok() {
                total -= size;
            }
        }
        Ok(())
    }

    fn path(&self, digest: Digest) -> PathBuf {
        let hex = digest.to_string();
        self.folder.join(&hex[..2]).join(&hex[2..])
    }
}

#[expect(clippy::disallowed_methods, reason = "the time of use of a cached file; pixels never see it")]
fn now() -> SystemTime {
    SystemTime::now()
}

/// The files of a job, for the loaders of the core.
pub(crate) struct CachedFiles {
    /// Where they are.
    pub cache: Cache,
    /// Their digests by path.
    pub files: BTreeMap<String, Digest>,
}

impl CachedFiles {
    /// The bytes of a blob.
    pub(crate) fn blob(&self, digest: Digest) -> io::Result<Vec<u8>> {
        self.cache.read(digest)
    }

    fn digest(&self, path: &str) -> io::Result<Digest> {
        let missing = || io::Error::new(io::ErrorKind::NotFound, "not among the files of the job");
        self.files.get(path).copied().ok_or_else(missing)
    }
}

impl AssetSource for CachedFiles {
    fn len(&self, path: &str) -> Result<u64, io::Error> {
        Ok(fs::metadata(self.cache.path(self.digest(path)?))?.len())
    }

    fn read(&self, path: &str) -> Result<Vec<u8>, io::Error> {
        self.cache.read(self.digest(path)?)
    }
}

#[cfg(test)]
mod tests {
    use super::Cache;
    use crate::digest::Digest;
    use std::fs;

    fn put(cache: &Cache, bytes: &[u8]) -> Digest {
        let digest = Digest::of(bytes);
        let path = cache.path(digest);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
        digest
    }

    #[test]
    fn the_oldest_go_first_and_what_is_new_stays() {
        let dir = tempfile::tempdir().unwrap();
        let cache = Cache::open(dir.path(), 250).unwrap();
        let all: Vec<Digest> = (0..4_u8).map(|i| put(&cache, &[i; 100])).collect();
        for (i, digest) in all.iter().enumerate() {
            let age = std::time::Duration::from_secs(1000 + i as u64);
            fs::File::open(cache.path(*digest)).unwrap().set_modified(std::time::UNIX_EPOCH + age).unwrap();
        }
        cache.shrink(all[0]).unwrap();
        let left: Vec<bool> = all.iter().map(|d| cache.read(*d).is_ok()).collect();
        assert_eq!(left, [true, false, false, true], "the kept one and the newest");
    }

    #[test]
    fn damage_is_noticed_and_removed() {
        let dir = tempfile::tempdir().unwrap();
        let cache = Cache::open(dir.path(), 1000).unwrap();
        let digest = put(&cache, b"mesh");
        fs::write(cache.path(digest), b"mush").unwrap();
        assert!(cache.read(digest).is_err());
        assert!(!cache.path(digest).exists());
    }
}
