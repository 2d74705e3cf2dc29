//! Downloading files of finished frames, to disk or into memory: resumed where it stopped, digest checked, never a
//! half file in place.

use std::path::PathBuf;
use std::time::Duration;

use karst_proto::errors::{ErrorReason, status};
use karst_proto::v1::download_frame_response::Part;
use karst_proto::v1::{DownloadFrameRequest, FrameFormat};
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::{AsyncWrite, AsyncWriteExt};
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

/// What has come so far.
struct Partial<W> {
    /// What messages call it.
    name: PathBuf,
    sink: W,
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
        let Download { job, frame, format, path } = download;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            tokio::fs::create_dir_all(folder).await.map_err(|source| Error::file(folder, source))?;
        }
        let mut name = path.as_os_str().to_owned();
        name.push(".part");
        let part = PathBuf::from(name);
        let file = File::create(&part).await.map_err(|source| Error::file(&part, source))?;
        let whole = self.receive((job, *frame, *format), Partial::new(part.clone(), file)).await;
        let moved = match whole {
            Ok(partial) => {
                let moved = tokio::fs::rename(&part, path).await;
                moved.map(|()| partial.offset).map_err(|source| Error::file(path, source))
            }
            Err(error) => Err(error),
        };
        if moved.is_err() {
            let _ = tokio::fs::remove_file(&part).await;
        }
        moved
    }

    /// The bytes of a file of a finished frame. Goes on where a lost connection stopped it.
    ///
    /// # Errors
    /// As `Frames.DownloadFrame`; the bytes do not match their digest.
    pub async fn frame_bytes(&self, job: &str, frame: i32, format: FrameFormat) -> Result<Vec<u8>, Error> {
        let name = PathBuf::from(format!("frame {frame} of job {job}"));
        Ok(self.receive((job, frame, format), Partial::new(name, Vec::new())).await?.sink)
    }

    /// All bytes of a file, with the right digest.
    async fn receive<W: AsyncWrite + Unpin>(
        &self,
        which: (&str, i32, FrameFormat),
        mut partial: Partial<W>,
    ) -> Result<Partial<W>, Error> {
        let mut backoff = Backoff::new(Duration::from_mins(1));
        loop {
            let before = partial.offset;
            let Err(failure) = self.receive_from(which, &mut partial).await? else { break };
            if partial.offset > before {
                backoff.reset();
            }
            match backoff.next() {
                Some(wait) if is_transient(&failure) => tokio::time::sleep(wait).await,
                _ => return Err(Error::call("download", failure)),
            }
        }
        partial.check().await?;
        Ok(partial)
    }

    /// One stream from where `partial` ends. The outer error is the client's own, the inner one the server's.
    async fn receive_from<W: AsyncWrite + Unpin>(
        &self,
        (job, frame, format): (&str, i32, FrameFormat),
        partial: &mut Partial<W>,
    ) -> Result<Result<(), Status>, Error> {
        let (job, offset) = (job.to_owned(), partial.offset);
        let request = DownloadFrameRequest { job, frame, format: format.into(), offset };
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
                Some(Part::Chunk(bytes)) if bytes.len() as u64 > partial.total_size - partial.offset => {
                    let text = "more bytes came than were announced";
                    return Ok(Err(status(Code::DataLoss, ErrorReason::BlobCorrupt, text)));
                }
                Some(Part::Chunk(bytes)) => partial.write(&bytes).await?,
                Some(Part::Start(_)) | None => {}
            }
        }
    }
}

impl<W: AsyncWrite + Unpin> Partial<W> {
    fn new(name: PathBuf, sink: W) -> Self {
        Self { name, sink, hash: Sha256::new(), offset: 0, digest: String::new(), total_size: 0 }
    }

    fn is_complete(&self) -> bool {
        !self.digest.is_empty() && self.offset == self.total_size
    }

    async fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.sink.write_all(bytes).await.map_err(|source| Error::file(&self.name, source))?;
        self.hash.update(bytes);
        self.offset += bytes.len() as u64;
        Ok(())
    }

    /// Everything is in the sink, and it is what was announced.
    async fn check(&mut self) -> Result<(), Error> {
        let found = hex(&self.hash.clone().finalize());
        if found != self.digest {
            let (name, expected) = (self.name.display(), &self.digest);
            let text = format!("{name}: bytes with digest {found} came, expected {expected}");
            return Err(Error::Failed(text));
        }
        self.sink.flush().await.map_err(|source| Error::file(&self.name, source))
    }
}
