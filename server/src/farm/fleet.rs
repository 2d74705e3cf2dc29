//! Owns the worker processes and what they hold: who is there, which leases are out, what they come to in time.
//!
//! A lease is stored before its worker hears of it, so that after a crash of the server a result can still be told
//! from one that nobody asked for. Everything else here is in memory: after a crash all open tasks are open again,
//! and a worker that comes back with its leases takes their tasks out of the queue again.

mod hazard;
mod roster;

pub(crate) use roster::WorkerStanding;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::time::Instant;

use crate::clock;
use crate::farm::batch::{Pace, batch};
use crate::farm::fleet::hazard::{Hazard, WINDOW};
use crate::farm::live::Live;
use crate::farm::queue::{Queue, Task};
use crate::past::{Past, Trouble};
use crate::state::StoredLease;
use crate::telemetry::Telemetry;
use crate::telemetry::counts::Outcome;
use crate::telemetry::traces::Taken;

/// A task of which nothing was heard for this many times its expected duration gets a copy elsewhere, when somebody
/// has nothing else to do.
const SLOW: f64 = 3.0;
/// No copies of tasks that are younger than this part of the time to live.
const YOUNG: u32 = 15;
/// Workers that were not heard of for so long are forgotten.
const FORGET: Duration = Duration::from_hours(1);

/// A worker as it presents itself.
#[derive(Debug, Clone)]
pub(crate) struct Caller {
    /// Chosen by the process.
    pub worker: String,
    /// For people.
    pub display_name: String,
    /// Threads that render.
    pub threads: u32,
    /// It was told to end.
    pub draining: bool,
    /// Number of the request.
    pub sequence: u64,
    /// Leases it has tasks of.
    pub held: BTreeSet<u64>,
}

/// Why a worker is not served.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// A newer request was answered already.
    Superseded,
    /// Its results were wrong.
    Blocked(String),
}

/// What a worker should know of its leases.
#[derive(Debug, Default)]
pub(crate) struct Standing {
    /// Leases that it should hold and did not list.
    pub missing: Vec<Lease>,
    /// Leases that it listed and may drop.
    pub revoked: Vec<u64>,
    /// Tasks that it handed back.
    pub returned: Vec<Task>,
}

/// Tasks of one round of one frame that a worker holds.
#[derive(Debug, Clone)]
pub(crate) struct Lease {
    /// Its number.
    pub fence: u64,
    /// The tasks, in the order in which they should be done.
    pub tasks: Vec<Task>,
}

impl Lease {
    /// The same for the database.
    pub(crate) fn row(&self, worker: &str) -> Option<StoredLease> {
        let first = self.tasks.first()?;
        Some(StoredLease {
            fence: self.fence,
            worker: worker.to_owned(),
            job: first.frame.job.to_string(),
            frame: first.frame.frame,
            round: first.round.index,
            tiles: self.tasks.iter().map(|t| t.tile).collect(),
        })
    }
}

/// A task that a worker reports about.
#[derive(Debug)]
pub(crate) enum Found {
    /// It was given to this worker.
    Task(Box<Task>),
    /// It was, but nobody needs it any more.
    Closed,
    /// It was given to this worker before the server started, and its frame is not ready yet.
    Later,
    /// It was never given to this worker.
    Never,
}

/// A worker that the server knows.
#[derive(Debug)]
struct Worker {
    name: String,
    threads: u32,
    draining: bool,
    sequence: u64,
    /// When it came.
    since: Instant,
    seen: Instant,
    lost: bool,
    blocked: Option<String>,
    pace: Pace,
}

/// A lease that is out, or was: results of an expired one are taken while their tasks are open.
#[derive(Debug)]
struct Held {
    worker: String,
    granted: Instant,
    /// The worker may hear of it: its row is stored.
    stored: bool,
    /// The worker was not heard of in time.
    expired: bool,
    /// Everything that was given.
    given: Vec<Task>,
    /// What the worker has not reported yet; empty once the lease has expired.
    tasks: Vec<Task>,
}

#[derive(Debug, Default)]
struct Inner {
    workers: BTreeMap<String, Worker>,
    held: BTreeMap<u64, Held>,
    /// Leases from before the server started, whose frames are not ready yet.
    earlier: BTreeMap<u64, StoredLease>,
    hazard: Hazard,
    next: u64,
}

/// The workers.
#[derive(Debug)]
pub(crate) struct Fleet {
    inner: Mutex<Inner>,
    queue: Arc<Queue>,
    /// Threads that render in this process.
    local: usize,
    telemetry: Arc<Telemetry>,
    /// A worker that is not heard of for so long is lost.
    pub ttl: Duration,
}

