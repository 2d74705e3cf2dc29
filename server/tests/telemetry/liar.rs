//! Stands between a server and a worker and puts garbage in the place of every traceparent.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use karst_proto::v1::assets_server::{Assets, AssetsServer};
use karst_proto::v1::workers_server::{Workers, WorkersServer};
use karst_proto::v1::{
    self, DownloadRequest, DownloadResponse, GetJobSpecRequest, UpdateWorkerSessionRequest,
    UpdateWorkerSessionResponse,
};
use tokio::net::TcpListener;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status, Streaming};

use super::support::Client;

const GARBAGE: [&str; 4] = [
    "\u{0}garbage",
    "00-00000000000000000000000000000000-0000000000000000-01",
    "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-zz",
    "ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
];

pub(crate) struct Liar {
    pub(crate) url: String,
    told: Arc<AtomicUsize>,
    serves: tokio::task::JoinHandle<()>,
}

impl Liar {
    /// In front of the server of `client`.
    pub(crate) async fn start(client: Client) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let told = Arc::new(AtomicUsize::new(0));
        let between = Between { client, told: Arc::clone(&told) };
        let serves = tokio::spawn(async move {
            let router = Server::builder()
                .add_service(AssetsServer::new(between.clone()))
                .add_service(WorkersServer::new(between).max_decoding_message_size(4 << 20));
            router.serve_with_incoming(TcpIncoming::from(listener)).await.unwrap();
        });
        Self { url, told, serves }
    }

    /// Tasks that went by with garbage.
    pub(crate) fn told(&self) -> usize {
        self.told.load(Ordering::Relaxed)
    }
}

impl Drop for Liar {
    fn drop(&mut self) {
        self.serves.abort();
    }
}

#[derive(Clone)]
struct Between {
    client: Client,
    told: Arc<AtomicUsize>,
}

#[tonic::async_trait]
impl Workers for Between {
    async fn update_worker_session(
        &self,
        request: Request<UpdateWorkerSessionRequest>,
    ) -> Result<Response<UpdateWorkerSessionResponse>, Status> {
        let mut server = self.client.workers.clone();
        let mut answer = server.update_worker_session(request.into_inner()).await?.into_inner();
        for task in answer.leases.iter_mut().flat_map(|lease| &mut lease.tiles) {
            assert_eq!(task.traceparent.len(), 55, "{:?}", task.traceparent);
            let told = self.told.fetch_add(1, Ordering::Relaxed);
            task.traceparent = match told % 5 {
                4 => "00-".repeat(10_000),
                kind => GARBAGE[kind].to_owned(),
            };
        }
        Ok(Response::new(answer))
    }

    async fn get_job_spec(
        &self,
        request: Request<GetJobSpecRequest>,
    ) -> Result<Response<v1::JobSpec>, Status> {
        self.client.workers.clone().get_job_spec(request.into_inner()).await
    }
}

#[tonic::async_trait]
impl Assets for Between {
    type DownloadStream = Streaming<DownloadResponse>;

    async fn download(
        &self,
        request: Request<DownloadRequest>,
    ) -> Result<Response<Self::DownloadStream>, Status> {
        self.client.assets.clone().download(request.into_inner()).await
    }

    async fn find_missing(
        &self,
        _: Request<v1::FindMissingRequest>,
    ) -> Result<Response<v1::FindMissingResponse>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn upload(
        &self,
        _: Request<Streaming<v1::UploadRequest>>,
    ) -> Result<Response<v1::UploadResponse>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn query_upload(
        &self,
        _: Request<v1::QueryUploadRequest>,
    ) -> Result<Response<v1::QueryUploadResponse>, Status> {
        Err(Status::unimplemented("not for workers"))
    }
}
