//! Owns the live jobs and who renders what: one loop over one closed set of events.
//!
//! Jobs go in the order of their submission, frames in order. A round of a frame begins when all results of the
//! round before are durable and merged; while a frame waits for its last results, idle workers go on with the next
//! frame. Nothing here blocks: scenes are built, rounds planned and files made on blocking threads, and everything
//! that must survive goes through the ledger.

mod batch;
mod denoised;
mod dispute;
pub mod feed;
mod finish;
pub(crate) mod fleet;
mod jobs;
pub(crate) mod ledger;
pub mod live;
pub(crate) mod prepare;
mod progress;
pub(crate) mod queue;
mod rounds;
mod spans;
mod trouble;
pub(crate) mod worker;

use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{FrameSummary, Round};
use karst_core::scene::Limits;
use prost::bytes::Bytes;
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use crate::blobs::Blobs;
use crate::clock;
use crate::error::Error;
use crate::farm::feed::Feeds;
use crate::farm::fleet::Fleet;
use crate::farm::jobs::LiveJob;
use crate::farm::ledger::{Entry, NewFilm, Rows};
use crate::farm::live::{Live, LiveFrame};
use crate::farm::prepare::{Context, Opened};
use crate::farm::queue::{Queue, Task};
use crate::films::Films;
use crate::job::{Effect, Event as JobEvent};
use crate::model::{Cause, Failure, Finished, Job};
use crate::past::Trouble;
use crate::preview::Hub;
use crate::state::{Row, State, StoredJob};
use crate::telemetry::Telemetry;

/// How often progress is told.
const PROGRESS: Duration = Duration::from_millis(500);

/// What the farm and the services share.
#[derive(Debug)]
pub(crate) struct Shared {
    pub state: State,
    pub blobs: Blobs,
    pub films: Films,
    pub limits: Limits,
    pub live: Live,
    pub hub: Arc<Hub>,
    pub feeds: Feeds,
    pub fleet: Fleet,
    pub telemetry: Arc<Telemetry>,
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
    /// A result cannot be merged.
    TileFailed(Arc<LiveFrame>, String),
    /// A worker could not finish a task.
    Trouble(String, Box<Task>, Trouble),
    /// Workers disagree about a task.
    Disputed(Box<Task>),
    /// A dispute has ended; these workers were wrong.
    Settled(Arc<LiveFrame>, Vec<String>),
    /// A dispute cannot be decided.
    Hopeless(Arc<LiveFrame>, String),
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
    /// The round that has ended.
    round: u32,
    /// The version of the film.
    version: u32,
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
    ) -> Self {
        let finishing = Arc::new(Semaphore::new(1));
        Self { shared, queue, ledger, events, jobs: jobs::LiveJobs::default(), finishing }
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
                _ = ticks.tick() => {
                    self.tell_progress();
                    let lost = self.shared.fleet.sweep();
                    self.troubles(lost).await;
                }
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
            Event::Trouble(worker, task, trouble) => self.troubles(vec![(worker, *task, trouble)]).await,
            Event::Disputed(task) => self.disputed(*task),
            Event::Settled(frame, wrong) => self.settled(frame, wrong).await,
            Event::Hopeless(frame, message) => self.hopeless(&frame, message).await,
            Event::Planned(frame, plan) => self.planned(frame, *plan).await,
            Event::Finished(frame, Ok(finished)) => {
                let event = JobEvent::FrameFinished(frame.frame, finished, clock::now());
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
                self.step(number, vec![JobEvent::Cancelled(clock::now())], None, Some(answer)).await;
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
                    rows.push(Row::Forget(id.clone(), frame));
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
        let spans = spans::of_ended(job, &self.shared.telemetry.traces);
        if now.state.is_final() {
            self.jobs.remove(number);
        }
        let shared = Arc::clone(&self.shared);
        let then = Box::new(move || {
            tell(&shared, now, &ended, answer);
            for span in spans {
                shared.telemetry.traces.send(|| span);
            }
        });
        let entry = Entry::Rows(Box::new(Rows { changes: rows, film, given_up, then }));
        if self.ledger.send(entry).await.is_err() {
            tracing::error!("the ledger has ended before the farm");
        }
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
    shared.feeds.tell(&job.id, job.revision);
    shared.hub.end_frames(&job.id, ended);
    if job.state.is_final() {
        shared.feeds.close(&job.id);
        shared.hub.end(&job.id);
    }
    if let Some(answer) = answer {
        let _ = answer.send(Ok(job));
    }
}

fn failure(error: &Error) -> Failure {
    let cause = if matches!(error, Error::Scene(..) | Error::Fields(_) | Error::Limit(_)) {
        Cause::Scene
    } else if matches!(error, Error::Gone(_) | Error::Corrupt(_)) {
        Cause::Corrupt
    } else {
        Cause::Internal
    };
    Failure::new(cause, error.to_string())
}
