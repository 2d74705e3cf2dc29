//! Owns a worker process: asks a server for tasks, renders them, brings the results.
//!
//! One loop talks to the server and nothing else does; threads render; scenes are fetched and built beside both.
//! Nothing here is durable and nothing needs to be: whatever a worker loses is rendered again elsewhere.

mod cache;
mod connection;
mod desk;
mod pool;
mod scenes;

use std::io;
use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{Round, SampleRange, TileGrid};
use karst_proto::MAX_WORKER_MESSAGE_BYTES;
use karst_proto::connect::Line;
use karst_proto::errors::{ErrorReason, reason};
use karst_proto::v1::workers_client::WorkersClient;
use karst_proto::v1::{
    Lease, TaskEnd, TaskReport, TileTask, UpdateWorkerSessionRequest, UpdateWorkerSessionResponse,
    WorkerState,
};
use tokio::sync::{Mutex, mpsc};
use tokio::time::{Instant, sleep, timeout};
use tonic::{Code, Status};
use uuid::Uuid;

use crate::config::WorkConfig;
use crate::telemetry::traces::Traces;
use crate::work::cache::Cache;
use crate::work::connection::Link;
use crate::work::desk::{Desk, without_result};
use crate::work::pool::{Outcome, Pool, PoolTask};
use crate::work::scenes::{Scenes, WorkFrame};

/// An answer that takes longer is lost; the server holds one back for at most 10 s.
const ANSWER: Duration = Duration::from_secs(25);
/// How often a busy worker calls that has nothing to tell, unless the server wants to hear of it more often.
const HEARTBEAT: Duration = Duration::from_secs(5);
/// How often a worker asks for more while its last tasks are being rendered.
const ASK: Duration = Duration::from_millis(500);
/// Waits between attempts to reach a server that is away.
const RETRY: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));
/// The part of the grace time that is kept for telling the server.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// Why a worker ends without being told to.
#[derive(Debug, thiserror::Error)]
pub enum WorkError {
    /// The command line.
    #[error("{0}")]
    Usage(String),
    /// The server was built from another core.
    #[error("{0}")]
    Build(String),
    /// The server does not take this worker's token, or blocked the worker.
    #[error("{0}")]
    Refused(String),
    /// The server is away for too long.
    #[error("{server}: nobody answered for {} s: {cause}", .waited.as_secs())]
    Away {
        /// Its address.
        server: String,
        /// For how long.
        waited: Duration,
        /// What the last attempt said.
        cause: String,
    },
    /// The system said no.
    #[error("{0}")]
    System(#[from] io::Error),
}

/// What the loop hears of.
#[derive(Debug)]
enum News {
    /// A task has ended.
    Ended(u64, u32, Outcome),
    /// The frame of a lease is ready, or cannot be had.
    Opened(Lease, Result<Arc<WorkFrame>, String>),
}

/// Renders for a server until `stop` resolves, then hands back what is not finished.
///
/// # Errors
/// [`WorkError`] when there is nothing more this process can do.
pub async fn work(config: WorkConfig, stop: impl Future<Output = ()>) -> Result<(), WorkError> {
    let link = Link::new(&config)?;
    let cache = Cache::open(&config.cache, config.cache_bytes)
        .map_err(|e| io::Error::new(e.kind(), format!("--cache {}: {e}", config.cache.display())))?;
    let (news, hears) = mpsc::unbounded_channel();
    let id = Uuid::new_v4();
    let traces = Traces::start(&config.collector, "karst-worker", &id.to_string())?;
    let pool = Arc::new(Pool::new(&id.to_string(), traces.clone()));
    pool.start(config.threads, &news)?;
    let calls = WorkersClient::new(link.line.clone())
        .max_encoding_message_size(MAX_WORKER_MESSAGE_BYTES)
        .max_decoding_message_size(MAX_WORKER_MESSAGE_BYTES);
    let name = format!("{}:{}", config.host, std::process::id());
    tracing::info!(worker = %id, server = %config.server, threads = config.threads, core = karst_core::BUILD, "begins");
    let mut worker = Worker {
        scenes: Arc::new(Mutex::new(Scenes::new(cache))),
        desk: Desk::default(),
        sequence: 0,
        heartbeat: HEARTBEAT,
        opening: 0,
        away: None,
        id: id.to_string(),
        config,
        link,
        calls,
        pool,
        traces,
        news,
        hears,
        name,
    };
    let mut stop = std::pin::pin!(stop);
    let ended = loop {
        tokio::select! {
            () = &mut stop => break worker.drain().await,
            turned = worker.turn() => if let Err(e) = turned { break Err(e) },
        }
    };
    worker.pool.close();
    worker.traces.end().await;
    ended
}

struct Worker {
    config: WorkConfig,
    link: Link,
    calls: WorkersClient<Line>,
    id: String,
    name: String,
    sequence: u64,
    desk: Desk,
    pool: Arc<Pool>,
    traces: Traces,
    scenes: Arc<Mutex<Scenes>>,
    news: mpsc::UnboundedSender<News>,
    hears: mpsc::UnboundedReceiver<News>,
    /// Tiles of leases whose frames are being fetched and built.
    opening: usize,
    /// How often the server has to hear of this worker.
    heartbeat: Duration,
    /// Since when the server does not answer, and how long the next wait is.
    away: Option<(Instant, Duration)>,
}

impl Worker {
    /// One exchange with the server, then waits for a reason for the next. Dropping it half-way loses nothing: the
    /// server repeats what was not heard.
    async fn turn(&mut self) -> Result<(), WorkError> {
        let idle = self.config.threads.saturating_sub(self.pool.waiting() + self.opening);
        let wait = self.desk.is_empty();
        match self.exchange(WorkerState::Active, idle as u32, wait).await {
            Ok(answer) => {
                self.away = None;
                // A third of the time to live: two calls may be lost.
                let ttl = Duration::from_millis(answer.ttl_milliseconds.into());
                self.heartbeat = (ttl / 3).clamp(Duration::from_millis(50), HEARTBEAT);
                self.take(answer);
            }
            Err(status) => self.excuse(&status).await?,
        }
        self.listen().await;
        Ok(())
    }

