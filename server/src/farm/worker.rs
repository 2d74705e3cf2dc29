//! Owns the threads that render. They take tasks, render, hand results to the ledger, and never touch the async
//! runtime's threads.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use karst_core::film::TileResult;
use karst_core::render::render_tile;
use tokio::sync::mpsc;

use crate::clock;
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::Event;
use crate::farm::ledger::{Entry, Rendered};
use crate::farm::live::Vote;
use crate::farm::queue::{Popped, Queue, SERVER, Task};
use crate::past::Trouble;
use crate::telemetry::Telemetry;
use crate::telemetry::counts::Outcome;
use crate::telemetry::traces::{Span, Taken};

/// Ways to the parts of the farm.
#[derive(Debug, Clone)]
pub(crate) struct Outlets {
    /// Where tasks come from.
    pub queue: Arc<Queue>,
    /// Where results go. Bounded: when the disk is slower than the workers, they wait. Weak: the ledger ends when
    /// the farm and the threads here have ended, whatever calls are still open.
    pub ledger: mpsc::WeakSender<Entry>,
    /// Who hears of an empty queue and of failures.
    pub farm: mpsc::UnboundedSender<Event>,
    /// Who counts.
    pub telemetry: Arc<Telemetry>,
}

/// How long a thread waits for a task before it looks for other things to do.
const PATIENCE: Duration = Duration::from_mins(1);

/// Starts `count` worker threads; they end when the queue is closed.
///
/// # Errors
/// When the system has no more threads.
pub(crate) fn start(
    count: usize,
    outlets: &Outlets,
    ledger: &mpsc::Sender<Entry>,
) -> Result<Vec<JoinHandle<()>>, Error> {
    let start_one = |i| {
        let (outlets, ledger) = (outlets.clone(), ledger.clone());
        let builder = std::thread::Builder::new().name(format!("karst-render-{i}"));
        Ok(builder.spawn(move || work(&outlets, &ledger))?)
    };
    (0..count).map(start_one).collect()
}

fn work(outlets: &Outlets, ledger: &mpsc::Sender<Entry>) {
    loop {
        let mut task = match outlets.queue.pop(SERVER, PATIENCE) {
            Popped::Task(task) => *task,
            Popped::Nothing => continue,
            Popped::Closed => return,
        };
        if outlets.queue.is_low() {
            let _ = outlets.farm.send(Event::QueueLow);
        }
        task.taken = Taken::here(clock::now());
        let rendered = render(&task);
        tell(&task, &rendered, &outlets.telemetry);
        match rendered {
            Ok(Some(result)) => {
                let bytes = result.to_bytes();
                let vote = Vote { worker: SERVER.to_owned(), digest: Digest::of(&bytes) };
                let last = task.frame.tile_rendered(task.tile);
                let rendered = Rendered { task, result, bytes, vote, last, ack: None };
                if ledger.blocking_send(Entry::Rendered(Box::new(rendered))).is_err() {
                    return;
                }
            }
            // Stopped: whoever stopped the frame knows.
            Ok(None) => task.traced(&outlets.telemetry, SERVER, Outcome::Interrupted, 0),
            Err(message) => {
                let trouble = Trouble::Failed(message);
                let _ = outlets.farm.send(Event::Trouble(SERVER.to_owned(), Box::new(task), trouble));
            }
        }
    }
}

fn render(task: &Task) -> Result<Option<TileResult>, String> {
    let (scene, grid) = (&task.frame.scene, &task.frame.grid);
    catch_unwind(AssertUnwindSafe(|| render_tile(scene, grid, task.tile, &task.round, &task.frame.stop)))
        .map_err(|panic| describe(panic.as_ref()))
}

/// Counts and traces what a thread did for a task.
fn tell(task: &Task, rendered: &Result<Option<TileResult>, String>, telemetry: &Telemetry) {
    let period = (task.taken.at, clock::now());
    let (samples, outcome, failure) = match rendered {
        Ok(Some(result)) => (result.counters.samples, "done", None),
        Ok(None) => (0, "stopped", None),
        Err(message) => (0, "failed", Some(message.clone())),
    };
    telemetry.counts.add_seconds((period.1 - period.0) as f64 * 1e-6);
    telemetry.traces.send(|| {
        let place = (task.frame.frame, task.round.index, task.tile);
        let span = Span::render_here(&task.frame.job, place, task.taken, period);
        span.worker(SERVER).samples(samples).ended(outcome, failure)
    });
}

/// What a panic says.
pub(crate) fn describe(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("unknown panic").to_owned()
}
