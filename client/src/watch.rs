//! Streams that survive the connection: job events and collected tiles, resumed by token without a gap; previews.

use std::time::Duration;

use async_stream::try_stream;
use futures::Stream;
use karst_proto::errors::{ErrorReason, reason};
use karst_proto::v1::job_event::Event;
use karst_proto::v1::{
    CollectTilesRequest, CollectedTile, JobEvent, JobState, PreviewTile, StreamTilesRequest, WatchJobRequest,
};
use tonic::{Status, Streaming};

use crate::client::broken_off;
use crate::retry::{Backoff, is_transient};
use crate::{Client, Error};

/// How long a stream waits for a server that went away.
const PATIENCE: Duration = Duration::from_mins(5);

/// What a watcher hears.
#[derive(Clone, Debug)]
pub enum Update {
    /// Something happened to the job.
    Event(Box<JobEvent>),
    /// The connection broke; the watch goes on by itself after this wait.
    Reconnecting {
        /// What broke it.
        cause: String,
        /// Until the next attempt.
        wait: Duration,
    },
}

/// Whether nothing changes after this state.
pub fn is_final(state: JobState) -> bool {
    match state {
        JobState::Succeeded | JobState::Failed | JobState::Cancelled => true,
        JobState::Unspecified | JobState::Queued | JobState::Running => false,
    }
}

impl Client {
    /// Everything that happens to a job until it is final, across lost connections and restarts of the server:
    /// no snapshot, frame or round event comes twice, none is missing. Begins with a snapshot or, with a
    /// `resume_token`, after the event that carried it.
    ///
    /// The stream ends with an error as `Jobs.WatchJob`, or when the server stays away for five minutes.
    pub fn watch(
        &self,
        job: &str,
        resume_token: Option<String>,
    ) -> impl Stream<Item = Result<Update, Error>> + Send + use<> {
        let (client, job) = (self.clone(), job.to_owned());
        let mut token = resume_token.unwrap_or_default();
        try_stream! {
            let mut backoff = Backoff::new(PATIENCE);
            let mut seen = 0;
            loop {
                let request = WatchJobRequest { job: job.clone(), resume_token: token.clone() };
                let mut events = client.job_calls().watch_job(request).await.map(tonic::Response::into_inner);
                let status = loop {
                    let event = match next(&mut events).await {
                        Ok(event) => event,
                        Err(status) => break status,
                    };
                    backoff.reset();
                    token.clone_from(&event.resume_token);
                    let ends = is_last(&event);
                    if is_news(&event, &mut seen) {
                        yield Update::Event(Box::new(event));
                    }
                    if ends {
                        return;
                    }
                };
                if reason(&status) == Some(ErrorReason::ResumeTokenExpired) && !token.is_empty() {
                    token.clear();
                    seen = 0;
                    continue;
                }
                let wait = patience("watch", &status, &mut backoff)?;
                yield Update::Reconnecting { cause: status.message().to_owned(), wait };
                tokio::time::sleep(wait).await;
            }
        }
    }

    /// Tiles as they improve until the job is final, across lost connections; lossy, the newest wins. After a
    /// lost connection what exists comes again.
    ///
    /// The stream ends with an error as `Previews.StreamTiles`, or when the server stays away for five minutes.
    pub fn stream_tiles(
        &self,
        request: StreamTilesRequest,
    ) -> impl Stream<Item = Result<PreviewTile, Error>> + Send + use<> {
        let client = self.clone();
        try_stream! {
            let mut backoff = Backoff::new(PATIENCE);
            loop {
                let mut tiles = client.preview_calls().stream_tiles(request.clone()).await;
                let status = loop {
                    let message = match &mut tiles {
                        Ok(tiles) => tiles.get_mut().message().await,
                        Err(status) => Err(status.clone()),
                    };
                    match message {
                        Ok(Some(tile)) => {
                            backoff.reset();
                            yield tile;
                        }
                        Ok(None) => return,
                        Err(status) => break status,
                    }
                };
                tokio::time::sleep(patience("preview", &status, &mut backoff)?).await;
            }
        }
    }

