//! Owns what happens when a task got two different results: a fault in hardware, or a worker that lies.
//!
//! Tasks are pure, so this must not happen; when it does, nobody knows yet who is right. Both results are kept, the
//! round stays open, and the server renders the task itself: two of three decide. If the result that was merged
//! loses, the film is made again from what is stored, without it.

use std::sync::Arc;

use karst_core::film::Film;
use karst_core::render::render_tile;
use prost::bytes::Bytes;
use tokio::sync::mpsc;

use crate::blobs::Kind;
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::Event;
use crate::farm::ledger::{Entry, Ledger, Rendered, Verdict, pack, persist};
use crate::farm::live::{LiveFrame, Merged, Vote};
use crate::farm::prepare::{read_stored, results};
use crate::farm::queue::Task;
use crate::state::{Row, StoredRound};

/// Who renders a disputed task.
const JUDGE: &str = "server, as judge";

/// Where a tile stands after one more result for it.
#[derive(Debug, PartialEq, Eq)]
enum Standing {
    /// The round has ended.
    Closed,
    /// The same bytes as before.
    Agreed,
    /// Others than before.
    Disputed,
    /// The accepted result was right; these workers were wrong.
    Upheld(Vec<String>),
    /// This result was right; these workers were wrong.
    Overruled(Vec<String>),
    /// Three results, none twice.
    Hopeless,
}

impl Merged {
    /// One more result for a tile that has one.
    fn vote(&mut self, round: u32, tile: u32, vote: Vote) -> Standing {
        let Some(accepted) = self.accepted.get(&tile).filter(|_| self.round == round) else {
            return Standing::Closed;
        };
        let Some(others) = self.disputes.get_mut(&tile) else {
            if accepted.digest == vote.digest {
                return Standing::Agreed;
            }
            self.disputes.insert(tile, vec![vote]);
            return Standing::Disputed;
        };
        // Nobody is heard twice.
        if others.iter().chain([accepted]).any(|v| v.worker == vote.worker) {
            return Standing::Disputed;
        }
        let agrees = |v: &&Vote| v.digest == vote.digest;
        let wrong = |votes: &[Vote]| {
            votes.iter().filter(|v| !agrees(v)).map(|v| v.worker.clone()).collect::<Vec<_>>()
        };
        let standing = if agrees(&accepted) {
            Standing::Upheld(wrong(others))
        } else if others.iter().any(|v| agrees(&v)) {
            let mut all = others.clone();
            all.push(accepted.clone());
            Standing::Overruled(wrong(&all))
        } else {
            return Standing::Hopeless;
        };
        self.disputes.remove(&tile);
        standing
    }
}

impl Ledger {
    /// One more result for a task that has one.
    pub(super) async fn compare(&self, mut result: Rendered, old: &mut Vec<(Kind, Digest)>) {
        let Task { frame, round, tile, .. } = result.task.clone();
        let standing = frame.merged().vote(round.index, tile, result.vote.clone());
        match standing {
            Standing::Closed => result.answer(Verdict::Closed, &self.telemetry),
            Standing::Agreed => result.answer(Verdict::Duplicate, &self.telemetry),
            Standing::Disputed => {
                tracing::error!(
                    job = %frame.job, frame = frame.frame, round = round.index, tile,
                    worker = result.vote.worker, digest = %result.vote.digest,
                    "DETERMINISM VIOLATION: two results of one task differ; both are kept, the server decides"
                );
                self.keep(&frame, &result).await;
                result.answer(Verdict::Disputed, &self.telemetry);
                let _ = self.farm.send(Event::Disputed(Box::new(result.task)));
            }
            Standing::Upheld(wrong) => {
                result.answer(Verdict::Duplicate, &self.telemetry);
                let _ = self.farm.send(Event::Settled(frame, wrong));
            }
            Standing::Overruled(wrong) => {
                match self.overrule(&result, old).await {
                    Ok(()) => drop(self.farm.send(Event::Settled(Arc::clone(&frame), wrong))),
                    Err(e) => drop(self.farm.send(Event::TileFailed(Arc::clone(&frame), e.to_string()))),
                }
                result.answer(Verdict::Accepted, &self.telemetry);
            }
            Standing::Hopeless => {
                result.answer(Verdict::Disputed, &self.telemetry);
                let text = format!("tile {tile}: three renders of round {} gave three results", round.index);
                let _ = self.farm.send(Event::Hopeless(frame, text));
            }
        }
    }

    /// Keeps both results for whoever looks for the fault; the accepted one is in a pack, which will be deleted.
    async fn keep(&self, frame: &Arc<LiveFrame>, result: &Rendered) {
        let accepted = frame.merged().accepted.get(&result.task.tile).map(|vote| vote.digest);
        let mut kept = vec![result.bytes.clone()];
        let survived = read_stored(&self.blobs, stored(frame, &result.task)).await;
        for (_, bytes) in survived.map(|s| s.packs).unwrap_or_default() {
            let of_pack = results(&bytes, &frame.grid, &result.task.round);
            let all = of_pack.iter().map(karst_core::film::TileResult::to_bytes);
            kept.extend(all.filter(|bytes| Some(Digest::of(bytes)) == accepted));
        }
        for bytes in kept {
            if let Err(e) = self.blobs.put(Kind::Dispute, bytes).await {
                tracing::error!("a disputed result could not be kept: {e}");
            }
        }
    }

