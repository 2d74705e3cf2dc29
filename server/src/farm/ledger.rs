//! Owns the order in which things become durable. One queue, one writer, groups of entries in one transaction.
//!
//! For a group: the results' bytes → one pack per frame (synced) → one transaction with all rows → merged into the
//! films → previews and watchers told. So nobody hears of anything that a crash could take back, and:
//! - a crash before the transaction leaves packs or films that no row names: swept at the next start;
//! - a crash after it leaves rows whose blobs are there: they are merged again at the next start;
//! - a crash before old packs are deleted leaves them: swept at the next start.
//!
//! Each errs towards doing work again, never towards losing or counting anything twice.
//! A disk that fails or is full stops the ledger, and with it the workers, until it works again: nothing is lost
//! and nothing needs a restart.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{Counters, TileResult};
use prost::bytes::Bytes;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, sleep, timeout_at};

use crate::blobs::{Blobs, Kind};
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::Event;
use crate::farm::live::{LiveFrame, Vote};
use crate::farm::queue::Task;
use crate::preview::Hub;
use crate::state::{Row, State};
use crate::telemetry::Telemetry;
use crate::telemetry::counts::Outcome;

/// Results wait for each other at most this long, so that many share a sync.
const WINDOW: Duration = Duration::from_millis(100);
/// Results in one group.
const GROUP: usize = 16;
/// Entries that wait for the writer; workers wait beyond.
const BACKLOG: usize = 64;

/// A result that is not durable yet.
#[derive(Debug)]
pub(crate) struct Rendered {
    /// What was asked for.
    pub task: Task,
    /// The result.
    pub result: TileResult,
    /// The same as bytes.
    pub bytes: Vec<u8>,
    /// Their digest, and whose they are.
    pub vote: Vote,
    /// The round waits for nothing else.
    pub last: bool,
    /// Who wants to know when it is durable, or why it is not needed.
    pub ack: Option<oneshot::Sender<Verdict>>,
}

impl Rendered {
    /// Tells whoever brought the result what became of it, and whoever wants to know.
    pub(super) fn answer(&mut self, verdict: Verdict, telemetry: &Telemetry) {
        let outcome = match verdict {
            Verdict::Accepted if self.task.taken.late => Outcome::Late,
            Verdict::Accepted => Outcome::Accepted,
            Verdict::Duplicate => Outcome::Duplicate,
            Verdict::Closed => Outcome::Closed,
            Verdict::Disputed => Outcome::Disputed,
        };
        let Counters { samples, rays, shadow_rays, .. } = self.result.counters;
        self.task.ended(telemetry, &self.vote.worker, outcome, samples);
        if verdict == Verdict::Accepted {
            let counts = &telemetry.counts;
            counts.samples.inc_by(samples);
            counts.add_rays(rays, shadow_rays);
            counts.nonfinite.inc_by(self.result.counters.nan_samples + self.result.counters.infinite_samples);
            counts.exhausted.inc_by(self.result.counters.exhausted_rays);
        }
        if let Some(ack) = self.ack.take() {
            let _ = ack.send(verdict);
        }
    }
}

/// What became of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It is durable.
    Accepted,
    /// The same bytes were accepted before.
    Duplicate,
    /// Nobody needs it any more.
    Closed,
    /// Other bytes were accepted before.
    Disputed,
}

/// A film after a round.
pub(crate) struct NewFilm {
    /// Whose film.
    pub frame: Arc<LiveFrame>,
    /// Rounds in it.
    pub rounds: u32,
    /// Its bytes.
    pub bytes: Bytes,
}

/// What becomes durable.
pub(crate) enum Entry {
    /// The result of a task.
    Rendered(Box<Rendered>),
    /// Rows that belong together.
    Rows(Box<Rows>),
}

/// Rows that belong together, with what follows from them.
pub(crate) struct Rows {
    /// What changes.
    pub changes: Vec<Row>,
    /// A film that is stored before the rows.
    pub film: Option<NewFilm>,
    /// Frames that were given up: the rows forget their packs.
    pub given_up: Vec<Arc<LiveFrame>>,
    /// Runs when all of it is durable.
    pub then: Box<dyn FnOnce() + Send>,
}

impl fmt::Debug for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rendered(_) => "Rendered",
            Self::Rows(_) => "Rows",
        })
    }
}