    async fn exchange(
        &mut self,
        state: WorkerState,
        idle_threads: u32,
        wait: bool,
    ) -> Result<UpdateWorkerSessionResponse, Status> {
        self.sequence += 1;
        let request = UpdateWorkerSessionRequest {
            worker: self.id.clone(),
            display_name: self.name.clone(),
            core_build: karst_core::BUILD.to_owned(),
            threads: self.config.threads as u32,
            state: state.into(),
            sequence: self.sequence,
            held: self.desk.held(),
            reports: self.desk.outgoing(),
            idle_threads,
            wait,
        };
        let call = self.calls.update_worker_session(request);
        let answer = timeout(ANSWER, call).await.map_err(|_| Status::unavailable("no answer in time"))?;
        Ok(answer?.into_inner())
    }

    fn take(&mut self, answer: UpdateWorkerSessionResponse) {
        for refused in answer.verdicts.iter().filter(|v| !v.message.is_empty()) {
            tracing::warn!(
                fence = refused.fence,
                tile = refused.tile,
                "the server refused: {}",
                refused.message
            );
        }
        for fence in &answer.revoked {
            self.pool.take_back(Some(*fence));
        }
        for lease in self.desk.take(answer) {
            tracing::debug!(fence = lease.fence, tiles = lease.tiles.len(), round = lease.round, "a lease");
            self.opening += lease.tiles.len();
            let (scenes, link, news) = (Arc::clone(&self.scenes), self.link.clone(), self.news.clone());
            tokio::spawn(async move {
                let opened = scenes.lock().await.frame(&lease.job, lease.frame, &link).await;
                let _ = news.send(News::Opened(lease, opened));
            });
        }
    }

    /// Waits for a reason to call the server: something to tell, too little to do, or time.
    async fn listen(&mut self) {
        if self.desk.is_empty() {
            return;
        }
        let pause =
            if self.pool.waiting() + self.opening < self.config.threads { ASK } else { self.heartbeat };
        let until = Instant::now() + pause.min(self.heartbeat);
        while !self.desk.has_reports() {
            match tokio::time::timeout_at(until, self.hears.recv()).await {
                Ok(Some(news)) => self.hear(news),
                Ok(None) | Err(_) => return,
            }
        }
        // What ended meanwhile goes along.
        while let Ok(news) = self.hears.try_recv() {
            self.hear(news);
        }
    }

    fn hear(&mut self, news: News) {
        if let News::Opened(lease, _) = &news {
            self.opening = self.opening.saturating_sub(lease.tiles.len());
        }
        match news {
            News::Ended(fence, tile, outcome) => self.desk.report(match outcome {
                Outcome::Done(result, digest, seconds) => TaskReport {
                    result: result.into(),
                    digest: digest.to_string(),
                    seconds,
                    ..without_result(fence, tile, TaskEnd::Done, String::new())
                },
                Outcome::Failed(message) => without_result(fence, tile, TaskEnd::Failed, message),
                Outcome::Stopped => without_result(fence, tile, TaskEnd::Interrupted, String::new()),
            }),
            News::Opened(lease, Ok(frame)) => match tasks(&lease, &frame, &self.traces) {
                Ok(tasks) => {
                    let open = self.desk.tiles(lease.fence);
                    self.pool.push(tasks.into_iter().filter(|t| open.contains(&t.tile)));
                }
                Err(message) => self.fail(&lease, &message),
            },
            News::Opened(lease, Err(message)) => self.fail(&lease, &message),
        }
    }

    fn fail(&mut self, lease: &Lease, message: &str) {
        tracing::error!(job = lease.job, frame = lease.frame, "cannot be rendered here: {message}");
        for task in &lease.tiles {
            self.desk.report(without_result(lease.fence, task.tile, TaskEnd::Failed, message.to_owned()));
        }
    }