    /// Every tile of a frame exactly once, across lost connections.
    ///
    /// The stream ends with an error as `Frames.CollectTiles`, or when the server stays away for five minutes.
    pub fn collect_tiles(
        &self,
        job: &str,
        frame: i32,
    ) -> impl Stream<Item = Result<CollectedTile, Error>> + Send + use<> {
        let (client, job) = (self.clone(), job.to_owned());
        try_stream! {
            let mut backoff = Backoff::new(PATIENCE);
            let mut token = String::new();
            let mut count = 0;
            loop {
                let request = CollectTilesRequest { job: job.clone(), frame, resume_token: token.clone() };
                let mut tiles =
                    client.frame_calls().collect_tiles(request).await.map(tonic::Response::into_inner);
                let status = loop {
                    let tile = match next(&mut tiles).await {
                        Ok(tile) => tile,
                        Err(status) => break status,
                    };
                    backoff.reset();
                    token.clone_from(&tile.resume_token);
                    count += 1;
                    let ends = count == tile.tile_count;
                    yield tile;
                    if ends {
                        return;
                    }
                };
                let wait = patience("collect tiles", &status, &mut backoff)?;
                tokio::time::sleep(wait).await;
            }
        }
    }
}

/// The next message; a call that failed, a broken stream and an early end are all a status.
async fn next<T>(messages: &mut Result<Streaming<T>, Status>) -> Result<T, Status> {
    match messages {
        Ok(messages) => messages.message().await?.ok_or_else(broken_off),
        Err(status) => Err(status.clone()),
    }
}

fn patience(call: &'static str, status: &Status, backoff: &mut Backoff) -> Result<Duration, Error> {
    match backoff.next() {
        Some(wait) if is_transient(status) => Ok(wait),
        _ => Err(Error::call(call, status.clone())),
    }
}

fn is_last(event: &JobEvent) -> bool {
    matches!(&event.event, Some(Event::Snapshot(job)) if is_final(job.state()))
}

/// Whether an event is worth passing on: lasting events only if newer than all `seen` before, progress always.
fn is_news(event: &JobEvent, seen: &mut u64) -> bool {
    match event.event {
        Some(Event::Snapshot(_) | Event::Frame(_) | Event::Round(_)) => {
            let newer = event.revision > *seen;
            *seen = event.revision.max(*seen);
            newer
        }
        Some(Event::Progress(_)) => true,
        Some(Event::Bookmark(_)) | None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::{is_last, is_news};
    use karst_proto::v1::job_event::Event;
    use karst_proto::v1::{Bookmark, Job, JobEvent, JobState, Progress, RoundFinished};

    fn event(revision: u64, event: Event) -> JobEvent {
        JobEvent { revision, resume_token: String::new(), event: Some(event) }
    }

    #[test]
    fn lasting_events_pass_once_and_in_order() {
        let mut seen = 0;
        let round = |revision| event(revision, Event::Round(RoundFinished::default()));
        assert!(is_news(&round(1), &mut seen));
        assert!(is_news(&round(2), &mut seen));
        assert!(!is_news(&round(2), &mut seen), "a repeated event must not come twice");
        assert!(is_news(&event(2, Event::Progress(Progress::default())), &mut seen));
        assert!(!is_news(&event(9, Event::Bookmark(Bookmark {})), &mut seen));
        assert!(is_news(&round(3), &mut seen), "a bookmark must not hide later events");
    }

    #[test]
    fn only_a_final_snapshot_ends_a_watch() {
        let snapshot = |state: JobState| {
            event(
                1,
                Event::Snapshot(Box::new(Job { state: state.into(), ..Job::default() }).as_ref().clone()),
            )
        };
        assert!(!is_last(&snapshot(JobState::Running)));
        assert!(is_last(&snapshot(JobState::Failed)));
    }
}
