//! Owns what the page hears of jobs and frames.

use std::collections::BTreeSet;
use std::time::Duration;

use axum::extract::ws::Message;

use crate::farm::Shared;
use crate::farm::feed::{Listener, News};
use crate::model::{Frame, Record};
use crate::page::messages::{FrameLine, JobLine, ProgressLine, Tell};
use crate::page::socket::{Ended, Outlet};

/// Jobs in the list.
const MOST_JOBS: u32 = 100;
/// Between two lists.
const PAUSE: Duration = Duration::from_millis(500);
/// Records read at once.
const RECORDS: u32 = 256;

/// Tells the list of jobs at once, then whenever something in it changes.
pub(super) async fn tell_jobs(shared: &Shared, outlet: &Outlet) -> Result<(), Ended> {
    let mut changes = shared.feeds.changes();
    let mut last = None;
    loop {
        changes.mark_unchanged();
        let jobs = shared.state.jobs(&[], i64::MAX, MOST_JOBS).await?;
        let list = Message::from(Tell::Jobs { jobs: jobs.iter().map(|(_, job)| JobLine::of(job)).collect() });
        if last.as_ref() != Some(&list) {
            outlet.send(list.clone()).await?;
            last = Some(list);
        }
        // The pause comes after a list, so that the first change after a quiet time is told at once.
        tokio::time::sleep(PAUSE).await;
        if changes.changed().await.is_err() {
            return Ok(());
        }
    }
}

/// Tells the frames of a job, then those that change, until the job has ended.
pub(super) async fn tell_frames(shared: &Shared, id: &str, outlet: &Outlet) -> Result<(), Ended> {
    let mut feed = shared.feeds.get(id).map(|feed| Listener::new(&feed));
    let job = shared.state.job(id).await?;
    let mut last = job.revision;
    let frames = shared.state.frames(id, i32::MIN, u32::MAX).await?;
    outlet.send(list(id, &frames)).await?;
    let mut ended = job.state.is_final();
    while !ended {
        let records = shared.state.records(id, last, RECORDS).await?;
        let mut changed = BTreeSet::new();
        for (revision, record) in &records {
            last = *revision;
            match record {
                Record::Snapshot(job) => ended = job.state.is_final(),
                Record::Frame(frame) => drop(changed.insert(frame.frame)),
                Record::Round { frame, .. } => drop(changed.insert(*frame)),
            }
        }
        if !changed.is_empty() {
            let mut frames = Vec::with_capacity(changed.len());
            for frame in changed {
                frames.push(shared.state.frame(id, frame).await?);
            }
            outlet.send(list(id, &frames)).await?;
        }
        if !records.is_empty() {
            continue;
        }
        let Some(listener) = &mut feed else {
            // It ended just now, or is about to be stored: look again.
            tokio::time::sleep(Duration::from_millis(100)).await;
            feed = shared.feeds.get(id).map(|feed| Listener::new(&feed));
            continue;
        };
        match listener.next().await {
            News::Record | News::Quiet => {}
            News::Closed => feed = None,
            News::Progress(progress) => {
                outlet.send(Tell::Progress(ProgressLine::of(id, &progress)).into()).await?;
            }
        }
    }
    Ok(())
}

fn list(job: &str, frames: &[Frame]) -> Message {
    Tell::Frames { job, frames: frames.iter().map(FrameLine::of).collect() }.into()
}
