//! karst's job service: takes scenes over gRPC, renders their frames in this process and in worker processes, keeps
//! and serves the results.
//!
//! A tour, from the wire to the pixels:
//!
//! | module | owns |
//! |---|---|
//! | [`config`] | the command line |
//! | [`door`] | tokens and roles: who may call what |
//! | [`service`] | `karst.v1`: convert, ask, convert |
//! | [`error`] | every way a call fails, and the one mapping to gRPC statuses |
//! | [`model`] [`spec`] [`job`] | what a job is, and the pure machine that says what may happen to it |
//! | [`past`] | what went wrong with a tile, and when it is not tried again |
//! | [`state`] | SQL |
//! | [`blobs`] [`uploads`] [`digest`] | bytes by their SHA-256 |
//! | [`farm`] | the event loop, the workers, the ledger that makes things durable |
//! | [`preview`] `view` `films` | who watches pixels, and what they see |
//! | `front` `page` | the port, and the page that browsers show |
//! | [`telemetry`] [`metrics`] | what karst tells about itself: log lines, spans, counts |
//! | [`work`] | the other side: a process that renders tasks of a server |
//!
//! How a result comes to count: a worker renders a tile → the ledger stores its bytes (synced) → one transaction →
//! merged into the film → watchers hear of it. A round's film replaces the results in it. So a `kill -9` at any
//! moment loses only what nobody was told of, and since a pixel is a pure function of scene, frame, seed and
//! sample range, the picture has the same bits afterwards.

pub mod blobs;
mod clock;
pub mod config;
pub mod digest;
pub mod door;
pub mod error;
pub mod farm;
mod films;
mod front;
mod health;
pub mod job;
pub mod metrics;
pub mod model;
mod page;
pub mod past;
pub mod preview;
pub mod service;
pub mod spec;
pub mod state;
pub mod telemetry;
pub mod uploads;
mod view;
pub mod work;

pub use health::health;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::Router;
use axum::extract::{Request, State as From};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse as _, Response};
use axum::routing::get;
use karst_core::scene::Limits;
use karst_proto::connect;
use karst_proto::v1::assets_server::AssetsServer;
use karst_proto::v1::frames_server::FramesServer;
use karst_proto::v1::jobs_server::JobsServer;
use karst_proto::v1::previews_server::PreviewsServer;
use karst_proto::v1::workers_server::WorkersServer;
use karst_proto::{FILE_DESCRIPTOR_SET, MAX_MESSAGE_BYTES, MAX_WORKER_MESSAGE_BYTES};
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, mpsc};
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::Status;
use tonic::codegen::http;
use tonic::service::RoutesBuilder;

use crate::blobs::{Blobs, Kind};
use crate::config::Config;
use crate::door::{Tokens, guard, is_call};
use crate::error::Error;
use crate::farm::fleet::Fleet;
use crate::farm::ledger::{self, Ledger};
use crate::farm::queue::Queue;
use crate::farm::worker::{self, Outlets};
use crate::farm::{Event, Farm, Shared};
use crate::films::Films;
use crate::service::assets::AssetsService;
use crate::service::frames::FramesService;
use crate::service::jobs::JobsService;
use crate::service::previews::PreviewsService;
use crate::service::workers::WorkersService;
use crate::state::State;
use crate::telemetry::Telemetry;
use crate::telemetry::calls::{Counter, count};
use crate::uploads::Uploads;

/// Scenes that are checked at the same time: each may be large.
const CHECKING: usize = 4;
/// How long open calls may take to end when the server ends.
const GRACE: Duration = Duration::from_secs(5);

