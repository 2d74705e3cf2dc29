//! Owns the bytes: blobs in the data folder, written once, named by their SHA-256.
//!
//! [`Blobs::put`] returns when the bytes would survive a power cut: written to a temporary file, synced, renamed,
//! folder synced. A crash before that leaves at most a temporary file, which nobody reads. Every read checks the
//! digest: damaged bytes become an error, never wrong pixels.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use futures::TryStreamExt;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Name;
use object_store::{ObjectStore, ObjectStoreExt};
use prost::bytes::Bytes;

use crate::digest::Digest;
use crate::error::Error;

/// What a blob is for; each kind has a folder of its own, so that leftovers of a crash can be told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Scene documents and the files they name.
    Asset,
    /// Results of a round that is being rendered; deleted when the film that contains them is stored.
    Pack,
    /// A frame's film after a round; the last one stays.
    Film,
    /// Files of finished frames.
    Frame,
    /// Results of one task that differ: kept for whoever looks for the fault.
    Dispute,
}

impl Kind {
    fn folder(self) -> &'static str {
        match self {
            Self::Asset => "assets",
            Self::Pack => "packs",
            Self::Film => "films",
            Self::Frame => "frames",
            Self::Dispute => "disputes",
        }
    }

    fn name(self, digest: &Digest) -> Name {
        let hex = digest.to_string();
        Name::from_iter([self.folder(), &hex[..2], &hex[2..]])
    }
}

/// The blob store.
#[derive(Debug, Clone)]
pub struct Blobs {
    store: Arc<LocalFileSystem>,
    root: PathBuf,
    written: Arc<AtomicU64>,
}

impl Blobs {
    /// Opens the store in `root`, which is made if it is not there; nobody else may write to it.
    ///
    /// # Errors
    /// When the folder cannot be made or read.
    pub fn open(root: &Path) -> Result<Self, Error> {
        std::fs::create_dir_all(root)?;
        remove_unfinished(root)?;
        let store = LocalFileSystem::new_with_prefix(root)?.with_fsync(true);
        Ok(Self { store: Arc::new(store), root: root.to_owned(), written: Arc::default() })
    }

    /// Bytes that were stored since the start.
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Stores `bytes`; they are durable on return. Storing the same bytes again does nothing.
    ///
    /// # Errors
    /// When the disk is full or fails.
    pub async fn put(&self, kind: Kind, bytes: impl Into<Bytes>) -> Result<Digest, Error> {
        let bytes: Bytes = bytes.into();
        let hashed = bytes.clone();
        let digest = tokio::task::spawn_blocking(move || Digest::of(&hashed)).await?;
        if self.size(kind, &digest).await?.is_none() {
            let size = bytes.len() as u64;
            self.store.put(&kind.name(&digest), bytes.into()).await?;
            self.written.fetch_add(size, Ordering::Relaxed);
        }
        Ok(digest)
    }

    /// The bytes of `digest`, checked. Damaged bytes are deleted, so that the right ones can take their place: a
    /// blob that is there counts as stored.
    ///
    /// # Errors
    /// [`Error::Gone`] when there is no such blob, [`Error::Corrupt`] when it is not what it was.
    pub async fn get(&self, kind: Kind, digest: Digest) -> Result<Vec<u8>, Error> {
        let bytes = match self.store.get(&kind.name(&digest)).await {
            Ok(found) => found.bytes().await?,
            Err(object_store::Error::NotFound { .. }) => return Err(Error::Gone(digest)),
            Err(e) => return Err(e.into()),
        };
        let hashed = bytes.clone();
        if tokio::task::spawn_blocking(move || Digest::of(&hashed)).await? == digest {
            return Ok(bytes.into());
        }
        tracing::error!("blob {digest} is damaged: the disk may be failing");
        self.delete(kind, &digest).await?;
        Err(Error::Corrupt(digest))
    }

    /// Bytes `range` of a blob, unchecked: for downloads, whose reader checks the whole.
    ///
    /// # Errors
    /// [`Error::Gone`] when there is no such blob.
    pub async fn part(
        &self,
        kind: Kind,
        digest: Digest,
        range: std::ops::Range<u64>,
    ) -> Result<Vec<u8>, Error> {
        match self.store.get_range(&kind.name(&digest), range).await {
            Ok(bytes) => Ok(bytes.into()),
            Err(object_store::Error::NotFound { .. }) => Err(Error::Gone(digest)),
            Err(e) => Err(e.into()),
        }
    }

