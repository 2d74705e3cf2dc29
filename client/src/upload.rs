//! Uploading blobs: only what is missing, resumed where it stopped.

use std::collections::BTreeMap;
use std::io::SeekFrom;
use std::time::Duration;

use async_stream::stream;
use futures::Stream;
use karst_proto::errors::{ErrorReason, reason};
use karst_proto::v1::upload_request::Part;
use karst_proto::v1::{FindMissingRequest, QueryUploadRequest, UploadRequest, UploadResponse, UploadStart};
use karst_proto::{MAX_CHUNK_BYTES, MAX_DIGESTS};
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tonic::Status;

use crate::blob::{Blob, Source};
use crate::client::broken_off;
use crate::retry::{Backoff, is_transient, unary};
use crate::{Client, Error};

/// What an upload sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uploaded {
    /// Blobs that the server lacked.
    pub blobs: usize,
    /// Their bytes.
    pub bytes: u64,
}

impl Client {
    /// Makes sure that the server holds all of `blobs`; `sent` hears of every blob that was uploaded.
    ///
    /// # Errors
    /// As `Assets.FindMissing` and `Assets.Upload`; a file cannot be read; a blob is over the server's limit.
    pub async fn upload(&self, blobs: &[Blob], sent: impl Fn(&Blob)) -> Result<Uploaded, Error> {
        let by_digest: BTreeMap<&str, &Blob> = blobs.iter().map(|blob| (blob.digest(), blob)).collect();
        let digests: Vec<String> = by_digest.keys().map(|digest| (*digest).to_owned()).collect();
        let mut uploaded = Uploaded::default();
        for some in digests.chunks(MAX_DIGESTS) {
            let answer = unary("find missing assets", || {
                let (mut assets, digests) = (self.assets(), some.to_vec());
                async move { assets.find_missing(FindMissingRequest { digests }).await }
            })
            .await?;
            for blob in answer.missing.iter().filter_map(|digest| by_digest.get(digest.as_str())) {
                check_size(blob, answer.max_upload_bytes)?;
                self.upload_blob(blob).await?;
                uploaded.blobs += 1;
                uploaded.bytes += blob.size();
                sent(blob);
            }
        }
        Ok(uploaded)
    }

    async fn upload_blob(&self, blob: &Blob) -> Result<(), Error> {
        let mut backoff = Backoff::new(Duration::from_secs(30));
        let mut reached = 0;
        loop {
            let state = unary("query upload", || {
                let (mut assets, digest) = (self.assets(), blob.digest.clone());
                async move { assets.query_upload(QueryUploadRequest { digest }).await }
            })
            .await?;
            if state.complete {
                return Ok(());
            }
            if state.committed_size > reached {
                reached = state.committed_size;
                backoff.reset();
            }
            let status = match self.upload_from(blob, state.committed_size).await? {
                Ok(answer) if answer.complete => return Ok(()),
                Ok(_) => broken_off(),
                Err(status) => status,
            };
            let again = is_transient(&status) || reason(&status) == Some(ErrorReason::OffsetMismatch);
            match backoff.next() {
                Some(wait) if again => tokio::time::sleep(wait).await,
                _ => return Err(Error::call("upload", status)),
            }
        }
    }

    /// One stream from `offset` on. The outer error is the client's own, the inner one the server's.
    async fn upload_from(&self, blob: &Blob, offset: u64) -> Result<Result<UploadResponse, Status>, Error> {
        let start = UploadStart { digest: blob.digest.clone(), total_size: blob.size, offset };
        let (failed, mut failure) = tokio::sync::oneshot::channel();
        let answer = self.assets().upload(parts(start, blob.source.clone(), failed)).await;
        if let Ok(error) = failure.try_recv() {
            return Err(error);
        }
        Ok(answer.map(tonic::Response::into_inner))
    }
}

fn check_size(blob: &Blob, limit: u64) -> Result<(), Error> {
    if limit == 0 || blob.size <= limit {
        return Ok(());
    }
    let name = match &blob.source {
        Source::File(path) => path.display().to_string(),
        Source::Memory(_) => "the scene document".to_owned(),
    };
    Err(Error::Usage(format!("{name}: found {} bytes, the server takes at most {limit}", blob.size)))
}

/// The messages of one upload stream; a file that cannot be read ends it and is told to `failed`.
fn parts(
    start: UploadStart,
    source: Source,
    failed: tokio::sync::oneshot::Sender<Error>,
) -> impl Stream<Item = UploadRequest> + Send + 'static {
    let offset = start.offset;
    stream! {
        yield UploadRequest { part: Some(Part::Start(start)) };
        match source {
            Source::Memory(bytes) => {
                for chunk in bytes.get(offset as usize..).unwrap_or_default().chunks(MAX_CHUNK_BYTES) {
                    yield UploadRequest { part: Some(Part::Chunk(chunk.to_vec().into())) };
                }
            }
            Source::File(path) => {
                let mut file = match open_at(&path, offset).await {
                    Ok(file) => file,
                    Err(error) => {
                        let _ = failed.send(Error::file(path, error));
                        return;
                    }
                };
                loop {
                    let mut chunk = Vec::with_capacity(MAX_CHUNK_BYTES);
                    match (&mut file).take(MAX_CHUNK_BYTES as u64).read_to_end(&mut chunk).await {
                        Ok(0) => return,
                        Ok(_) => yield UploadRequest { part: Some(Part::Chunk(chunk.into())) },
                        Err(error) => {
                            let _ = failed.send(Error::file(path, error));
                            return;
                        }
                    }
                }
            }
        }
    }
}

async fn open_at(path: &std::path::Path, offset: u64) -> std::io::Result<tokio::fs::File> {
    let mut file = tokio::fs::File::open(path).await?;
    file.seek(SeekFrom::Start(offset)).await?;
    Ok(file)
}