/// Serves `karst.v1` on `listener` until `shutdown` resolves; calls `ready` when calls are answered.
///
/// # Errors
/// When the data folder cannot be used, or is in use by another server; when the listener fails.
pub async fn serve(
    listener: TcpListener,
    config: Config,
    ready: impl FnOnce(),
    shutdown: impl Future<Output = ()>,
) -> Result<(), Error> {
    std::fs::create_dir_all(&config.data)?;
    let _lock = lock(&config.data)?;
    let tokens = Arc::new(Tokens::open(&config.data, config.tokens_file.as_deref())?);
    let queue = Arc::new(Queue::default());
    let shared = open(&config, &queue).await?;
    let uploads = Uploads::open(&config.data.join("uploads"), shared.blobs.clone())?;
    let (outlets, machinery) = start(&shared, &queue, config.workers).await?;
    let tls = config.tls.as_ref().map(front::acceptor).transpose()?;
    let page = page::Page::new(&shared, &tokens, listener.local_addr()?.port(), tls.is_some());
    let sockets = page.sockets.clone();
    let routes = routes(&shared, uploads, outlets, tokens, page).await?;
    let _signpost = Signpost::leave(&listener, &config);
    let ending = shared.ending.clone();
    let served = tokio::spawn(front::serve(listener, tls, routes, ending.clone()));
    ready();
    shutdown.await;
    ending.cancel();
    sockets.close();
    let all = async { tokio::join!(served, sockets.wait()) };
    // Calls that do not end in time are cut off: what they were told is durable anyway.
    if timeout(GRACE, all).await.is_err() {
        tracing::info!("some calls were cut off");
    }
    machinery.stop().await?;
    shared.state.close().await;
    shared.telemetry.traces.clone().end().await;
    Ok(())
}

/// Shows programs of this account where the local token is, as long as the server runs.
struct Signpost {
    state: PathBuf,
    port: u16,
    token: PathBuf,
}

impl Signpost {
    fn leave(listener: &TcpListener, config: &Config) -> Option<Self> {
        let (state, token) = (config.state.clone()?, config.data.join("token"));
        let port = listener.local_addr().ok()?.port();
        if let Err(e) = connect::leave_signpost(&state, port, &token) {
            tracing::warn!("programs must be told --token-file {}: {e}", token.display());
        }
        Some(Self { state, port, token })
    }
}

impl Drop for Signpost {
    fn drop(&mut self) {
        connect::remove_signpost(&self.state, self.port, &self.token);
    }
}

/// Two servers on one folder would each undo what the other does.
fn lock(data: &Path) -> Result<File, Error> {
    let path = data.join("lock");
    let file = File::create(&path)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::Storage(std::io::Error::other(format!(
            "{} is in use by another karst-server: end it, or choose another --data",
            data.display()
        )))),
        Err(TryLockError::Error(e)) => Err(e.into()),
    }
}

/// Opens what survived, and takes away what a crash left behind.
async fn open(config: &Config, queue: &Arc<Queue>) -> Result<Arc<Shared>, Error> {
    let data = &config.data;
    let state = State::open(&data.join("karst.db")).await?;
    let blobs = Blobs::open(&data.join("blobs"))?;
    let swept = blobs.sweep(Kind::Pack, &state.packs().await?).await?
        + blobs.sweep(Kind::Film, &state.films().await?).await?;
    if swept > 0 {
        tracing::info!("deleted {swept} blobs that nothing refers to");
    }
    let telemetry = Arc::new(Telemetry::start(&config.collector)?);
    let earlier = (state.count_start().await?, state.leases().await?);
    let fleet = Fleet::new(Arc::clone(queue), config.workers, config.lease, earlier, Arc::clone(&telemetry));
    Ok(Arc::new(Shared {
        telemetry,
        fleet,
        state,
        films: Films::new(blobs.clone()),
        blobs,
        limits: Limits::default(),
        live: farm::live::Live::default(),
        hub: Arc::default(),
        feeds: farm::feed::Feeds::default(),
        ending: CancellationToken::new(),
    }))
}

/// The parts that run beside the calls.
struct Machinery {
    farm: tokio::task::JoinHandle<()>,
    ledger: tokio::task::JoinHandle<()>,
    workers: Vec<JoinHandle<()>>,
}

/// Starts workers, ledger and farm, and gives them the jobs that are not finished.
async fn start(
    shared: &Arc<Shared>,
    queue: &Arc<Queue>,
    workers: usize,
) -> Result<(Outlets, Machinery), Error> {
    let (events, received) = mpsc::unbounded_channel();
    let (entries, written) = ledger::channel();
    for job in shared.state.unfinished().await? {
        tracing::info!(job = %job.run.job.id, "goes on");
        let _ = events.send(Event::Submitted(Box::new(job), None));
    }
    let outlets = Outlets {
        queue: Arc::clone(queue),
        ledger: entries.downgrade(),
        farm: events.clone(),
        telemetry: Arc::clone(&shared.telemetry),
    };
    let ledger = Ledger {
        state: shared.state.clone(),
        blobs: shared.blobs.clone(),
        hub: Arc::clone(&shared.hub),
        farm: events.clone(),
        telemetry: Arc::clone(&shared.telemetry),
    };
    let workers = worker::start(workers, &outlets, &entries)?;
    let farm = Farm::new(Arc::clone(shared), Arc::clone(queue), entries, events);
    let ledger = tokio::spawn(ledger.run(written));
    Ok((outlets, Machinery { workers, ledger, farm: tokio::spawn(farm.run(received)) }))
}