impl Fleet {
    /// A fleet of no workers besides `local` threads here; `start` counts the server's starts, `earlier` are the
    /// leases that the last one left.
    pub(crate) fn new(
        queue: Arc<Queue>,
        local: usize,
        ttl: Duration,
        (start, earlier): (u64, Vec<StoredLease>),
        telemetry: Arc<Telemetry>,
    ) -> Self {
        let earlier = earlier.into_iter().map(|lease| (lease.fence, lease)).collect();
        let inner = Inner { earlier, next: (start << 32) + 1, ..Inner::default() };
        let fleet = Self { inner: Mutex::new(inner), queue, local, telemetry, ttl };
        fleet.demand(&fleet.lock());
        fleet
    }

    /// A worker calls: it is alive.
    ///
    /// # Errors
    /// [`Refusal`] when it must not be served.
    pub(crate) fn present(&self, caller: &Caller) -> Result<(), Refusal> {
        let mut inner = self.lock();
        inner.present(caller)?;
        self.demand(&inner);
        Ok(())
    }

    /// What a worker should know of its leases, after its reports were taken.
    pub(crate) fn standing(&self, caller: &Caller, live: &Live) -> Standing {
        let mut inner = self.lock();
        let mut standing = Standing::default();
        for &fence in &caller.held {
            inner.recall(fence, live, &self.queue);
        }
        for (&fence, held) in inner.held.iter_mut().filter(|(_, h)| h.worker == caller.worker) {
            held.drop_closed(&self.telemetry);
            let listed = caller.held.contains(&fence);
            if held.tasks.is_empty() {
                standing.revoked.extend(listed.then_some(fence));
            } else if caller.draining && !listed {
                standing.returned.append(&mut held.tasks);
            } else if !listed && held.stored {
                standing.missing.push(Lease { fence, tasks: held.tasks.clone() });
            }
        }
        let known = |fence: &u64| inner.held.contains_key(fence) || inner.earlier.contains_key(fence);
        standing.revoked.extend(caller.held.iter().filter(|fence| !known(fence)));
        standing
    }

    /// Gives a worker tasks for `idle` threads, which must be stored before [`Fleet::stored`]; `None` when there
    /// are none for it.
    pub(crate) fn grant(&self, worker: &str, idle: u32) -> Option<Lease> {
        let mut inner = self.lock();
        let caller = inner.workers.get(worker).filter(|w| !w.draining && w.blocked.is_none())?;
        let threads = inner.workers.values().filter(|w| w.renders()).map(|w| w.threads as usize);
        let everybody = self.local + threads.sum::<usize>();
        let open = self.queue.len();
        let busy = inner.held.values().any(|h| h.worker == worker && !h.tasks.is_empty());
        // Near the end of a round nobody gets more to lie about while others have nothing.
        if busy && open <= everybody {
            return None;
        }
        let mut fits = batch(caller.pace.clone(), caller.threads.min(idle), open, everybody);
        let mut tasks = self.queue.take(worker, |task| fits(task));
        if tasks.is_empty() && !busy {
            tasks.extend(inner.slowest_of_others(worker, self.queue.workers(), self.ttl / YOUNG));
        }
        if tasks.is_empty() {
            return None;
        }
        let (fence, now) = (inner.next, clock::now());
        inner.next += 1;
        for task in &mut tasks {
            task.taken = Taken::by_lease(fence, task.tile, now);
        }
        let lease = Lease { fence, tasks };
        inner.held.insert(lease.fence, Held::new(worker, lease.tasks.clone(), false));
        Some(lease)
    }

    /// A lease is stored: its worker may hear of it.
    pub(crate) fn stored(&self, fence: u64) {
        if let Some(held) = self.lock().held.get_mut(&fence) {
            held.stored = true;
        }
    }

    /// The task that a worker reports about.
    pub(crate) fn find(&self, worker: &str, fence: u64, tile: u32, live: &Live) -> Found {
        let mut inner = self.lock();
        inner.recall(fence, live, &self.queue);
        if let Some(lease) = inner.earlier.get(&fence) {
            let is_own = lease.worker == worker && lease.tiles.contains(&tile);
            return if is_own { Found::Later } else { Found::Never };
        }
        let Some(held) = inner.held.get(&fence) else {
            // Forgotten because nobody needs its tasks any more, or made up; in both cases nothing is taken.
            return if fence < inner.next { Found::Closed } else { Found::Never };
        };
        match held.given.iter().find(|t| t.tile == tile && held.worker == worker) {
            Some(task) if task.is_current() => Found::Task(Box::new(held.as_reported(task))),
            Some(_) => Found::Closed,
            None => Found::Never,
        }
    }

