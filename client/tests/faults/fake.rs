//! A server that keeps the protocol and breaks its streams.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use futures::stream::{BoxStream, StreamExt, iter};
use karst_client::{Bearer, Blob, Client};
use karst_proto::errors::{ErrorReason, status};
use karst_proto::v1::assets_server::{Assets, AssetsServer};
use karst_proto::v1::download_frame_response::Part as DownloadPart;
use karst_proto::v1::frames_server::{Frames, FramesServer};
use karst_proto::v1::job_event::Event;
use karst_proto::v1::jobs_server::{Jobs, JobsServer};
use karst_proto::v1::upload_request::Part;
use karst_proto::v1::{
    CancelJobRequest, CollectTilesRequest, CollectedTile, DownloadFrameRequest, DownloadFrameResponse,
    DownloadRequest, DownloadResponse, DownloadStart, FindMissingRequest, FindMissingResponse, GetJobRequest,
    Job, JobEvent, JobState, ListFramesRequest, ListFramesResponse, ListJobsRequest, ListJobsResponse,
    QueryUploadRequest, QueryUploadResponse, RoundFinished, SubmitJobRequest, UploadRequest, UploadResponse,
    WatchJobRequest,
};
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Code, Request, Response, Status, Streaming};

/// How the server misbehaves, and what it has seen.
#[derive(Debug, Default)]
pub(crate) struct Fake {
    /// So many uploads break off after two chunks.
    pub(crate) break_uploads: u32,
    /// Streams break off after so many messages; 0 never.
    pub(crate) break_every: usize,
    /// What `DownloadFrame` sends.
    pub(crate) file: Vec<u8>,
    /// Announces a digest that the file does not have.
    pub(crate) lie_about_digest: bool,
    /// What was uploaded.
    pub(crate) uploads: BTreeMap<String, Vec<u8>>,
    /// Announced sizes.
    pub(crate) sizes: BTreeMap<String, u64>,
    /// Offsets at which uploads and downloads began.
    pub(crate) offsets: Vec<u64>,
}

#[derive(Clone)]
struct Shared(Arc<Mutex<Fake>>);

impl Fake {
    pub(crate) async fn start(self) -> (Client, Arc<Mutex<Self>>) {
        let state = Arc::new(Mutex::new(self));
        let shared = Shared(Arc::clone(&state));
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let server = tonic::transport::Server::builder()
            .add_service(AssetsServer::new(shared.clone()))
            .add_service(JobsServer::new(shared.clone()))
            .add_service(FramesServer::new(shared));
        tokio::spawn(server.serve_with_incoming(TcpListenerStream::new(listener)));
        (Client::connect(&format!("http://{address}"), None, Bearer::default()).await.unwrap(), state)
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Fake> {
        self.0.lock().unwrap()
    }

    /// A stream that ends like a lost connection after `break_every` messages.
    fn stream<T: Send + 'static>(&self, messages: Vec<T>) -> Response<BoxStream<'static, Result<T, Status>>> {
        let limit = self.lock().break_every;
        let whole = limit == 0 || messages.len() <= limit;
        let kept = if whole { messages.len() } else { limit };
        let end = (!whole).then(|| Err(Status::unavailable("connection reset")));
        Response::new(iter(messages.into_iter().take(kept).map(Ok).chain(end)).boxed())
    }
}

fn known(job: &str) -> Result<(), Status> {
    if job == "job" { Ok(()) } else { Err(status(Code::NotFound, ErrorReason::JobNotFound, "no such job")) }
}

#[tonic::async_trait]
impl Assets for Shared {
    type DownloadStream = BoxStream<'static, Result<DownloadResponse, Status>>;

    async fn download(&self, _: Request<DownloadRequest>) -> Result<Response<Self::DownloadStream>, Status> {
        Err(Status::unimplemented("only workers call it"))
    }

    async fn find_missing(
        &self,
        request: Request<FindMissingRequest>,
    ) -> Result<Response<FindMissingResponse>, Status> {
        let fake = self.lock();
        let lacks = |digest: &String| {
            fake.uploads.get(digest).map(|bytes| bytes.len() as u64) != fake.sizes.get(digest).copied()
                || !fake.sizes.contains_key(digest)
        };
        let missing = request.into_inner().digests.into_iter().filter(lacks).collect();
        Ok(Response::new(FindMissingResponse { missing, max_upload_bytes: 1 << 30 }))
    }

