//! Owns how often workers vanish whatever they do: what a loss says about a task depends on it.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use tokio::time::Instant;

use crate::farm::queue::Task;

/// How far back losses count.
pub(super) const WINDOW: Duration = Duration::from_mins(10);

/// A task by its place: job, frame, round, tile.
type Place = (Arc<str>, i32, u32, u32);

fn place(task: &Task) -> Place {
    (Arc::clone(&task.frame.job), task.frame.frame, task.round.index, task.tile)
}

/// The losses of the last minutes.
#[derive(Debug, Default)]
pub(super) struct Hazard {
    /// When a worker was given up, and what it had begun.
    losses: VecDeque<(Instant, BTreeSet<Place>)>,
}

impl Hazard {
    /// A worker has vanished that had begun these tasks.
    pub(super) fn add<'a>(&mut self, now: Instant, begun: impl Iterator<Item = &'a Task>) {
        self.losses.push_back((now, begun.map(place).collect()));
        while self.losses.front().is_some_and(|(at, _)| now.duration_since(*at) > WINDOW) {
            self.losses.pop_front();
        }
    }

    /// How many losses chance alone brings to a task that was held for `exposure`, where workers were there for
    /// `watched` altogether within the window. Losses with this very task in hand do not count: they are what is
    /// to be explained.
    pub(super) fn expected(&self, task: &Task, exposure: Duration, watched: Duration) -> f64 {
        let place = place(task);
        let others = self.losses.iter().filter(|(_, begun)| !begun.contains(&place)).count();
        others as f64 * exposure.as_secs_f64() / watched.as_secs_f64().max(exposure.as_secs_f64()).max(1.0)
    }
}
