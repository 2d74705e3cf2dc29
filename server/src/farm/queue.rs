//! Owns the open tasks, in the order in which they should be done: jobs by their submission, frames in order, tiles
//! row by row. Workers take the first ones and wait when there are none.
//!
//! The tasks of a frame's next round go before those of later frames, so whatever idle workers began meanwhile
//! waits again.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use karst_core::film::Round;
use tokio::sync::Notify;

use crate::farm::live::LiveFrame;
use crate::past::Past;
use crate::telemetry::traces::Taken;

/// What the worker inside the server is called where workers have names.
pub(crate) const SERVER: &str = "server";

/// A piece of work: one tile of one round of one frame.
#[derive(Debug, Clone)]
pub(crate) struct Task {
    /// The frame.
    pub frame: Arc<LiveFrame>,
    /// The round that is being rendered.
    pub round: Arc<Round>,
    /// Index of the tile in the frame's grid.
    pub tile: u32,
    /// What has gone wrong with it so far.
    pub past: Past,
    /// Who has it, for the trace.
    pub taken: Taken,
}

impl Task {
    /// Somebody still needs its result.
    pub(crate) fn is_open(&self) -> bool {
        !self.frame.is_stopped() && self.frame.is_open(self.round.index, self.tile)
    }

    /// Its result can still be held against others: the round has not ended.
    pub(crate) fn is_current(&self) -> bool {
        !self.frame.is_stopped() && self.frame.merged().round == self.round.index
    }

    /// The same piece of work.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.place() == other.place() && self.round.index == other.round.index
    }

    fn place(&self) -> Place {
        (self.frame.number, self.frame.frame, self.tile)
    }
}

/// Job number, frame number, tile.
type Place = (i64, i32, u32);

/// The open tasks.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    open: Mutex<Open>,
    /// Wakes threads.
    changed: Condvar,
    /// Wakes calls that wait for work.
    news: Notify,
}

#[derive(Debug, Default)]
struct Open {
    tasks: BTreeMap<Place, Task>,
    /// Worker processes that can take tasks, this one included if it renders.
    workers: usize,
    /// Tasks that should be open so that nobody waits.
    low: usize,
    closed: bool,
}

/// What a thread got.
#[derive(Debug)]
pub(crate) enum Popped {
    /// A task.
    Task(Box<Task>),
    /// Nothing came in the time.
    Nothing,
    /// The queue was closed.
    Closed,
}

impl Queue {
    /// Adds tasks and wakes workers.
    pub(crate) fn push(&self, tasks: impl IntoIterator<Item = Task>) {
        let mut open = self.lock();
        open.tasks.extend(tasks.into_iter().map(|t| (t.place(), t)));
        self.changed.notify_all();
        self.news.notify_waiters();
    }

    /// Takes the first task that `worker` may have; waits for one up to `patience`.
    pub(crate) fn pop(&self, worker: &str, patience: Duration) -> Popped {
        let mut open = self.lock();
        loop {
            if open.closed {
                return Popped::Closed;
            }
            if let Some(task) = open.take_first(worker) {
                return Popped::Task(Box::new(task));
            }
            let (again, waited) =
                self.changed.wait_timeout(open, patience).unwrap_or_else(PoisonError::into_inner);
            open = again;
            if waited.timed_out() && !open.tasks.values().any(|t| open.may(worker, t)) {
                return Popped::Nothing;
            }
        }
    }

    /// Takes tasks of one round for `worker`: the first, and those after it while `more` says so.
    pub(crate) fn take(&self, worker: &str, mut more: impl FnMut(&Task) -> bool) -> Vec<Task> {
        let mut open = self.lock();
        let Some(first) = open.tasks.values().find(|t| open.may(worker, t)) else { return Vec::new() };
        let (number, frame) = (first.frame.number, first.frame.frame);
        let mut places = Vec::new();
        for (place, task) in open.tasks.range(first.place()..) {
            let alone = task.past.is_suspect();
            if (place.0, place.1) != (number, frame) || (alone && !places.is_empty()) {
                break;
            }
            if !open.may(worker, task) {
                continue;
            }
            if !more(task) && !places.is_empty() {
                break;
            }
            places.push(*place);
            if alone {
                break;
            }
        }
        places.iter().filter_map(|place| open.tasks.remove(place)).collect()
    }

    /// Takes the task with this tile of a round, if it is open.
    pub(crate) fn take_tile(&self, frame: &LiveFrame, round: u32, tile: u32) -> Option<Task> {
        let mut open = self.lock();
        let place = (frame.number, frame.frame, tile);
        if open.tasks.get(&place)?.round.index == round { open.tasks.remove(&place) } else { None }
    }

    /// Resolves when tasks were added after the call.
    pub(crate) fn news(&self) -> tokio::sync::futures::Notified<'_> {
        self.news.notified()
    }

    /// Number of tasks that nobody has taken.
    pub(crate) fn len(&self) -> usize {
        self.lock().tasks.len()
    }

    /// Nobody has to do anything.
    #[cfg(test)]
    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// There are too few open tasks to keep everybody busy.
    pub(crate) fn is_low(&self) -> bool {
        let open = self.lock();
        open.tasks.len() < open.low
    }

    /// Sets how many worker processes there are, and how many open tasks keep them busy.
    pub(crate) fn set_demand(&self, workers: usize, low: usize) {
        let mut open = self.lock();
        (open.workers, open.low) = (workers, low);
    }

    /// Worker processes that can take tasks.
    pub(crate) fn workers(&self) -> usize {
        self.lock().workers
    }

    /// Removes the tasks of a frame.
    pub(crate) fn remove(&self, number: i64, frame: i32) {
        self.lock().tasks.retain(|place, _| (place.0, place.1) != (number, frame));
    }

    /// Sends all workers home.
    pub(crate) fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
        self.news.notify_waiters();
    }

    fn lock(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Open {
    fn may(&self, worker: &str, task: &Task) -> bool {
        !task.past.avoids(worker, self.workers)
    }

    fn take_first(&mut self, worker: &str) -> Option<Task> {
        let place = self.tasks.values().find(|t| self.may(worker, t))?.place();
        self.tasks.remove(&place)
    }
}
