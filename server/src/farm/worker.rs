//! Owns the threads that render. They take tasks, render, hand results to the ledger, and never touch the async
//! runtime's threads.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;

use karst_core::render::render_tile;
use tokio::sync::mpsc;

use crate::error::Error;
use crate::farm::Event;
use crate::farm::ledger::{Entry, Rendered};
use crate::farm::queue::{Queue, Task};

/// What a worker needs.
#[derive(Debug, Clone)]
pub(crate) struct Outlets {
    /// Where tasks come from.
    pub queue: Arc<Queue>,
    /// Where results go. Bounded: when the disk is slower than the workers, they wait.
    pub ledger: mpsc::Sender<Entry>,
    /// Who hears of an empty queue and of failures.
    pub farm: mpsc::UnboundedSender<Event>,
    /// Tasks that should be open so that nobody waits; the farm hears when there are fewer.
    pub low: usize,
}

/// Starts `count` worker threads; they end when the queue is closed.
///
/// # Errors
/// When the system has no more threads.
pub(crate) fn start(count: usize, outlets: &Outlets) -> Result<Vec<JoinHandle<()>>, Error> {
    let start_one = |i| {
        let outlets = outlets.clone();
        let builder = std::thread::Builder::new().name(format!("karst-render-{i}"));
        Ok(builder.spawn(move || work(&outlets))?)
    };
    (0..count).map(start_one).collect()
}

fn work(outlets: &Outlets) {
    while let Some((task, left)) = outlets.queue.pop() {
        if left < outlets.low {
            let _ = outlets.farm.send(Event::QueueLow);
        }
        let rendered = catch_unwind(AssertUnwindSafe(|| {
            let result =
                render_tile(&task.frame.scene, &task.frame.grid, task.tile, &task.round, &task.frame.stop)?;
            let bytes = result.to_bytes();
            Some((result, bytes))
        }));
        match rendered {
            Ok(Some((result, bytes))) => {
                let last = task.frame.tile_rendered();
                let entry = Entry::Rendered(Box::new(Rendered { task, result, bytes, last }));
                if outlets.ledger.blocking_send(entry).is_err() {
                    return;
                }
            }
            // Stopped: whoever stopped the frame knows.
            Ok(None) => {}
            Err(panic) => {
                let message = describe(&task, panic.as_ref());
                tracing::error!(job = %task.frame.job, frame = task.frame.frame, "{message}");
                let _ = outlets.farm.send(Event::TileFailed(task.frame, message));
            }
        }
    }
}

/// Says what went wrong and how to see it again without the service.
fn describe(task: &Task, panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("unknown panic");
    let region = task.frame.grid.tile_region(task.tile);
    format!(
        "tile {} failed in round {}: {text}; replay it with `karst render SCENE --frame {} --crop {},{},{},{}`",
        task.tile,
        task.round.index,
        task.frame.frame,
        region.x0,
        region.y0,
        region.width(),
        region.height()
    )
}
