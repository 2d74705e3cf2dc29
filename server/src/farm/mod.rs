//! Owns the live jobs and who renders what: one loop over one closed set of events.
//!
//! Jobs go in the order of their submission, frames in order. A round of a frame begins when all results of the
//! round before are durable and merged; while a frame waits for its last results, idle workers go on with the next
//! frame. Nothing here blocks: scenes are built, rounds planned and files made on blocking threads, and everything
//! that must survive goes through the ledger.

pub mod feed;
mod finish;
mod jobs;
pub(crate) mod ledger;
pub mod live;
pub(crate) mod prepare;
mod progress;
pub(crate) mod queue;
pub(crate) mod worker;

use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{FrameSummary, Round};
use karst_core::render::next_round;
use karst_core::scene::Limits;
use prost::bytes::Bytes;
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::task::spawn_blocking;
use tokio_util::sync::CancellationToken;

use crate::blobs::Blobs;
use crate::clock;
use crate::error::Error;
use crate::farm::feed::Feeds;
use crate::farm::finish::{Finished, finish};
use crate::farm::jobs::{LiveJob, Rendering, Stage};
use crate::farm::ledger::{Entry, NewFilm, Rows};
use crate::farm::live::{Live, LiveFrame};
use crate::farm::prepare::{Context, Opened};
use crate::farm::queue::{Queue, Task};
use crate::job::{Effect, Event as JobEvent};
use crate::model::{Cause, Failure, FrameState, Job, RoundReport, Statistics};
use crate::preview::Hub;
use crate::state::{Row, State, StoredJob};

/// Frames that are rendered, finished or made ready at the same time: bounds the memory for films and scenes.
const MAX_LIVE_FRAMES: usize = 4;
/// How often progress is told.
const PROGRESS: Duration = Duration::from_millis(500);

/// What the farm and the services share.
#[derive(Debug)]
pub(crate) struct Shared {
    pub state: State,
    pub blobs: Blobs,
    pub limits: Limits,
    pub live: Live,
    pub hub: Arc<Hub>,
    pub feeds: Feeds,
    /// The server is ending.
    pub ending: CancellationToken,
}

/// What the farm reacts to.
#[derive(Debug)]
pub(crate) enum Event {
    /// A job is stored; its context when it was just checked.
    Submitted(Box<StoredJob>, Option<Box<Checked>>),
    /// Somebody wants no more of a job; answered when that is durable.
    Cancel(String, oneshot::Sender<Result<Job, Error>>),
    /// A frame is ready, or cannot be rendered.
    Opened(i64, i32, Box<Result<(Arc<Context>, Opened), Error>>),
    /// There are fewer tasks than workers.
    QueueLow,
    /// Results are durable and merged.
    Accepted(Arc<LiveFrame>, u32),
    /// A tile cannot be rendered.
    TileFailed(Arc<LiveFrame>, String),
    /// A round was evaluated.
    Planned(Arc<LiveFrame>, Box<Plan>),
    /// A frame's files are stored, or cannot be made.
    Finished(Arc<LiveFrame>, Result<Finished, Error>),
}

/// A job's scene as it was checked when it was submitted.
#[derive(Debug)]
pub(crate) struct Checked {
    /// Document and assets.
    pub context: Arc<Context>,
    /// The scene of the first frame.
    pub first: Arc<karst_core::scene::Scene>,
}

/// What follows from a finished round.
#[derive(Debug)]
pub(crate) struct Plan {
    summary: FrameSummary,
    next: Option<Round>,
    film: Bytes,
}

/// The loop.
pub(crate) struct Farm {
    shared: Arc<Shared>,
    queue: Arc<Queue>,
    ledger: mpsc::Sender<Entry>,
    events: mpsc::UnboundedSender<Event>,
    /// Tasks that should be open so that no worker waits.
    low: usize,
    jobs: jobs::LiveJobs,
    /// One frame is denoised and encoded at a time; it uses all processors.
    finishing: Arc<Semaphore>,
}

impl Farm {
    /// A farm without jobs.
    pub(crate) fn new(
        shared: Arc<Shared>,
        queue: Arc<Queue>,
        ledger: mpsc::Sender<Entry>,
        events: mpsc::UnboundedSender<Event>,
        low: usize,
    ) -> Self {
        let finishing = Arc::new(Semaphore::new(1));
        Self { shared, queue, ledger, events, low, jobs: jobs::LiveJobs::default(), finishing }
    }