    async fn upload(
        &self,
        request: Request<Streaming<UploadRequest>>,
    ) -> Result<Response<UploadResponse>, Status> {
        let mut parts = request.into_inner();
        let Some(Part::Start(start)) = parts.message().await?.and_then(|message| message.part) else {
            return Err(Status::invalid_argument("no start"));
        };
        let breaks = {
            let mut fake = self.lock();
            fake.offsets.push(start.offset);
            fake.sizes.insert(start.digest.clone(), start.total_size);
            let held = fake.uploads.entry(start.digest.clone()).or_default().len() as u64;
            if held != start.offset {
                return Err(status(Code::OutOfRange, ErrorReason::OffsetMismatch, "not there"));
            }
            fake.break_uploads > 0 && start.total_size > 1000
        };
        let mut count = 0;
        while let Some(message) = parts.message().await? {
            let Some(Part::Chunk(chunk)) = message.part else { continue };
            assert!(chunk.len() <= 256 << 10);
            self.lock().uploads.get_mut(&start.digest).unwrap().extend_from_slice(&chunk);
            count += 1;
            if breaks && count == 2 {
                self.lock().break_uploads -= 1;
                return Err(Status::unavailable("connection reset"));
            }
        }
        let committed_size = self.lock().uploads[&start.digest].len() as u64;
        let complete = committed_size == start.total_size;
        Ok(Response::new(UploadResponse { committed_size, complete }))
    }

    async fn query_upload(
        &self,
        request: Request<QueryUploadRequest>,
    ) -> Result<Response<QueryUploadResponse>, Status> {
        let held = self.lock().uploads.get(&request.into_inner().digest).map_or(0, Vec::len);
        Ok(Response::new(QueryUploadResponse { committed_size: held as u64, complete: false }))
    }
}

#[tonic::async_trait]
impl Jobs for Shared {
    async fn submit_job(&self, _: Request<SubmitJobRequest>) -> Result<Response<Job>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn get_job(&self, _: Request<GetJobRequest>) -> Result<Response<Job>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn list_jobs(&self, _: Request<ListJobsRequest>) -> Result<Response<ListJobsResponse>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn cancel_job(&self, _: Request<CancelJobRequest>) -> Result<Response<Job>, Status> {
        Err(Status::unimplemented(""))
    }

    type WatchJobStream = BoxStream<'static, Result<JobEvent, Status>>;

    /// A snapshot, ten rounds, and the final snapshot; the last event seen comes again after a resume.
    async fn watch_job(
        &self,
        request: Request<WatchJobRequest>,
    ) -> Result<Response<Self::WatchJobStream>, Status> {
        let request = request.into_inner();
        known(&request.job)?;
        if request.resume_token == "expired" {
            return Err(status(Code::OutOfRange, ErrorReason::ResumeTokenExpired, "too old"));
        }
        let from: u64 = request.resume_token.parse().unwrap_or(0);
        let event = |revision: u64| {
            let job = |state: JobState| Event::Snapshot(Job { state: state.into(), ..Job::default() });
            let event = match revision {
                1 => job(JobState::Running),
                12 => job(JobState::Succeeded),
                _ => Event::Round(RoundFinished { round: revision as u32 - 2, ..RoundFinished::default() }),
            };
            JobEvent { revision, resume_token: revision.to_string(), event: Some(event) }
        };
        Ok(self.stream((from.max(1)..=12).map(event).collect()))
    }
}

#[tonic::async_trait]
impl Frames for Shared {
    async fn list_frames(
        &self,
        _: Request<ListFramesRequest>,
    ) -> Result<Response<ListFramesResponse>, Status> {
        Err(Status::unimplemented(""))
    }

    type CollectTilesStream = BoxStream<'static, Result<CollectedTile, Status>>;

    async fn collect_tiles(
        &self,
        request: Request<CollectTilesRequest>,
    ) -> Result<Response<Self::CollectTilesStream>, Status> {
        let from: u32 = request.into_inner().resume_token.parse().unwrap_or(0);
        let tile = |tile: u32| CollectedTile {
            resume_token: (tile + 1).to_string(),
            tile,
            tile_count: 7,
            ..CollectedTile::default()
        };
        Ok(self.stream((from..7).map(tile).collect()))
    }

    type DownloadFrameStream = BoxStream<'static, Result<DownloadFrameResponse, Status>>;

    async fn download_frame(
        &self,
        request: Request<DownloadFrameRequest>,
    ) -> Result<Response<Self::DownloadFrameStream>, Status> {
        let offset = request.into_inner().offset;
        let (file, lie) = {
            let mut fake = self.lock();
            fake.offsets.push(offset);
            (fake.file.clone(), fake.lie_about_digest)
        };
        let digest = if lie { "0".repeat(64) } else { Blob::of_bytes(&file).digest().to_owned() };
        let start = DownloadStart { total_size: file.len() as u64, digest };
        let chunks =
            file[offset as usize..].chunks(100_000).map(|chunk| DownloadPart::Chunk(chunk.to_vec().into()));
        let parts = std::iter::once(DownloadPart::Start(start)).chain(chunks);
        Ok(self.stream(parts.map(|part| DownloadFrameResponse { part: Some(part) }).collect()))
    }
}
