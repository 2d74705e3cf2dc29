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
//! | [`preview`] | who watches pixels |
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
mod health;
pub mod job;
pub mod metrics;
pub mod model;
pub mod past;
pub mod preview;
pub mod service;
pub mod spec;
pub mod state;
pub mod telemetry;
pub mod uploads;
pub mod work;

pub use health::health;

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

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
use tonic::transport::server::{Router, TcpIncoming};
use tonic::transport::{Identity as ServerIdentity, Server, ServerTlsConfig};
use tower::layer::util::{Identity, Stack};

use crate::blobs::{Blobs, Kind};
use crate::config::Config;
use crate::door::{GuardLayer, TlsFiles, Tokens};
use crate::error::Error;
use crate::farm::fleet::Fleet;
use crate::farm::ledger::{self, Ledger};
use crate::farm::queue::Queue;
use crate::farm::worker::{self, Outlets};
use crate::farm::{Event, Farm, Shared};
use crate::service::assets::AssetsService;
use crate::service::frames::FramesService;
use crate::service::jobs::JobsService;
use crate::service::previews::PreviewsService;
use crate::service::workers::WorkersService;
use crate::state::State;
use crate::telemetry::Telemetry;
use crate::telemetry::calls::CallsLayer;
use crate::uploads::Uploads;

/// Open calls of one connection.
const MAX_STREAMS: u32 = 100;
/// Bytes of the headers of one call.
const MAX_HEADER_BYTES: u32 = 16 << 10;
/// Scenes that are checked, and stored films that are read, at the same time: each may be large.
const HEAVY: usize = 4;
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
    let builder = builder(config.tls.as_ref())?;
    let router = router(builder, &shared, uploads, outlets, tokens).await?;
    let _signpost = Signpost::leave(&listener, &config);
    let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
    ready();
    let ending = shared.ending.clone();
    let served = router.serve_with_incoming_shutdown(incoming, ending.clone().cancelled_owned());
    let mut served = std::pin::pin!(served);
    let early = tokio::select! {
        served = &mut served => Some(served),
        () = shutdown => None,
    };
    ending.cancel();
    let served = match early {
        Some(served) => served,
        // Calls that do not end in time are cut off: what they were told is durable anyway.
        None => timeout(GRACE, served).await.unwrap_or(Ok(())),
    };
    machinery.stop().await?;
    shared.state.close().await;
    shared.telemetry.traces.clone().end().await;
    served.map_err(|e| Error::Internal(format!("the listener failed: {e}")))
}

/// All calls are counted and pass the guard.
type Guarded = Stack<GuardLayer, Stack<CallsLayer, Identity>>;

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

/// A server with the limits and the certificate that hold for all connections.
fn builder(tls: Option<&TlsFiles>) -> Result<Server, Error> {
    let builder = Server::builder()
        .http2_keepalive_interval(Some(Duration::from_secs(30)))
        .http2_keepalive_timeout(Some(Duration::from_secs(10)))
        .max_concurrent_streams(Some(MAX_STREAMS))
        .http2_max_header_list_size(Some(MAX_HEADER_BYTES));
    let Some(tls) = tls else { return Ok(builder) };
    let read = |path: &Path| {
        let named = |e: std::io::Error| std::io::Error::new(e.kind(), format!("{}: {e}", path.display()));
        std::fs::read(path).map_err(named)
    };
    let identity = ServerIdentity::from_pem(read(&tls.cert)?, read(&tls.key)?);
    let wrong = |e: tonic::transport::Error| {
        let cause = std::error::Error::source(&e).map_or_else(|| e.to_string(), ToString::to_string);
        Error::Storage(std::io::Error::other(format!(
            "{} and {} are not a certificate and its key: {cause}",
            tls.cert.display(),
            tls.key.display()
        )))
    };
    builder.tls_config(ServerTlsConfig::new().identity(identity)).map_err(wrong)
}

async fn router(
    builder: Server,
    shared: &Arc<Shared>,
    uploads: Uploads,
    outlets: Outlets,
    tokens: Arc<Tokens>,
) -> Result<Router<Guarded>, Error> {
    let films = Arc::new(Semaphore::new(HEAVY));
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
        checking: Semaphore::new(HEAVY),
    });
    let frames = FramesServer::new(FramesService { shared: Arc::clone(shared), films: Arc::clone(&films) });
    let previews = PreviewsServer::new(PreviewsService { shared: Arc::clone(shared), films });
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
    Ok(builder
        .layer(CallsLayer::new(Arc::clone(&shared.telemetry)))
        .layer(GuardLayer { tokens })
        .add_service(health)
        .add_service(reflection)
        .add_service(assets.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(jobs.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(frames.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(previews.max_decoding_message_size(MAX_MESSAGE_BYTES))
        .add_service(workers.max_decoding_message_size(MAX_WORKER_MESSAGE_BYTES)))
}
