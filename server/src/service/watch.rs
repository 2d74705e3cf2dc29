//! Owns what a watcher of a job is told: the records of the database in order, and between them how it is going.

use std::time::Duration;

use karst_proto::v1::{self, JobEvent, job_event};

use crate::error::Error;
use crate::farm::Shared;
use crate::farm::feed::{Listener, News};
use crate::model::{Job, Record};
use crate::service::convert;
use crate::service::outlet::{Closed, Outlet};

/// Records read at once.
const PAGE: u32 = 256;

/// The token after revision `revision` of a job.
fn token(job: &str, revision: u64) -> String {
    format!("watch-{job}-{revision}")
}

/// The revision that a token stands for.
///
/// # Errors
/// [`Error::Token`] when it is not from this job.
pub(crate) fn revision_of(token: &str, job: &Job) -> Result<u64, Error> {
    let rest =
        token.strip_prefix("watch-").and_then(|t| t.strip_prefix(job.id.as_str())).ok_or(Error::Token)?;
    let revision = rest.strip_prefix('-').and_then(|t| t.parse().ok()).ok_or(Error::Token)?;
    if revision <= job.revision { Ok(revision) } else { Err(Error::Token) }
}

/// Tells everything that happens to a job until it has ended. `from` is the last revision that the watcher has.
pub(crate) async fn watch(
    shared: &Shared,
    job: Job,
    from: Option<u64>,
    outlet: &Outlet<JobEvent>,
) -> Result<(), Closed> {
    let id = job.id.clone();
    let event =
        |revision, event| JobEvent { revision, resume_token: token(&id, revision), event: Some(event) };
    let mut feed = shared.feeds.get(&id).map(|feed| Listener::new(&feed));
    let mut last = from.unwrap_or(job.revision);
    let mut ended = job.state.is_final() && last >= job.revision;
    if from.is_none() {
        outlet.send(event(last, job_event::Event::Snapshot(convert::job(&job)))).await?;
    }
    loop {
        let records = shared.state.records(&id, last, PAGE).await?;
        for (revision, record) in &records {
            last = *revision;
            ended = matches!(record, Record::Snapshot(job) if job.state.is_final());
            outlet.send(event(last, convert::record(record))).await?;
        }
        if ended {
            return Ok(());
        }
        if !records.is_empty() {
            continue;
        }
        let Some(listener) = &mut feed else {
            // It ended just now, or is about to be stored: look again.
            tokio::time::sleep(Duration::from_millis(100)).await;
            feed = shared.feeds.get(&id).map(|feed| Listener::new(&feed));
            continue;
        };
        let news = tokio::select! {
            news = listener.next() => news,
            () = outlet.gone() => return Err(Closed::Gone),
        };
        match news {
            News::Record => {}
            News::Closed => feed = None,
            News::Progress(progress) => {
                outlet.send(event(last, job_event::Event::Progress(convert::progress(&progress)))).await?;
            }
            News::Quiet => outlet.send(event(last, job_event::Event::Bookmark(v1::Bookmark {}))).await?,
        }
    }
}