impl Machinery {
    /// Ends everything in the order of the flow: no new tasks, no new results, all results written.
    async fn stop(self) -> Result<(), Error> {
        self.farm.await?;
        let join = move || self.workers.into_iter().all(|worker| worker.join().is_ok());
        if !tokio::task::spawn_blocking(join).await? {
            tracing::error!("a worker thread has panicked");
        }
        // A disk that takes nothing must not keep the program from ending: nobody was told of what is lost.
        let mut ledger = self.ledger;
        if timeout(GRACE, &mut ledger).await.is_err() {
            ledger.abort();
        }
        Ok(())
    }
}

/// Everything that is answered on the port: calls, and the page.
async fn routes(
    shared: &Arc<Shared>,
    uploads: Uploads,
    outlets: Outlets,
    tokens: Arc<Tokens>,
    page: page::Page,
) -> Result<Router, Error> {
    let assets = AssetsServer::new(AssetsService {
        blobs: shared.blobs.clone(),
        uploads,
        max_bytes: shared.limits.max_asset_bytes,
        telemetry: Arc::clone(&shared.telemetry),
        ending: shared.ending.clone(),
    });
    let jobs = JobsServer::new(JobsService {
        shared: Arc::clone(shared),
        farm: outlets.farm.clone(),
        checking: Semaphore::new(CHECKING),
    });
    let frames = FramesServer::new(FramesService { shared: Arc::clone(shared) });
    let previews = PreviewsServer::new(PreviewsService { shared: Arc::clone(shared) });
    let workers = WorkersServer::new(WorkersService { shared: Arc::clone(shared), outlets });
    let (reporter, health) = tonic_health::server::health_reporter();
    reporter.set_serving::<AssetsServer<AssetsService>>().await;
    reporter.set_serving::<JobsServer<JobsService>>().await;
    reporter.set_serving::<FramesServer<FramesService>>().await;
    reporter.set_serving::<PreviewsServer<PreviewsService>>().await;
    reporter.set_serving::<WorkersServer<WorkersService>>().await;
    let reflection = tonic_reflection::server::Builder::configure()
        .register_encoded_file_descriptor_set(FILE_DESCRIPTOR_SET)
        .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        .build_v1()
        .map_err(|e| Error::Internal(e.to_string()))?;
    let mut calls = RoutesBuilder::default();
    calls
        .add_service(health)
        .add_service(reflection)
        .add_service(assets.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(jobs.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(frames.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(previews.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(workers.max_decoding_message_size(MAX_WORKER_MESSAGE_BYTES));
    let metrics = Router::new().route("/metrics", get(show_metrics)).with_state(Arc::clone(shared));
    // The guard comes first, and what it refuses is counted too.
    let calls = calls
        .routes()
        .into_axum_router()
        .merge(metrics)
        .route_layer(from_fn_with_state(tokens, guard))
        .layer(from_fn_with_state(Counter::new(Arc::clone(&shared.telemetry)), count));
    Ok(calls.merge(page::routes(page)).fallback(unknown))
}

/// What Prometheus asks for.
async fn show_metrics(From(shared): From<Arc<Shared>>) -> Response {
    match metrics::metrics(&shared).await {
        Ok(text) => ([(http::header::CONTENT_TYPE, metrics::CONTENT_TYPE)], text).into_response(),
        Err(e) => (http::StatusCode::SERVICE_UNAVAILABLE, format!("{e}\n")).into_response(),
    }
}

/// Nothing is at this path.
async fn unknown(request: Request) -> Response {
    if is_call(request.headers()) {
        return Status::unimplemented("this server has no such call").into_http();
    }
    (http::StatusCode::NOT_FOUND, "nothing is here; the page is at /\n").into_response()
}
