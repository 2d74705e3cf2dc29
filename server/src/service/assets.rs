//! Owns `karst.v1.Assets`: uploads by digest.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use karst_proto::v1::assets_server::Assets;
use karst_proto::v1::{
    DownloadRequest, DownloadResponse, FindMissingRequest, FindMissingResponse, QueryUploadRequest,
    QueryUploadResponse, UploadRequest, UploadResponse, UploadStart, upload_request::Part,
};
use karst_proto::{MAX_CHUNK_BYTES, MAX_DIGESTS};
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::{Request, Response, Status, Streaming};

use crate::blobs::{Blobs, Kind};
use crate::digest::Digest;
use crate::error::Error;
use crate::service::convert::digest;
use crate::service::outlet::{Closed, Outflow, Outlet, stream};
use crate::telemetry::Telemetry;
use crate::telemetry::counts::Ongoing;
use crate::uploads::{Committed, Uploads};

/// An upload that sends nothing for so long gives its place up; what came is kept.
const IDLE: Duration = Duration::from_secs(30);

/// The service.
#[derive(Debug)]
pub struct AssetsService {
    pub(crate) blobs: Blobs,
    pub(crate) uploads: Uploads,
    /// Largest blob in bytes.
    pub(crate) max_bytes: u64,
    pub(crate) telemetry: Arc<Telemetry>,
    /// The server is ending.
    pub(crate) ending: CancellationToken,
}

#[tonic::async_trait]
impl Assets for AssetsService {
    type DownloadStream = Outflow<DownloadResponse>;

    async fn find_missing(
        &self,
        request: Request<FindMissingRequest>,
    ) -> Result<Response<FindMissingResponse>, Status> {
        let digests = checked_digests(&request.into_inner().digests)?;
        let missing = missing(&self.blobs, &digests).await?;
        let missing = missing.iter().map(Digest::to_string).collect();
        Ok(Response::new(FindMissingResponse { missing, max_upload_bytes: self.max_bytes }))
    }

    async fn upload(
        &self,
        request: Request<Streaming<UploadRequest>>,
    ) -> Result<Response<UploadResponse>, Status> {
        let Committed { size, complete } = self.receive(request.into_inner()).await?;
        Ok(Response::new(UploadResponse { committed_size: size, complete }))
    }

    async fn query_upload(
        &self,
        request: Request<QueryUploadRequest>,
    ) -> Result<Response<QueryUploadResponse>, Status> {
        let digest = digest("digest", &request.into_inner().digest)?;
        let Committed { size, complete } = self.uploads.committed(digest).await?;
        Ok(Response::new(QueryUploadResponse { committed_size: size, complete }))
    }

    async fn download(
        &self,
        request: Request<DownloadRequest>,
    ) -> Result<Response<Self::DownloadStream>, Status> {
        let DownloadRequest { digest: text, offset } = request.into_inner();
        let digest = digest("digest", &text)?;
        let size = self.blobs.size(Kind::Asset, &digest).await?.ok_or(Error::BlobNotFound(digest))?;
        if offset > size {
            return Err(Error::Offset { found: offset, expected: size }.into());
        }
        let blobs = self.blobs.clone();
        let send = move |outlet| async move { send_blob(&blobs, digest, offset..size, &outlet).await };
        Ok(Response::new(stream(&self.ending, send)))
    }
}

async fn send_blob(
    blobs: &Blobs,
    digest: Digest,
    range: std::ops::Range<u64>,
    outlet: &Outlet<DownloadResponse>,
) -> Result<(), Closed> {
    let total_size = range.end;
    let mut at = range.start;
    loop {
        let end = (at + MAX_CHUNK_BYTES as u64).min(total_size);
        let chunk = if at < end { blobs.part(Kind::Asset, digest, at..end).await? } else { Vec::new() };
        outlet.send(DownloadResponse { total_size, chunk: chunk.into() }).await?;
        at = end;
        if at == total_size {
            return Ok(());
        }
    }
}

impl AssetsService {
    async fn receive(&self, mut stream: Streaming<UploadRequest>) -> Result<Committed, Status> {
        let Some(Part::Start(start)) = next(&mut stream).await? else {
            return Err(Error::field("start", "expected the first message to be `start`").into());
        };
        let digest = self.check(&start)?;
        let Some(mut upload) = self.uploads.begin(digest, start.total_size, start.offset).await? else {
            return Ok(self.uploads.committed(digest).await?);
        };
        let _counted = Ongoing::new(&self.telemetry.counts.uploads);
        loop {
            match next(&mut stream).await {
                Ok(Some(Part::Chunk(chunk))) => {
                    let allowed = 1..=MAX_CHUNK_BYTES;
                    if !allowed.contains(&chunk.len()) {
                        let text = format!("found {} bytes, expected 1 to {MAX_CHUNK_BYTES}", chunk.len());
                        return Err(Error::field("chunk", text).into());
                    }
                    upload.write(&chunk).await?;
                }
                Ok(Some(Part::Start(_))) => {
                    return Err(Error::field("start", "found a second `start`, expected `chunk`").into());
                }
                Ok(None) => return Ok(upload.finish().await?),
                Err(status) => {
                    // The stream broke off; keep what came, whoever was sending will ask how far it got.
                    let _ = upload.keep().await;
                    return Err(status);
                }
            }
        }
    }

    fn check(&self, start: &UploadStart) -> Result<Digest, Error> {
        let digest = digest("start.digest", &start.digest)?;
        if start.total_size > self.max_bytes {
            let text = format!("found {} bytes, at most {}", start.total_size, self.max_bytes);
            return Err(Error::limit("start.total_size", text));
        }
        Ok(digest)
    }
}

/// The next part of the stream; `None` at its end.
async fn next(stream: &mut Streaming<UploadRequest>) -> Result<Option<Part>, Status> {
    let message = timeout(IDLE, stream.message()).await.map_err(|_| Error::UploadIdle(IDLE.as_secs()))??;
    match message {
        None => Ok(None),
        Some(UploadRequest { part: Some(part) }) => Ok(Some(part)),
        Some(UploadRequest { part: None }) => {
            Err(Error::field("part", "expected `start` or `chunk`, found neither").into())
        }
    }
}

fn checked_digests(texts: &[String]) -> Result<Vec<Digest>, Error> {
    if texts.is_empty() || texts.len() > MAX_DIGESTS {
        let text = format!("found {} digests, expected 1 to {MAX_DIGESTS}", texts.len());
        return Err(Error::field("digests", text));
    }
    texts.iter().enumerate().map(|(i, text)| digest(&format!("digests[{i}]"), text)).collect()
}

/// Those of `digests` that are not complete, in order, each once.
pub(crate) async fn missing(blobs: &Blobs, digests: &[Digest]) -> Result<Vec<Digest>, Error> {
    let mut asked = BTreeSet::new();
    let mut missing = Vec::new();
    for digest in digests {
        if asked.insert(*digest) && blobs.size(Kind::Asset, digest).await?.is_none() {
            missing.push(*digest);
        }
    }
    Ok(missing)
}
