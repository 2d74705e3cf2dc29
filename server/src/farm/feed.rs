//! Owns how watchers learn that there is something new: the newest durable revision of each unfinished job, and how
//! it is going. What exactly happened they read from the database, so a slow watcher costs nothing here.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

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
}

impl Feeds {
    /// The feed of a job, made if there is none.
    pub fn open(&self, job: &str, revision: u64) -> Arc<Feed> {
        let new =
            || Arc::new(Feed { revision: watch::Sender::new(revision), progress: watch::Sender::new(None) });
        Arc::clone(self.lock().entry(job.to_owned()).or_insert_with(new))
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