    /// Reacts to events until the server ends.
    pub(crate) async fn run(mut self, mut events: mpsc::UnboundedReceiver<Event>) {
        let ending = self.shared.ending.clone();
        let mut ticks = tokio::time::interval(PROGRESS);
        loop {
            tokio::select! {
                event = events.recv() => match event {
                    Some(event) => self.react(event).await,
                    None => break,
                },
                _ = ticks.tick() => self.tell_progress(),
                () = ending.cancelled() => break,
            }
            self.fill().await;
        }
        for frame in self.jobs.frames() {
            frame.stop.store(true, std::sync::atomic::Ordering::Relaxed);
        }
        self.queue.close();
    }

    async fn react(&mut self, event: Event) {
        match event {
            Event::Submitted(job, checked) => self.submitted(*job, checked.map(|c| *c)),
            Event::Cancel(job, answer) => self.cancel(&job, answer).await,
            Event::Opened(number, frame, opened) => match *opened {
                Ok((context, opened)) => self.jobs.opened(number, frame, context, opened),
                Err(e) => self.fail(number, frame, failure(&e)).await,
            },
            Event::QueueLow => {}
            Event::Accepted(frame, tiles) => {
                if self.jobs.accepted(&frame, tiles) {
                    self.plan(frame);
                }
            }
            Event::TileFailed(frame, message) => {
                self.fail(frame.number, frame.frame, Failure::new(Cause::Internal, message)).await;
            }
            Event::Planned(frame, plan) => self.planned(frame, *plan).await,
            Event::Finished(frame, Ok((files, failure))) => {
                let event = JobEvent::FrameFinished(frame.frame, files, failure, clock::now());
                self.step(frame.number, vec![event], None, None).await;
            }
            Event::Finished(frame, Err(e)) => self.fail(frame.number, frame.frame, failure(&e)).await,
        }
    }

    fn submitted(&mut self, job: StoredJob, checked: Option<Checked>) {
        self.shared.feeds.open(&job.run.job.id, job.run.job.revision);
        // What was checked stays in memory only for the job that is rendered next.
        let checked = checked.filter(|_| self.jobs.is_empty());
        self.jobs.insert(LiveJob::new(job, checked));
    }

    async fn cancel(&mut self, id: &str, answer: oneshot::Sender<Result<Job, Error>>) {
        match self.jobs.number_of(id) {
            Some(number) => {
                self.step(number, vec![JobEvent::Cancelled(clock::now())], None, Some(answer)).await
            }
            None => {
                let _ =
                    answer.send(Err(Error::JobState(format!("job {id} has ended before it was cancelled"))));
            }
        }
    }

    async fn fail(&mut self, number: i64, frame: i32, failure: Failure) {
        tracing::error!(frame, "{}", failure.message);
        self.step(number, vec![JobEvent::FrameFailed(frame, failure, clock::now())], None, None).await;
    }

    /// Takes events of a job, hands what they change to the ledger, and tells watchers when it is durable.
    async fn step(
        &mut self,
        number: i64,
        events: Vec<JobEvent>,
        film: Option<NewFilm>,
        answer: Option<oneshot::Sender<Result<Job, Error>>>,
    ) {
        let Some(job) = self.jobs.get_mut(number) else { return };
        let mut effects = Vec::new();
        for event in events {
            match job.run.step(event) {
                Ok(more) => effects.extend(more),
                // A frame may be cancelled while its last event is under way.
                Err(illegal) => tracing::debug!("{illegal}"),
            }
        }
        if effects.is_empty() {
            return;
        }
        let id = job.run.job.id.clone();
        let mut rows = Vec::with_capacity(effects.len() + 1);
        let mut given_up = Vec::new();
        for effect in effects {
            match effect {
                Effect::Record(revision, record) => rows.push(Row::Record(id.clone(), revision, record)),
                Effect::SaveFrame(frame) => {
                    rows.extend(
                        job.run.frames.get(&frame).map(|f| Row::Frame(id.clone(), Box::new(f.clone()))),
                    );
                }
                Effect::Stop(frame) => {
                    rows.push(Row::ForgetPacks(id.clone(), frame));
                    given_up.extend(job.stop(frame));
                    self.queue.remove(number, frame);
                }
            }
        }
        let now = job.run.job.clone();
        rows.push(Row::Job(Box::new(now.clone())));
        let ended: Vec<i32> =
            job.run.frames.values().filter(|f| f.state.is_final()).map(|f| f.frame).collect();
        job.stages.retain(|frame, _| !ended.contains(frame));
        if now.state.is_final() {
            self.jobs.remove(number);
        }
        let shared = Arc::clone(&self.shared);
        let then = Box::new(move || tell(&shared, now, &ended, answer));
        let entry = Entry::Rows(Box::new(Rows { rows, film, given_up, then }));
        if self.ledger.send(entry).await.is_err() {
            tracing::error!("the ledger has ended before the farm");
        }
    }

