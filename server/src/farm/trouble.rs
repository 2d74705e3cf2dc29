//! Owns what happens to tasks that did not end well: tried again, given up, judged.

use std::sync::Arc;

use tokio::task::spawn_blocking;

use crate::clock;
use crate::farm::Farm;
use crate::farm::dispute::judge;
use crate::farm::ledger::{Entry, Rows};
use crate::farm::live::LiveFrame;
use crate::farm::queue::Task;
use crate::job::Event as JobEvent;
use crate::model::{Cause, Failure};
use crate::past::Trouble;
use crate::state::Row;
use crate::telemetry::counts::Outcome;
use crate::telemetry::traces::Taken;

impl Farm {
    /// Tasks of workers did not end well: counts it, and tries them again or gives up their frames.
    pub(super) async fn troubles(&mut self, troubles: Vec<(String, Task, Trouble)>) {
        let mut rows = Vec::new();
        for (worker, mut task, trouble) in troubles {
            task.ended(&self.shared.telemetry, &worker, outcome(&trouble), 0);
            task.taken = Taken::default();
            if !task.is_open() {
                continue;
            }
            task.past.add(&worker, &trouble);
            let (frame, round, tile) = (Arc::clone(&task.frame), task.round.index, task.tile);
            tracing::warn!(job = %frame.job, frame = frame.frame, round, tile, worker, "a task came back: {trouble:?}");
            if let Some(reason) = task.past.given_up(self.queue.workers()) {
                self.shared.telemetry.counts.quarantined.inc();
                let failure = Failure::new(Cause::Quarantine, quarantined(&task, &reason, &trouble));
                self.fail(frame.number, frame.frame, failure).await;
                continue;
            }
            rows.push(Row::Past(frame.job.to_string(), frame.frame, round, tile, task.past.clone()));
            self.queue.push([task]);
        }
        if rows.is_empty() {
            return;
        }
        let rows = Rows { changes: rows, film: None, given_up: Vec::new(), then: Box::new(|| {}) };
        if self.ledger.send(Entry::Rows(Box::new(rows))).await.is_err() {
            tracing::error!("the ledger has ended before the farm");
        }
    }

    /// Workers disagree about a task: renders it here.
    pub(super) fn disputed(&self, task: Task) {
        let ledger = self.ledger.clone();
        spawn_blocking(move || judge(task, &ledger));
    }

    /// A dispute has ended: whoever was wrong gets no work, and the round may go on.
    pub(super) async fn settled(&mut self, frame: Arc<LiveFrame>, wrong: Vec<String>) {
        for worker in wrong {
            let reason = format!("its result for job {} frame {} was wrong", frame.job, frame.frame);
            tracing::error!(worker, "blocked: {reason}");
            let back = self.shared.fleet.block(&worker, &reason);
            let troubles = back.into_iter().map(|task| (worker.clone(), task, Trouble::Interrupted));
            self.troubles(troubles.collect()).await;
        }
        if self.jobs.is_complete(&frame) {
            self.plan(frame);
        }
    }

    /// Nobody can tell which result of a task is right.
    pub(super) async fn hopeless(&mut self, frame: &LiveFrame, message: String) {
        let failure = Failure::new(Cause::Disputed, message);
        let event = JobEvent::FrameFailed(frame.frame, failure, clock::now());
        self.step(frame.number, vec![event], None, None).await;
    }
}

fn outcome(trouble: &Trouble) -> Outcome {
    match trouble {
        Trouble::Failed(_) => Outcome::Failed,
        Trouble::Lost { .. } => Outcome::Lost,
        Trouble::Interrupted => Outcome::Interrupted,
    }
}

/// Says what went wrong and how to see it again without the service.
fn quarantined(task: &Task, reason: &str, last: &Trouble) -> String {
    let region = task.frame.grid.tile_region(task.tile);
    let last = match last {
        Trouble::Failed(message) => format!(", the last time with: {message}"),
        Trouble::Lost { .. } | Trouble::Interrupted => String::new(),
    };
    format!(
        "tile {} of round {} is not tried again: {reason}{last}; \
         replay it with `karst render SCENE --frame {} --crop {},{},{},{}`",
        task.tile,
        task.round.index,
        task.frame.frame,
        region.x0,
        region.y0,
        region.width(),
        region.height()
    )
}
