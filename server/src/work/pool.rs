//! Owns the threads of a worker that render. They take tasks in order and never touch the async runtime's threads.

use std::collections::VecDeque;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use karst_core::film::Round;
use karst_core::render::render_tile;
use tokio::sync::mpsc;

use crate::clock;
use crate::digest::Digest;
use crate::farm::worker::describe;
use crate::model::Time;
use crate::telemetry::traces::{Parent, Span, Traces};
use crate::work::News;
use crate::work::scenes::WorkFrame;

/// A tile to render.
#[derive(Debug)]
pub(crate) struct PoolTask {
    /// The lease it came with.
    pub fence: u64,
    /// Which tile.
    pub tile: u32,
    /// Of which frame.
    pub frame: Arc<WorkFrame>,
    /// The samples to take.
    pub round: Arc<Round>,
    /// The span of the task at the server, and whose task it is there; `None` when nobody wants to know.
    pub trace: Option<(Parent, Arc<str>, i32)>,
}

/// How a task ended.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// The result's bytes, their digest, and the seconds it took.
    Done(Vec<u8>, Digest, f64),
    /// It panicked.
    Failed(String),
    /// It was stopped.
    Stopped,
}

/// The tasks that wait, and the frames that are being rendered.
#[derive(Debug, Default)]
pub(crate) struct Pool {
    inner: Mutex<Inner>,
    changed: Condvar,
    worker: String,
    traces: Traces,
}

#[derive(Debug, Default)]
struct Inner {
    waiting: VecDeque<PoolTask>,
    running: Vec<(u64, u32, Arc<WorkFrame>)>,
    closed: bool,
}

impl Pool {
    /// No threads yet; those of `worker`, and what they do goes to `traces`.
    pub(crate) fn new(worker: &str, traces: Traces) -> Self {
        Self { worker: worker.to_owned(), traces, ..Self::default() }
    }

    /// Starts `threads` threads that tell `news` of what they finish.
    ///
    /// # Errors
    /// When the system has no more threads.
    pub(crate) fn start(
        self: &Arc<Self>,
        threads: usize,
        news: &mpsc::UnboundedSender<News>,
    ) -> io::Result<()> {
        for i in 0..threads {
            let (pool, news) = (Arc::clone(self), news.clone());
            let builder = std::thread::Builder::new().name(format!("karst-render-{i}"));
            builder.spawn(move || pool.run(&news))?;
        }
        Ok(())
    }

    /// Adds tasks.
    pub(crate) fn push(&self, tasks: impl IntoIterator<Item = PoolTask>) {
        self.lock().waiting.extend(tasks);
        self.changed.notify_all();
    }

    /// Tasks that no thread has begun.
    pub(crate) fn waiting(&self) -> usize {
        self.lock().waiting.len()
    }

    /// Drops what has not begun of a lease, or of all; says what was dropped.
    pub(crate) fn take_back(&self, fence: Option<u64>) -> Vec<(u64, u32)> {
        let mut inner = self.lock();
        let (dropped, kept) =
            inner.waiting.drain(..).partition::<VecDeque<_>, _>(|t| fence.is_none_or(|f| t.fence == f));
        inner.waiting = kept;
        dropped.iter().map(|t| (t.fence, t.tile)).collect()
    }

    /// Stops all tasks that are being rendered.
    pub(crate) fn stop(&self) {
        for (_, _, frame) in &self.lock().running {
            frame.stop.store(true, Ordering::Relaxed);
        }
    }

    /// Lets the threads end when they are done with what they do.
    pub(crate) fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "how long a tile took decides how much comes next, never a pixel"
    )]
    fn run(&self, news: &mpsc::UnboundedSender<News>) {
        while let Some(task) = self.next() {
            let (began, at) = (Instant::now(), clock::now());
            let rendered = catch_unwind(AssertUnwindSafe(|| {
                let PoolTask { frame, round, tile, .. } = &task;
                render_tile(&frame.scene, &frame.grid, *tile, round, &frame.stop)
            }));
            let mut samples = 0;
            let outcome = match rendered {
                Ok(Some(result)) => {
                    samples = result.counters.samples;
                    let bytes = result.to_bytes();
                    let digest = Digest::of(&bytes);
                    Outcome::Done(bytes, digest, began.elapsed().as_secs_f64())
                }
                Ok(None) => Outcome::Stopped,
                Err(panic) => Outcome::Failed(describe(panic.as_ref())),
            };
            self.tell(&task, &outcome, (at, samples));
            self.lock().running.retain(|(fence, tile, _)| (*fence, *tile) != (task.fence, task.tile));
            if news.send(News::Ended(task.fence, task.tile, outcome)).is_err() {
                return;
            }
        }
    }

    /// Traces what a thread did since a time.
    fn tell(&self, task: &PoolTask, outcome: &Outcome, (since, samples): (Time, u64)) {
        let Some((parent, job, frame)) = &task.trace else { return };
        let (outcome, failure) = match outcome {
            Outcome::Done(..) => ("done", None),
            Outcome::Failed(message) => ("failed", Some(message.clone())),
            Outcome::Stopped => ("stopped", None),
        };
        self.traces.send(|| {
            let place = (*frame, task.round.index, task.tile);
            let span = Span::render(job, place, *parent, (since, clock::now()));
            span.worker(&self.worker).samples(samples).ended(outcome, failure)
        });
    }

    fn next(&self) -> Option<PoolTask> {
        let mut inner = self.lock();
        loop {
            if let Some(task) = inner.waiting.pop_front() {
                inner.running.push((task.fence, task.tile, Arc::clone(&task.frame)));
                return Some(task);
            }
            if inner.closed {
                return None;
            }
            inner = self.changed.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