/// The writer.
pub(crate) struct Ledger {
    pub(crate) state: State,
    pub(crate) blobs: Blobs,
    pub(crate) hub: Arc<Hub>,
    pub(crate) farm: mpsc::UnboundedSender<Event>,
    pub(crate) telemetry: Arc<Telemetry>,
}

/// The queue in front of the writer.
pub(crate) fn channel() -> (mpsc::Sender<Entry>, mpsc::Receiver<Entry>) {
    mpsc::channel(BACKLOG)
}

impl Ledger {
    /// Writes until all senders are gone.
    pub(crate) async fn run(self, mut entries: mpsc::Receiver<Entry>) {
        let mut last = Instant::now();
        while let Some(first) = entries.recv().await {
            let group = collect(first, &mut entries, last + WINDOW).await;
            self.write(group).await;
            last = Instant::now();
        }
    }

    async fn write(&self, group: Vec<Entry>) {
        let mut sorted = Group::default();
        for entry in group {
            sorted.add(entry);
        }
        let Group { mut results, again, closed, mut rows, thens, films, given_up } = sorted;
        for mut result in closed {
            result.answer(Verdict::Closed, &self.telemetry);
        }
        let mut old = Vec::new();
        // A round's results were written before its film was made, so results beside a film are of the next round:
        // the film's row goes first, because it forgets the packs of the frame.
        for film in films {
            rows.push(self.store_film(film, &mut old).await);
        }
        for results in results.values() {
            rows.push(self.store_pack(results).await);
        }
        persist(|| self.state.commit(&rows)).await;
        for frame in given_up {
            old.extend(frame.merged().packs.drain(..).map(|pack| (Kind::Pack, pack)));
        }
        for result in results.values_mut().flatten() {
            result.answer(Verdict::Accepted, &self.telemetry);
        }
        for (_, results) in results {
            self.merge(results).await;
        }
        for result in again {
            self.compare(result, &mut old).await;
        }
        for then in thens {
            then();
        }
        for (kind, digest) in old {
            if let Err(e) = self.delete(kind, digest).await {
                tracing::warn!("a blob that nobody needs stays until the next start: {e}");
            }
        }
    }

    /// Deletes a blob, unless another frame or job has the same bytes: a part of the picture that does not change,
    /// the same scene once more.
    async fn delete(&self, kind: Kind, digest: Digest) -> Result<(), Error> {
        if self.state.is_needed(&digest).await? { Ok(()) } else { self.blobs.delete(kind, &digest).await }
    }

    async fn store_film(&self, film: NewFilm, old: &mut Vec<(Kind, Digest)>) -> Row {
        let digest = persist(|| self.blobs.put(Kind::Film, film.bytes.clone())).await;
        let mut merged = film.frame.merged();
        old.extend(merged.packs.drain(..).map(|pack| (Kind::Pack, pack)));
        old.extend(merged.stored.replace(digest).filter(|d| *d != digest).map(|d| (Kind::Film, d)));
        Row::Film {
            job: film.frame.job.to_string(),
            frame: film.frame.frame,
            rounds: film.rounds,
            film: digest,
        }
    }

    async fn store_pack(&self, results: &[Rendered]) -> Row {
        let pack = Bytes::from(pack(results.iter().map(|r| r.bytes.as_slice())));
        let digest = persist(|| self.blobs.put(Kind::Pack, pack.clone())).await;
        let task = &results[0].task;
        task.frame.merged().packs.push(digest);
        Row::Pack {
            job: task.frame.job.to_string(),
            frame: task.frame.frame,
            round: task.round.index,
            pack: digest,
        }
    }

    /// Merges durable results of one frame and tells the previews and the farm.
    async fn merge(&self, results: Vec<Rendered>) {
        let frame = Arc::clone(&results[0].task.frame);
        let merged = tokio::task::spawn_blocking(move || {
            let frame = Arc::clone(&results[0].task.frame);
            let mut merged = frame.merged();
            let mut tiles = Vec::with_capacity(results.len());
            for r in &results {
                merged.film.merge(&r.result).map_err(|e| format!("tile {}: {e}", r.task.tile))?;
                merged.rounds[r.task.tile as usize] = r.task.round.index + 1;
                merged.accepted.insert(r.task.tile, r.vote.clone());
                frame.add_samples(r.result.counters.samples);
                tiles.push(r.task.tile);
            }
            Ok::<_, String>(tiles)
        })
        .await;
        let event = match merged {
            Ok(Ok(tiles)) => {
                self.hub.publish(&frame.job, frame.frame, &tiles);
                Event::Accepted(frame, tiles.len() as u32)
            }
            Ok(Err(message)) => Event::TileFailed(frame, message),
            Err(e) => Event::TileFailed(frame, e.to_string()),
        };
        let _ = self.farm.send(event);
    }
}