    /// Makes the film again with `winner` in the place of the accepted result of its tile.
    async fn overrule(&self, winner: &Rendered, old: &mut Vec<(Kind, Digest)>) -> Result<(), Error> {
        let Task { frame, round, tile, .. } = winner.task.clone();
        let survived = read_stored(&self.blobs, stored(&frame, &winner.task)).await?;
        let mut all = vec![winner.bytes.clone()];
        let mut film = match survived.film {
            Some((film, _)) => film,
            None => Film::new(frame.scene.size(), frame.scene.window(), frame.scene.exposure()),
        };
        let merge = |e: karst_core::film::ResultError| Error::Internal(format!("tile {tile}: {e}"));
        film.merge(&winner.result).map_err(merge)?;
        for result in survived.packs.iter().flat_map(|(_, bytes)| results(bytes, &frame.grid, &round)) {
            if result.tile != tile {
                film.merge(&result).map_err(merge)?;
                all.push(result.to_bytes());
            }
        }
        let packed = Bytes::from(pack(all.iter().map(Vec::as_slice)));
        let pack = persist(|| self.blobs.put(Kind::Pack, packed.clone())).await;
        let (job, number) = (frame.job.to_string(), frame.frame);
        let row = [Row::ReplacePacks { job, frame: number, round: round.index, pack }];
        persist(|| self.state.commit(&row)).await;
        let mut merged = frame.merged();
        old.extend(merged.packs.drain(..).filter(|p| *p != pack).map(|p| (Kind::Pack, p)));
        merged.packs.push(pack);
        merged.film = film;
        merged.version += 1;
        merged.accepted.insert(tile, winner.vote.clone());
        Ok(())
    }
}

fn stored(frame: &LiveFrame, task: &Task) -> StoredRound {
    let merged = frame.merged();
    StoredRound { rounds: task.round.index, film: merged.stored, packs: merged.packs.clone() }
}

/// Renders a disputed task here and gives the result to the ledger. Blocks.
pub(super) fn judge(task: Task, ledger: &mpsc::Sender<Entry>) {
    let Some(result) =
        render_tile(&task.frame.scene, &task.frame.grid, task.tile, &task.round, &task.frame.stop)
    else {
        return;
    };
    let bytes = result.to_bytes();
    let vote = Vote { worker: JUDGE.to_owned(), digest: Digest::of(&bytes) };
    let rendered = Rendered { task, result, bytes, vote, last: true, ack: None };
    if ledger.blocking_send(Entry::Rendered(Box::new(rendered))).is_err() {
        tracing::debug!("the server ends before a dispute is settled");
    }
}

#[cfg(test)]
mod tests {
    use super::Standing;
    use crate::digest::Digest;
    use crate::farm::live::{Merged, Vote};
    use karst_core::film::{Film, FrameSize};
    use std::collections::BTreeMap;

    fn vote(worker: &str, bytes: &str) -> Vote {
        Vote { worker: worker.into(), digest: Digest::of(bytes.as_bytes()) }
    }

    fn merged() -> Merged {
        let size = FrameSize { width: 16, height: 16 };
        Merged {
            film: Film::new(size, size.region(), 0.0),
            rounds: vec![1],
            complete: false,
            stored: None,
            packs: Vec::new(),
            round: 0,
            version: 0,
            accepted: BTreeMap::from([(0, vote("a", "x"))]),
            disputes: BTreeMap::new(),
        }
    }

    #[test]
    fn two_of_three_decide() {
        let mut m = merged();
        assert_eq!(m.vote(0, 0, vote("b", "x")), Standing::Agreed);
        assert_eq!(m.vote(0, 0, vote("b", "y")), Standing::Disputed);
        assert_eq!(m.vote(0, 0, vote("b", "y")), Standing::Disputed, "nobody is heard twice");
        assert_eq!(m.vote(0, 0, vote("a", "y")), Standing::Disputed, "not even the first");
        assert_eq!(m.vote(0, 0, vote("c", "x")), Standing::Upheld(vec!["b".into()]));
        assert!(m.disputes.is_empty());
        assert_eq!(m.vote(0, 0, vote("b", "y")), Standing::Disputed);
        assert_eq!(m.vote(0, 0, vote("c", "y")), Standing::Overruled(vec!["a".into()]));
    }

    #[test]
    fn three_different_results_are_hopeless_and_old_rounds_closed() {
        let mut m = merged();
        assert_eq!(m.vote(1, 0, vote("b", "x")), Standing::Closed);
        assert_eq!(m.vote(0, 0, vote("b", "y")), Standing::Disputed);
        assert_eq!(m.vote(0, 0, vote("c", "z")), Standing::Hopeless);
    }
}
