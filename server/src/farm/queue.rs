//! Owns the open tasks, in the order in which they should be done: jobs by their submission, frames in order, tiles
//! row by row. Workers take the first one and sleep when there is none.
//!
//! The tasks of a frame's next round go before those of later frames, so whatever idle workers began meanwhile
//! waits again.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use karst_core::film::Round;

use crate::farm::live::LiveFrame;

/// A piece of work: one tile of one round of one frame.
#[derive(Debug, Clone)]
pub(crate) struct Task {
    /// The frame.
    pub frame: Arc<LiveFrame>,
    /// The round that is being rendered.
    pub round: Arc<Round>,
    /// Index of the tile in the frame's grid.
    pub tile: u32,
}

/// Job number, frame number, tile.
type Place = (i64, i32, u32);

/// The open tasks.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    open: Mutex<Open>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Open {
    tasks: BTreeMap<Place, Task>,
    closed: bool,
}

impl Queue {
    /// Adds tasks and wakes workers.
    pub(crate) fn push(&self, tasks: impl IntoIterator<Item = Task>) {
        let mut open = self.lock();
        open.tasks.extend(tasks.into_iter().map(|t| ((t.frame.number, t.frame.frame, t.tile), t)));
        self.changed.notify_all();
    }

    /// Takes the first task and says how many are left; waits for one, `None` when the queue was closed.
    pub(crate) fn pop(&self) -> Option<(Task, usize)> {
        let mut open = self.lock();
        loop {
            if open.closed {
                return None;
            }
            if let Some((_, task)) = open.tasks.pop_first() {
                return Some((task, open.tasks.len()));
            }
            open = self.changed.wait(open).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Number of tasks that nobody has taken.
    pub(crate) fn len(&self) -> usize {
        self.lock().tasks.len()
    }

    /// Removes the tasks of a frame.
    pub(crate) fn remove(&self, number: i64, frame: i32) {
        self.lock().tasks.retain(|place, _| (place.0, place.1) != (number, frame));
    }

    /// Sends all workers home.
    pub(crate) fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, Open> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
