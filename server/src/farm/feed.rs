//! Owns how watchers learn that there is something new: the newest durable revision of each unfinished job, and how
//! it is going. What exactly happened they read from the database, so a slow watcher costs nothing here.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::watch::{self, Receiver};

/// How a job is going. Lossy: only the newest counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Frame that is being rendered.
    pub frame: i32,
    /// Camera samples finished in that frame.
    pub samples_done: u64,
    /// Camera samples planned for it; an estimate where sampling is adaptive.
    pub samples_planned: u64,
    /// Over the last seconds.
    pub samples_per_second: f64,
    /// Of the frame after its last finished round.
    pub rel_mse: Option<f64>,
    /// Until the whole job is finished; `None` while unknown.
    pub seconds_left: Option<f64>,
    /// Frames of the job that are finished.
    pub frames_finished: u32,
    /// Frames of the job.
    pub frames_total: u32,
}

/// News of one job.
#[derive(Debug)]
pub struct Feed {
    /// Newest durable revision.
    pub revision: watch::Sender<u64>,
    /// Newest progress.
    pub progress: watch::Sender<Option<Progress>>,
}

/// News of all unfinished jobs.
#[derive(Debug, Default)]
pub struct Feeds {
    feeds: Mutex<HashMap<String, Arc<Feed>>>,
    /// Rises when a job is new or has changed.
    changes: watch::Sender<u64>,
}

impl Feeds {
    /// The feed of a job, made if there is none.
    pub fn open(&self, job: &str, revision: u64) -> Arc<Feed> {
        let new =
            || Arc::new(Feed { revision: watch::Sender::new(revision), progress: watch::Sender::new(None) });
        let feed = Arc::clone(self.lock().entry(job.to_owned()).or_insert_with(new));
        self.changes.send_modify(|changes| *changes += 1);
        feed
    }

    /// A revision of a job is durable.
    pub fn tell(&self, job: &str, revision: u64) {
        if let Some(feed) = self.get(job) {
            feed.revision.send_replace(revision);
        }
        self.changes.send_modify(|changes| *changes += 1);
    }

    /// Hears of every change of any job.
    pub fn changes(&self) -> Receiver<u64> {
        self.changes.subscribe()
    }

    /// The feed of an unfinished job.
    pub fn get(&self, job: &str) -> Option<Arc<Feed>> {
        self.lock().get(job).cloned()
    }

    /// The job has reached a final state.
    pub fn close(&self, job: &str) {
        self.lock().remove(job);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Arc<Feed>>> {
        self.feeds.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Something comes at the latest after this time.
const QUIET: Duration = Duration::from_secs(15);

/// One watcher's ear.
#[derive(Debug)]
pub struct Listener {
    revision: Receiver<u64>,
    progress: Receiver<Option<Progress>>,
}

/// What a watcher hears.
#[derive(Debug)]
pub enum News {
    /// There are new records, perhaps.
    Record,
    /// How it is going.
    Progress(Progress),
    /// The job has ended.
    Closed,
    /// Nothing has happened for 15 s.
    Quiet,
}

impl Listener {
    /// Hears the news of a feed.
    pub fn new(feed: &Feed) -> Self {
        let mut listener = Self { revision: feed.revision.subscribe(), progress: feed.progress.subscribe() };
        // Whatever came before is read from the database at least once after this.
        listener.revision.mark_changed();
        listener
    }

    /// Waits for news.
    pub async fn next(&mut self) -> News {
        tokio::select! {
            biased;
            changed = self.revision.changed() => if changed.is_ok() { News::Record } else { News::Closed },
            changed = self.progress.changed() => match self.progress.borrow_and_update().as_ref() {
                _ if changed.is_err() => News::Closed,
                Some(progress) => News::Progress(progress.clone()),
                None => News::Record,
            },
            () = tokio::time::sleep(QUIET) => News::Quiet,
        }
    }
}