    /// A worker is done with a task, one way or the other; `seconds` when it was rendered.
    pub(crate) fn done(&self, worker: &str, fence: u64, task: &Task, seconds: Option<f64>) {
        let mut inner = self.lock();
        if let Some(seconds) = seconds
            && let Some(worker) = inner.workers.get_mut(worker)
        {
            worker.pace.add(&task.frame.job, task.round.tile_samples(&task.frame.grid, task.tile), seconds);
        }
        if let Some(held) = inner.held.get_mut(&fence) {
            held.tasks.retain(|t| t.tile != task.tile);
        }
    }

    /// Workers that were not heard of for too long: their tasks, with what that says about each.
    pub(crate) fn sweep(&self) -> Vec<(String, Task, Trouble)> {
        let mut inner = self.lock();
        let now = Instant::now();
        let mut back = Vec::new();
        let Inner { workers, held, hazard, .. } = &mut *inner;
        for (id, worker) in workers.iter_mut() {
            if worker.lost || now.duration_since(worker.seen) < self.ttl {
                continue;
            }
            worker.lost = true;
            tracing::warn!(worker = %worker.name, "not heard of for {:?}: its tasks go to others", self.ttl);
            let of_worker = held
                .values_mut()
                .filter(|h| h.worker == *id && !h.tasks.is_empty())
                .inspect(|_| self.telemetry.counts.expirations.inc());
            let given_up: Vec<GivenUp> = of_worker.flat_map(|h| h.expire(worker.threads as usize)).collect();
            if !worker.draining {
                hazard.add(now, given_up.iter().filter(|g| g.begun).map(|g| &g.task));
            }
            back.extend(given_up.into_iter().map(|g| (id.clone(), g)));
        }
        let watched = workers.values().map(|w| w.there(now, self.ttl)).sum();
        let trouble = |(id, GivenUp { task, begun, held }): (String, GivenUp)| {
            let expected = hazard.expected(&task, held, watched);
            (id, task, if begun { Trouble::Lost { expected } } else { Trouble::Interrupted })
        };
        let troubles = back.into_iter().map(trouble).collect();
        held.retain(|_, h| {
            let is_current = h.given.iter().any(Task::is_current);
            if !is_current {
                h.drop_closed(&self.telemetry);
            }
            is_current
        });
        workers.retain(|_, w| w.blocked.is_some() || now.duration_since(w.seen) < FORGET);
        self.demand(&inner);
        troubles
    }

    /// A worker's results were wrong: it gets nothing any more. Its open tasks are returned.
    pub(crate) fn block(&self, worker: &str, reason: &str) -> Vec<Task> {
        let mut inner = self.lock();
        if let Some(worker) = inner.workers.get_mut(worker) {
            worker.blocked = Some(reason.to_owned());
        }
        let held: Vec<_> = inner.held.extract_if(.., |_, h| h.worker == worker).collect();
        self.demand(&inner);
        held.into_iter().flat_map(|(_, h)| h.tasks).filter(Task::is_open).collect()
    }