    /// The server did not answer, or said no: waits before the next attempt, or gives up.
    async fn excuse(&mut self, status: &Status) -> Result<(), WorkError> {
        let text = status.message().to_owned();
        match reason(status) {
            Some(ErrorReason::BuildMismatch) => return Err(WorkError::Build(text)),
            Some(ErrorReason::WorkerBlocked | ErrorReason::TokenRefused | ErrorReason::RoleInsufficient) => {
                return Err(WorkError::Refused(text));
            }
            Some(ErrorReason::SessionSuperseded) => return Ok(()),
            _ if status.code() == Code::InvalidArgument => return Err(WorkError::Usage(text)),
            _ => {}
        }
        let (since, wait) = self.away.unwrap_or((Instant::now(), RETRY.0));
        if self.away.is_none() {
            tracing::warn!("{} does not answer: {text}; trying again", self.config.server);
        }
        if let Some(patience) = self.config.patience.filter(|p| since.elapsed() > *p) {
            return Err(WorkError::Away {
                server: self.config.server.clone(),
                waited: patience,
                cause: text,
            });
        }
        self.away = Some((since, (wait * 2).min(RETRY.1)));
        sleep(jittered(wait)).await;
        Ok(())
    }

    /// Hands back what has not begun, finishes what can be finished in time, and tells the server of both.
    async fn drain(&mut self) -> Result<(), WorkError> {
        let end = Instant::now() + self.config.grace;
        tracing::info!("ends within {:?}: hands back what is not begun", self.config.grace);
        for (fence, tile) in self.pool.take_back(None) {
            self.desk.report(without_result(fence, tile, TaskEnd::Interrupted, String::new()));
        }
        self.pool.close();
        let stop_at = end - LAST_WORDS.min(self.config.grace / 2);
        loop {
            // The server hears first, and at once, what others can do.
            if let Ok(answer) = self.exchange(WorkerState::Draining, 0, false).await {
                self.take_verdicts(answer);
            }
            if self.desk.is_empty() || Instant::now() >= end {
                break;
            }
            if Instant::now() >= stop_at {
                self.pool.stop();
            }
            let next = if Instant::now() < stop_at { stop_at } else { end };
            let until = (Instant::now() + self.heartbeat).min(next);
            while !self.desk.has_reports()
                && let Ok(Some(news)) = tokio::time::timeout_at(until, self.hears.recv()).await
            {
                match news {
                    News::Opened(lease, _) => self.hand_back(&lease),
                    News::Ended(..) => self.hear(news),
                }
            }
            if self.desk.has_reports() {
                // A server that is away is not asked in a hot loop.
                sleep(Duration::from_millis(20)).await;
            }
        }
        let left = self.desk.held().len();
        if left > 0 {
            tracing::warn!("ended with {left} leases that the server has not heard the end of: they expire");
        }
        Ok(())
    }

    fn hand_back(&mut self, lease: &Lease) {
        for task in &lease.tiles {
            let report = without_result(lease.fence, task.tile, TaskEnd::Interrupted, String::new());
            self.desk.report(report);
        }
    }

    fn take_verdicts(&mut self, mut answer: UpdateWorkerSessionResponse) {
        answer.leases.clear();
        self.desk.take(answer);
    }
}

/// The tasks of a lease, held against the frame.
fn tasks(lease: &Lease, frame: &Arc<WorkFrame>, traces: &Traces) -> Result<Vec<PoolTask>, String> {
    let grid = frame.grid;
    let mut blocks = vec![SampleRange::default(); grid.block_count() as usize];
    for task in &lease.tiles {
        fill(&mut blocks, task, &grid)?;
    }
    let round = Arc::new(Round { index: lease.round, blocks });
    let job: Arc<str> = Arc::from(lease.job.as_str());
    let task = |task: &TileTask| PoolTask {
        fence: lease.fence,
        tile: task.tile,
        frame: Arc::clone(frame),
        round: Arc::clone(&round),
        trace: traces.parent(&task.traceparent).map(|parent| (parent, Arc::clone(&job), lease.frame)),
    };
    Ok(lease.tiles.iter().map(task).collect())
}

fn fill(blocks: &mut [SampleRange], task: &TileTask, grid: &TileGrid) -> Result<(), String> {
    let (tile, tiles) = (task.tile, grid.tile_count());
    if tile >= tiles {
        return Err(format!("found tile {tile}, expected one of {tiles}"));
    }
    let of_tile: Vec<u32> = grid.tile_blocks(tile).collect();
    if task.ranges.len() != of_tile.len() * 4 {
        return Err(format!(
            "tile {tile}: found {} numbers, expected four for each of {} blocks",
            task.ranges.len(),
            of_tile.len()
        ));
    }
    for (block, r) in of_tile.into_iter().zip(task.ranges.chunks_exact(4)) {
        if r[0] > r[1] || r[2] > r[3] {
            return Err(format!("tile {tile}: a sample range ends before it begins: {r:?}"));
        }
        blocks[block as usize] = SampleRange { a: r[0]..r[1], b: r[2]..r[3] };
    }
    Ok(())
}

/// Between half and all of `wait`: workers that lost the same server do not come back all at once.
fn jittered(wait: Duration) -> Duration {
    let random = (Uuid::new_v4().as_u128() & 0xffff) as f64 / 65536.0;
    wait.mul_f64(0.5 + 0.5 * random)
}