    /// The size of a blob in bytes, `None` when there is no such blob.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn size(&self, kind: Kind, digest: &Digest) -> Result<Option<u64>, Error> {
        match self.store.head(&kind.name(digest)).await {
            Ok(found) => Ok(Some(found.size)),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(e) => Err(e.into()),
        }
    }

    /// Deletes a blob if it is there. A crash before leaves a blob that [`Blobs::sweep`] takes away.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn delete(&self, kind: Kind, digest: &Digest) -> Result<(), Error> {
        match self.store.delete(&kind.name(digest)).await {
            Ok(()) | Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(e) => Err(e.into()),
        }
    }

    /// Deletes all blobs of a kind that are not in `keep`; at the start of the server, when nobody writes.
    ///
    /// # Errors
    /// When the disk fails.
    pub async fn sweep(&self, kind: Kind, keep: &BTreeSet<Digest>) -> Result<usize, Error> {
        let found: Vec<_> = self.store.list(Some(&Name::from(kind.folder()))).try_collect().await?;
        let mut swept = 0;
        for object in found {
            let mut parts = object.location.parts().skip(1);
            let hex: String = parts.by_ref().map(|p| p.as_ref().to_owned()).collect();
            if hex.parse::<Digest>().map_or(true, |digest| !keep.contains(&digest)) {
                self.store.delete(&object.location).await?;
                swept += 1;
            }
        }
        Ok(swept)
    }

    /// Takes a file on the same disk, whose bytes have this digest and are synced, as a blob.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn adopt(&self, kind: Kind, digest: &Digest, file: &Path) -> Result<(), Error> {
        let target = self.root.join(kind.name(digest).as_ref());
        let folder = target.parent().unwrap_or(&self.root);
        std::fs::create_dir_all(folder)?;
        let size = std::fs::metadata(file)?.len();
        std::fs::rename(file, &target)?;
        self.written.fetch_add(size, Ordering::Relaxed);
        // Three folders may have new entries: the blob's, the one above, and the kind's parent.
        for folder in folder.ancestors().take_while(|f| f.starts_with(&self.root)) {
            std::fs::File::open(folder)?.sync_all()?;
        }
        Ok(())
    }
}

/// Deletes what a crash left half written: the store writes NAME#NUMBER and renames it to NAME.
fn remove_unfinished(folder: &Path) -> Result<(), Error> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            remove_unfinished(&entry.path())?;
        } else if entry.file_name().to_string_lossy().contains('#') {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Blobs, Kind};
    use crate::digest::Digest;
    use crate::error::Error;
    use std::collections::BTreeSet;

    #[tokio::test]
    async fn bytes_come_back_and_damage_is_noticed() {
        let dir = tempfile::tempdir().unwrap();
        let blobs = Blobs::open(dir.path()).unwrap();
        let digest = blobs.put(Kind::Film, &b"film"[..]).await.unwrap();
        assert_eq!(blobs.put(Kind::Film, &b"film"[..]).await.unwrap(), digest);
        assert_eq!(blobs.get(Kind::Film, digest).await.unwrap(), b"film");
        assert_eq!(blobs.size(Kind::Film, &digest).await.unwrap(), Some(4));
        assert_eq!(blobs.size(Kind::Pack, &digest).await.unwrap(), None);
        let hex = digest.to_string();
        std::fs::write(dir.path().join("films").join(&hex[..2]).join(&hex[2..]), b"fiLm").unwrap();
        assert!(matches!(blobs.get(Kind::Film, digest).await, Err(Error::Corrupt(d)) if d == digest));
        assert!(
            matches!(blobs.get(Kind::Film, digest).await, Err(Error::Gone(_))),
            "the damaged one is deleted"
        );
        blobs.put(Kind::Film, &b"film"[..]).await.unwrap();
        assert_eq!(blobs.get(Kind::Film, digest).await.unwrap(), b"film", "the right one takes its place");
        blobs.delete(Kind::Film, &digest).await.unwrap();
        blobs.delete(Kind::Film, &digest).await.unwrap();
        assert_eq!(blobs.size(Kind::Film, &digest).await.unwrap(), None);
    }

    #[tokio::test]
    async fn half_written_files_do_not_survive_the_next_start() {
        let dir = tempfile::tempdir().unwrap();
        let digest = Blobs::open(dir.path()).unwrap().put(Kind::Pack, &b"whole"[..]).await.unwrap();
        let hex = digest.to_string();
        let half = dir.path().join("packs").join(&hex[..2]).join(format!("{}#1", &hex[2..]));
        std::fs::write(&half, b"who").unwrap();
        let blobs = Blobs::open(dir.path()).unwrap();
        assert!(!half.exists());
        assert_eq!(blobs.get(Kind::Pack, digest).await.unwrap(), b"whole");
    }

    #[tokio::test]
    async fn a_sweep_takes_only_what_nobody_keeps() {
        let dir = tempfile::tempdir().unwrap();
        let blobs = Blobs::open(dir.path()).unwrap();
        let kept = blobs.put(Kind::Pack, &b"kept"[..]).await.unwrap();
        let lost = blobs.put(Kind::Pack, &b"lost"[..]).await.unwrap();
        let other = blobs.put(Kind::Film, &b"lost"[..]).await.unwrap();
        assert_eq!(blobs.sweep(Kind::Pack, &BTreeSet::from([kept])).await.unwrap(), 1);
        assert_eq!(blobs.size(Kind::Pack, &kept).await.unwrap(), Some(4));
        assert_eq!(blobs.size(Kind::Pack, &lost).await.unwrap(), None);
        assert_eq!(blobs.size(Kind::Film, &other).await.unwrap(), Some(4));
    }

    #[test]
    fn an_adopted_file_is_a_blob() {
        let dir = tempfile::tempdir().unwrap();
        let blobs = Blobs::open(&dir.path().join("blobs")).unwrap();
        let file = dir.path().join("upload");
        std::fs::write(&file, b"mesh").unwrap();
        blobs.adopt(Kind::Asset, &Digest::of(b"mesh"), &file).unwrap();
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        assert_eq!(runtime.block_on(blobs.get(Kind::Asset, Digest::of(b"mesh"))).unwrap(), b"mesh");
        assert!(!file.exists());
    }
}
