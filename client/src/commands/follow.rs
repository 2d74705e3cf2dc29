//! Follows a job: progress bar on stderr, events as JSON lines on stdout, remarks about lost connections.

use std::pin::pin;

use futures::StreamExt;
use karst_client::{Client, Error, Update, is_final};
use karst_proto::v1::job_event::Event;
use karst_proto::v1::{Job, JobEvent, JobState, Progress};
use serde_json::json;

use crate::progress::{Bar, Shown, percent};
use crate::talk::Talk;
use crate::wire_json::{event_json, job_state_name};

/// Waits until a job is final and returns it.
pub(super) async fn follow(
    client: &Client,
    job: &str,
    resume: Option<String>,
    talk: Talk,
) -> Result<Job, Error> {
    let bar = Bar::new();
    let mut updates = pin!(client.watch(job, resume));
    let mut connected = true;
    loop {
        let update = tokio::select! {
            update = updates.next() => update,
            _ = tokio::signal::ctrl_c() => {
                bar.clear();
                return Err(Error::Failed(format!("interrupted; the job goes on: `karst watch {job}` finds it again")));
            }
        };
        let Some(update) = update else { break };
        match update? {
            Update::Reconnecting { cause, wait } => {
                if std::mem::take(&mut connected) {
                    bar.note(&format!("connection lost ({cause}), trying again"));
                }
                let wait_seconds = wait.as_secs_f64();
                talk.event(&json!({"event": "reconnecting", "cause": cause, "wait_seconds": wait_seconds}));
            }
            Update::Event(event) => {
                connected = true;
                talk.event(&event_json(&event));
                if let Some(job) = show(&bar, *event) {
                    bar.clear();
                    return Ok(job);
                }
            }
        }
    }
    Err(Error::Failed(format!("{job}: the watch ended before the job did")))
}

/// Shows an event; returns the job once it is final.
fn show(bar: &Bar, event: JobEvent) -> Option<Job> {
    match event.event {
        Some(Event::Snapshot(job)) if is_final(job.state()) => Some(job),
        Some(Event::Progress(progress)) => {
            bar.show(&shown(&progress));
            None
        }
        Some(Event::Snapshot(_) | Event::Frame(_) | Event::Round(_) | Event::Bookmark(_)) | None => None,
    }
}

fn shown(progress: &Progress) -> Shown {
    Shown {
        frame: progress.frame,
        frames_finished: progress.frames_finished,
        frames_total: progress.frames_total,
        samples_done: progress.samples_done,
        samples_planned: progress.samples_planned,
        error: progress.rel_mse.map(f64::sqrt),
        seconds_left: progress.seconds_left,
    }
}

/// Success only for a job that succeeded.
pub(super) fn outcome(job: &Job, talk: Talk) -> Result<(), Error> {
    let failed = |text: String| Err(Error::Failed(text));
    match job.state() {
        JobState::Succeeded => {
            talk.say(&format_args!("job {} succeeded: {}", job.id, summary(job)));
            Ok(())
        }
        JobState::Failed => {
            let why = job.error.as_ref().map_or("no reason given", |error| error.message.as_str());
            failed(format!("job {} failed: {why}", job.id))
        }
        JobState::Cancelled => failed(format!("job {} was cancelled", job.id)),
        state @ (JobState::Unspecified | JobState::Queued | JobState::Running) => {
            failed(format!("job {} is {}", job.id, job_state_name(state)))
        }
    }
}

fn summary(job: &Job) -> String {
    let seconds = match (&job.started_at, &job.finished_at) {
        (Some(start), Some(end)) => {
            (end.seconds - start.seconds) as f64 + f64::from(end.nanos - start.nanos) * 1e-9
        }
        _ => 0.0,
    };
    let samples = job.statistics.as_ref().map_or(0, |statistics| statistics.samples);
    format!("{} frames, {:.1} million samples, {seconds:.1} s", job.frames_total, samples as f64 * 1e-6)
}

/// One line about a finished frame.
pub(super) fn frame_line(frame: &karst_proto::v1::Frame) -> String {
    let error = frame.rel_mse.map_or_else(|| "unknown".to_owned(), |rel_mse| percent(rel_mse.sqrt()));
    format!(
        "frame {}: {:.1} samples per pixel, error {error}, {:.1} s",
        frame.frame, frame.spp, frame.render_seconds
    )
}