    /// Keeps the workers busy: begins frames that are ready, and makes the next one ready.
    async fn fill(&mut self) {
        while self.queue.len() < self.low
            && let Some((number, frame)) = self.jobs.first_ready()
        {
            self.begin(number, frame).await;
        }
        if self.jobs.live_frames() < MAX_LIVE_FRAMES
            && let Some((job, frame)) = self.jobs.next_to_open()
        {
            let (shared, events) = (Arc::clone(&self.shared), self.events.clone());
            let (number, id) = (job.number, Arc::clone(&job.id));
            let (context, scene) = (job.context.clone(), job.take_first(frame));
            let spec = job.run.job.spec.clone();
            tokio::spawn(async move {
                let opened = open(&shared, (number, id, frame), (context, scene), spec).await;
                let _ = events.send(Event::Opened(number, frame, Box::new(opened)));
            });
        }
    }

    /// Begins a frame that is ready, or goes on with it.
    async fn begin(&mut self, number: i64, frame: i32) {
        let Some((live, state, opened_round)) = self.jobs.begin(number, frame) else { return };
        self.shared.live.insert(Arc::clone(&live));
        let tiles: Vec<u32> = (0..live.grid.tile_count()).collect();
        self.shared.hub.publish(&live.job, frame, &tiles);
        let mut events = Vec::new();
        if state == FrameState::Pending {
            events.push(JobEvent::FrameBegan(frame, clock::now()));
        }
        if opened_round.is_none() && state != FrameState::Finishing {
            events.push(JobEvent::FrameRendered(frame));
        }
        self.step(number, events, None, None).await;
        match opened_round {
            Some(round) => self.begin_round(live, round),
            None => self.finish(live),
        }
    }

    /// Opens the tasks of a round that are not merged already.
    fn begin_round(&mut self, frame: Arc<LiveFrame>, round: Arc<Round>) {
        let merged: Vec<u32> = frame.merged().rounds.clone();
        let open: Vec<u32> = (0..frame.grid.tile_count())
            .filter(|&tile| merged[tile as usize] <= round.index && !round.tile_is_empty(&frame.grid, tile))
            .collect();
        frame.begin_round(open.len() as u32);
        self.jobs.begin_round(&frame, &round, open.len() as u32);
        if open.is_empty() {
            self.plan(frame);
            return;
        }
        self.queue.push(open.into_iter().map(|tile| Task {
            frame: Arc::clone(&frame),
            round: Arc::clone(&round),
            tile,
        }));
    }

    /// All results of a round are merged: evaluates it.
    fn plan(&self, frame: Arc<LiveFrame>) {
        let Some(done) = self.jobs.round_of(&frame).map(|round| round + 1) else { return };
        let events = self.events.clone();
        spawn_blocking(move || {
            let plan = {
                let merged = frame.merged();
                Plan {
                    summary: merged.film.summary(),
                    next: next_round(frame.scene.sampling(), &frame.grid, &merged.film, done),
                    film: merged.film.to_bytes().into(),
                }
            };
            let _ = events.send(Event::Planned(frame, Box::new(plan)));
        });
    }