/// Entries of one transaction, by what is done with them.
#[derive(Default)]
struct Group {
    /// Results of open tasks, by job number and frame number.
    results: BTreeMap<(i64, i32), Vec<Rendered>>,
    /// Results of tasks that have one already.
    again: Vec<Rendered>,
    /// Results that nobody needs any more.
    closed: Vec<Rendered>,
    rows: Vec<Row>,
    thens: Vec<Box<dyn FnOnce() + Send>>,
    films: Vec<NewFilm>,
    given_up: Vec<Arc<LiveFrame>>,
}

impl Group {
    fn add(&mut self, entry: Entry) {
        match entry {
            Entry::Rendered(result) => self.add_result(*result),
            Entry::Rows(entry) => {
                self.rows.extend(entry.changes);
                self.films.extend(entry.film);
                self.given_up.extend(entry.given_up);
                self.thens.push(entry.then);
            }
        }
    }

    fn add_result(&mut self, result: Rendered) {
        let task = &result.task;
        let (is_current, has_result) = {
            let merged = task.frame.merged();
            let round = task.round.index;
            (merged.round == round, merged.rounds[task.tile as usize] > round)
        };
        let of_frame = self.results.entry((task.frame.number, task.frame.frame)).or_default();
        if task.frame.is_stopped() || !is_current {
            self.closed.push(result);
        } else if has_result || of_frame.iter().any(|r| r.task.is_same(&result.task)) {
            self.again.push(result);
        } else {
            of_frame.push(result);
        }
        self.results.retain(|_, results| !results.is_empty());
    }
}

/// Takes what belongs in one transaction with `first`.
async fn collect(first: Entry, entries: &mut mpsc::Receiver<Entry>, until: Instant) -> Vec<Entry> {
    let urgent = |entry: &Entry| match entry {
        Entry::Rendered(r) => r.last,
        Entry::Rows(_) => true,
    };
    let mut group = vec![first];
    while group.len() < GROUP && !group.iter().any(urgent) {
        match timeout_at(until, entries.recv()).await {
            Ok(Some(entry)) => group.push(entry),
            Ok(None) | Err(_) => break,
        }
    }
    while group.len() < GROUP
        && let Ok(entry) = entries.try_recv()
    {
        group.push(entry);
    }
    group
}

/// Repeats a write until the disk takes it.
pub(super) async fn persist<T, F: Future<Output = Result<T, Error>>>(write: impl Fn() -> F) -> T {
    let mut pause = Duration::from_millis(100);
    loop {
        match write().await {
            Ok(value) => return value,
            Err(e) => tracing::error!("nothing can be stored, trying again in {pause:?}: {e}"),
        }
        sleep(pause).await;
        pause = (pause * 2).min(Duration::from_secs(10));
    }
}

/// Results one after the other, each behind its length in four bytes, little endian.
pub(super) fn pack<'a>(results: impl Iterator<Item = &'a [u8]>) -> Vec<u8> {
    let mut pack = Vec::new();
    for bytes in results {
        pack.extend((bytes.len() as u32).to_le_bytes());
        pack.extend(bytes);
    }
    pack
}

/// The results of a pack; `None` when it is not one.
pub(crate) fn unpack(mut pack: &[u8]) -> Option<Vec<&[u8]>> {
    let mut results = Vec::new();
    while !pack.is_empty() {
        let (length, rest) = pack.split_first_chunk::<4>()?;
        let (bytes, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        results.push(bytes);
        pack = rest;
    }
    Some(results)
}

#[cfg(test)]
mod tests {
    use super::{pack, unpack};

    #[test]
    fn packs_hold_results_and_other_bytes_are_none() {
        let parts: [&[u8]; 3] = [b"one", b"", b"three"];
        let packed = pack(parts.into_iter());
        assert_eq!(unpack(&packed).unwrap(), parts);
        assert_eq!(unpack(&packed[..packed.len() - 1]), None);
        assert_eq!(unpack(&[1, 2]), None);
        assert_eq!(unpack(&[255; 8]), None);
    }
}
