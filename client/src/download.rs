//! Downloading files of finished frames: resumed where it stopped, digest checked, never a half file in place.

use std::path::{Path, PathBuf};
use std::time::Duration;

use karst_proto::errors::{ErrorReason, status};
use karst_proto::v1::download_frame_response::Part;
use karst_proto::v1::{DownloadFrameRequest, FrameFormat};
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::AsyncWriteExt;
use tonic::{Code, Status};

use crate::blob::hex;
use crate::client::broken_off;
use crate::retry::{Backoff, is_transient};
use crate::{Client, Error};

/// Which file of which frame, and where it goes.
#[derive(Clone, Debug)]
pub struct Download {
    /// The job's id.
    pub job: String,
    /// Frame number.
    pub frame: i32,
    /// Which file.
    pub format: FrameFormat,
    /// Where to write it; folders are made.
    pub path: PathBuf,
}

/// What has been written so far.
struct Partial {
    path: PathBuf,
    file: File,
    hash: Sha256,
    offset: u64,
    digest: String,
    total_size: u64,
}

impl Client {
    /// Downloads a file; returns its size in bytes. Goes on where a lost connection stopped it.
    ///
    /// # Errors
    /// As `Frames.DownloadFrame`; the file cannot be written; the bytes do not match their digest.
    pub async fn download(&self, download: &Download) -> Result<u64, Error> {
        let path = &download.path;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            tokio::fs::create_dir_all(folder).await.map_err(|source| Error::file(folder, source))?;
        }
        let mut partial = Partial::create(path).await?;
        let mut backoff = Backoff::new(Duration::from_mins(1));
        loop {
            let before = partial.offset;
            let Err(failure) = self.download_from(download, &mut partial).await? else { break };
            if partial.offset > before {
                backoff.reset();
            }
            match backoff.next() {
                Some(wait) if is_transient(&failure) => tokio::time::sleep(wait).await,
                _ => return Err(partial.abandon(Error::call("download", failure)).await),
            }
        }
        partial.finish(path).await
    }

    /// One stream from where `partial` ends. The outer error is the client's own, the inner one the server's.
    async fn download_from(
        &self,
        download: &Download,
        partial: &mut Partial,
    ) -> Result<Result<(), Status>, Error> {
        let request = DownloadFrameRequest {
            job: download.job.clone(),
            frame: download.frame,
            format: download.format.into(),
            offset: partial.offset,
        };
        let mut parts = match self.frame_calls().download_frame(request).await {
            Ok(response) => response.into_inner(),
            Err(status) => return Ok(Err(status)),
        };
        loop {
            let message = match parts.message().await {
                Ok(Some(message)) => message,
                Ok(None) if partial.is_complete() => return Ok(Ok(())),
                Ok(None) => return Ok(Err(broken_off())),
                Err(status) => return Ok(Err(status)),
            };
            match message.part {
                Some(Part::Start(start)) if partial.digest.is_empty() => {
                    (partial.digest, partial.total_size) = (start.digest, start.total_size);
                }
                Some(Part::Start(start)) if start.digest != partial.digest => {
                    return Ok(Err(status(Code::DataLoss, ErrorReason::BlobCorrupt, "the file changed")));
                }
                Some(Part::Chunk(bytes)) => partial.write(&bytes).await?,
                Some(Part::Start(_)) | None => {}
            }
        }
    }
}

impl Partial {
    async fn create(target: &Path) -> Result<Self, Error> {
        let mut name = target.as_os_str().to_owned();
        name.push(".part");
        let path = PathBuf::from(name);
        let file = File::create(&path).await.map_err(|source| Error::file(&path, source))?;
        Ok(Self { path, file, hash: Sha256::new(), offset: 0, digest: String::new(), total_size: 0 })
    }

    fn is_complete(&self) -> bool {
        !self.digest.is_empty() && self.offset == self.total_size
    }

    async fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.file.write_all(bytes).await.map_err(|source| Error::file(&self.path, source))?;
        self.hash.update(bytes);
        self.offset += bytes.len() as u64;
        Ok(())
    }

    async fn abandon(self, error: Error) -> Error {
        let _ = tokio::fs::remove_file(&self.path).await;
        error
    }

    async fn finish(mut self, target: &Path) -> Result<u64, Error> {
        let flushed = self.file.flush().await;
        let found = hex(&self.hash.clone().finalize());
        if found != self.digest {
            let text =
                format!("{}: bytes with digest {found} came, expected {}", target.display(), self.digest);
            return Err(self.abandon(Error::Failed(text)).await);
        }
        let moved = match flushed {
            Ok(()) => tokio::fs::rename(&self.path, target).await,
            Err(error) => Err(error),
        };
        match moved {
            Ok(()) => Ok(self.offset),
            Err(source) => Err(self.abandon(Error::file(target, source)).await),
        }
    }
}