    async fn planned(&mut self, frame: Arc<LiveFrame>, plan: Plan) {
        let Some(Rendering { round, seconds, .. }) = self.jobs.finish_round(&frame, &plan.summary) else {
            return;
        };
        let out_of_time = frame.scene.sampling().time_limit.is_some_and(|limit| seconds >= limit);
        let next = plan.next.filter(|_| !out_of_time);
        let report = report(round, seconds, &plan.summary);
        let mut events = vec![JobEvent::RoundFinished(frame.frame, report)];
        if next.is_none() {
            events.push(JobEvent::FrameRendered(frame.frame));
        }
        let film = NewFilm { frame: Arc::clone(&frame), rounds: round + 1, bytes: plan.film };
        self.step(frame.number, events, Some(film), None).await;
        match next {
            Some(next) => self.begin_round(frame, Arc::new(next)),
            None => self.finish(frame),
        }
    }

    fn finish(&mut self, frame: Arc<LiveFrame>) {
        frame.merged().complete = true;
        let tiles: Vec<u32> = (0..frame.grid.tile_count()).collect();
        self.shared.hub.publish(&frame.job, frame.frame, &tiles);
        let Some(job) = self.jobs.get_mut(frame.number) else { return };
        job.stages.insert(frame.frame, Stage::Finishing(Arc::clone(&frame)));
        let denoise = job.run.job.spec.denoise;
        let (blobs, events) = (self.shared.blobs.clone(), self.events.clone());
        let finishing = Arc::clone(&self.finishing);
        tokio::spawn(async move {
            let _turn = finishing.acquire().await;
            let finished = finish(Arc::clone(&frame), denoise, &blobs).await;
            let _ = events.send(Event::Finished(frame, finished));
        });
    }

    fn tell_progress(&mut self) {
        for (job, progress) in self.jobs.progress(PROGRESS) {
            if let Some(feed) = self.shared.feeds.get(&job) {
                feed.progress.send_replace(progress);
            }
        }
    }
}

/// A change of a job is durable: frames that have ended leave memory, watchers hear of it.
fn tell(shared: &Shared, job: Job, ended: &[i32], answer: Option<oneshot::Sender<Result<Job, Error>>>) {
    for frame in ended {
        shared.live.remove(&job.id, *frame);
    }
    if let Some(feed) = shared.feeds.get(&job.id) {
        feed.revision.send_replace(job.revision);
    }
    if job.state.is_final() {
        shared.feeds.close(&job.id);
        shared.hub.end(&job.id);
    }
    if let Some(answer) = answer {
        let _ = answer.send(Ok(job));
    }
}

async fn open(
    shared: &Shared,
    place: (i64, Arc<str>, i32),
    known: (Option<Arc<Context>>, Option<Arc<karst_core::scene::Scene>>),
    spec: crate::spec::JobSpec,
) -> Result<(Arc<Context>, Opened), Error> {
    let (context, scene) = known;
    let tile_size = spec.tile_size;
    let context = match context {
        Some(context) => context,
        None => Arc::new(prepare::load(&shared.blobs, &shared.limits, spec).await?),
    };
    let scene = match scene {
        Some(scene) => scene,
        None => {
            let (context, limits, frame) = (Arc::clone(&context), shared.limits.clone(), place.2);
            Arc::new(spawn_blocking(move || prepare::build(&context, &limits, frame)).await??)
        }
    };
    let opened = prepare::open(place, scene, tile_size, (&shared.state, &shared.blobs)).await?;
    Ok((context, opened))
}

fn report(round: u32, seconds: f64, summary: &FrameSummary) -> RoundReport {
    let counters = summary.counters;
    RoundReport {
        round,
        spp: summary.spp_mean,
        rel_mse: summary.rel_mse,
        rel_mse_ci95: summary.rel_mse_ci95,
        seconds,
        statistics: Statistics {
            samples: summary.samples,
            rays: counters.rays,
            shadow_rays: counters.shadow_rays,
            nonfinite: counters.nan_samples + counters.infinite_samples,
            exhausted: counters.exhausted_rays,
        },
    }
}

fn failure(error: &Error) -> Failure {
    let cause = match error {
        Error::Scene(..) | Error::Fields(_) | Error::Limit(_) => Cause::Scene,
        Error::Gone(_) | Error::Corrupt(_) => Cause::Corrupt,
        Error::Denoiser(_) => Cause::Denoiser,
        _ => Cause::Internal,
    };
    Failure::new(cause, error.to_string())
}