    /// Tells the queue how many workers there are, and how many open tasks keep them busy.
    fn demand(&self, inner: &Inner) {
        let here = || inner.workers.values().filter(|w| w.renders());
        let threads: usize = here().map(|w| w.threads as usize).sum();
        self.queue.set_demand(here().count() + usize::from(self.local > 0), self.local + 2 * threads);
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A task whose worker was not heard of in time.
struct GivenUp {
    task: Task,
    begun: bool,
    /// Since it was given.
    held: Duration,
}

impl Held {
    fn new(worker: &str, tasks: Vec<Task>, stored: bool) -> Self {
        let worker = worker.to_owned();
        Self { worker, granted: Instant::now(), stored, expired: false, given: tasks.clone(), tasks }
    }

    /// Forgets the tasks that nobody needs any more.
    fn drop_closed(&mut self, telemetry: &Telemetry) {
        for closed in self.tasks.extract_if(.., |task| !task.is_open()) {
            closed.traced(telemetry, &self.worker, Outcome::Closed, 0);
        }
    }

    /// A given task, as the trace must know it that its worker reports about: the end of each is told once.
    fn as_reported(&self, given: &Task) -> Task {
        let mut task = given.clone();
        if !self.tasks.iter().any(|open| open.tile == task.tile) {
            task.taken = if self.expired { task.taken.late() } else { Taken::default() };
        }
        task
    }

    /// Takes back what is not reported. Tasks are done in order, one a thread: those behind were not begun.
    fn expire(&mut self, threads: usize) -> Vec<GivenUp> {
        self.expired = true;
        let held = self.granted.elapsed();
        let tasks = std::mem::take(&mut self.tasks).into_iter().filter(Task::is_open).enumerate();
        tasks.map(|(i, task)| GivenUp { task, begun: i < threads, held }).collect()
    }
}

impl Worker {
    /// How long it was there within the last minutes; a worker that vanished was there until it was given up.
    fn there(&self, now: Instant, ttl: Duration) -> Duration {
        let until = now.min(self.seen + ttl);
        let from = now.checked_sub(WINDOW).map_or(self.since, |begin| begin.max(self.since));
        until.saturating_duration_since(from)
    }

    fn renders(&self) -> bool {
        !self.draining && !self.lost && self.blocked.is_none()
    }
}

impl Inner {
    fn present(&mut self, caller: &Caller) -> Result<(), Refusal> {
        let worker = self.workers.entry(caller.worker.clone()).or_insert_with(|| {
            tracing::info!(worker = %caller.display_name, threads = caller.threads, "a worker has come");
            Worker {
                name: caller.display_name.clone(),
                threads: caller.threads,
                draining: false,
                sequence: 0,
                since: Instant::now(),
                seen: Instant::now(),
                lost: false,
                blocked: None,
                pace: Pace::default(),
            }
        });
        if let Some(reason) = &worker.blocked {
            return Err(Refusal::Blocked(reason.clone()));
        }
        if caller.sequence <= worker.sequence {
            return Err(Refusal::Superseded);
        }
        worker.sequence = caller.sequence;
        worker.threads = caller.threads;
        worker.draining = caller.draining;
        worker.seen = Instant::now();
        worker.lost = false;
        Ok(())
    }

    /// Takes a lease from before the start of the server up again, when its frame is ready.
    fn recall(&mut self, fence: u64, live: &Live, queue: &Queue) {
        let Some(earlier) = self.earlier.get(&fence) else { return };
        let Some(frame) = live.get(&earlier.job, earlier.frame) else { return };
        let Some(earlier) = self.earlier.remove(&fence) else { return };
        let Some(round) = frame.current_round().filter(|round| round.index == earlier.round) else { return };
        let now = clock::now();
        let take = |&tile: &u32| {
            let task = queue.take_tile(&frame, earlier.round, tile)?;
            Some(Task { taken: Taken::by_lease(fence, tile, now), ..task })
        };
        let tasks: Vec<Task> = earlier.tiles.iter().filter_map(take).collect();
        let task = |&tile: &u32| Task {
            frame: Arc::clone(&frame),
            round: Arc::clone(&round),
            tile,
            past: Past::default(),
            taken: Taken::by_lease(fence, tile, now),
        };
        let given = earlier.tiles.iter().map(task).collect();
        self.held.insert(fence, Held { tasks, ..Held::new(&earlier.worker, given, true) });
    }

    /// The task of somebody else that takes longest beyond what was expected.
    fn slowest_of_others(&self, worker: &str, workers: usize, young: Duration) -> Option<Task> {
        let copies =
            |task: &Task| self.held.values().filter(|h| h.tasks.iter().any(|t| t.is_same(task))).count();
        let expected = |held: &Held, task: &Task| {
            let pace = self.workers.get(&held.worker).map(|w| &w.pace);
            pace.and_then(|p| p.seconds(task)).unwrap_or(0.0)
        };
        let mut slow: Vec<(f64, &Task)> = Vec::new();
        for held in self.held.values().filter(|h| h.worker != worker) {
            let age = held.granted.elapsed();
            let all: f64 = held.tasks.iter().map(|t| expected(held, t)).sum();
            if age > young && age.as_secs_f64() > SLOW * all {
                slow.extend(held.tasks.iter().map(|t| (age.as_secs_f64(), t)));
            }
        }
        slow.sort_by(|a, b| b.0.total_cmp(&a.0));
        let free = |t: &&Task| t.is_open() && !t.past.avoids(worker, workers) && copies(t) < 2;
        slow.into_iter().map(|(_, task)| task).find(free).cloned()
    }
}

#[cfg(test)]
#[path = "fleet_tests.rs"]
mod tests;
