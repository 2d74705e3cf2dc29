//! Owns what a worker has in hand: leases, and reports that the server has not answered. Pure.
//!
//! A report stays until the server names it, so a server that is away, or an answer that is lost, costs nothing.

use std::collections::{BTreeMap, BTreeSet};

use karst_proto::v1::{Lease, TaskEnd, TaskReport, UpdateWorkerSessionResponse};

/// Bytes of results in one request; a single larger one goes alone.
const MOST_BYTES: usize = 3 << 20;
/// Reports in one request.
const MOST_REPORTS: usize = 256;

/// What a worker has in hand.
#[derive(Debug, Default)]
pub(crate) struct Desk {
    /// Tiles of each lease that have no report yet.
    open: BTreeMap<u64, BTreeSet<u32>>,
    /// Reports without an answer, in the order in which they were made.
    reports: Vec<TaskReport>,
}

impl Desk {
    /// Takes an answer: drops what it names, and returns the leases that are new.
    pub(crate) fn take(&mut self, answer: UpdateWorkerSessionResponse) -> Vec<Lease> {
        let named: BTreeSet<(u64, u32)> = answer.verdicts.iter().map(|v| (v.fence, v.tile)).collect();
        self.reports.retain(|r| !named.contains(&(r.fence, r.tile)));
        for fence in &answer.revoked {
            self.open.remove(fence);
            self.reports.retain(|r| r.fence != *fence);
        }
        let reported: BTreeSet<(u64, u32)> = self.reports.iter().map(|r| (r.fence, r.tile)).collect();
        let mut new = Vec::new();
        for mut lease in answer.leases {
            // The server repeats a lease that it thinks was lost on the way; what is done of it stays done.
            let known = self.open.get(&lease.fence).cloned().unwrap_or_default();
            let in_hand = |tile: u32| known.contains(&tile) || reported.contains(&(lease.fence, tile));
            lease.tiles.retain(|t| !in_hand(t.tile));
            if !lease.tiles.is_empty() {
                self.open.entry(lease.fence).or_default().extend(lease.tiles.iter().map(|t| t.tile));
                new.push(lease);
            }
        }
        new
    }

    /// A task has ended; ignored when its lease was revoked meanwhile.
    pub(crate) fn report(&mut self, report: TaskReport) {
        let Some(open) = self.open.get_mut(&report.fence) else { return };
        if open.remove(&report.tile) {
            self.reports.push(report);
        }
        self.open.retain(|_, tiles| !tiles.is_empty());
    }

    /// Tiles of a lease without a report.
    pub(crate) fn tiles(&self, fence: u64) -> Vec<u32> {
        self.open.get(&fence).map(|tiles| tiles.iter().copied().collect()).unwrap_or_default()
    }

    /// Leases with tasks that the server does not know the end of.
    pub(crate) fn held(&self) -> Vec<u64> {
        self.open
            .keys()
            .copied()
            .chain(self.reports.iter().map(|r| r.fence))
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect()
    }

    /// Reports for the next request: the oldest, as many as fit.
    pub(crate) fn outgoing(&self) -> Vec<TaskReport> {
        let mut bytes = 0;
        let fits = |r: &&TaskReport| {
            bytes += r.result.len() + r.message.len() + 128;
            bytes <= MOST_BYTES
        };
        let count = self.reports.iter().take(MOST_REPORTS).take_while(fits).count();
        self.reports.iter().take(count.max(1)).cloned().collect()
    }

    /// Whether there is something to tell.
    pub(crate) fn has_reports(&self) -> bool {
        !self.reports.is_empty()
    }

    /// Whether there is nothing in hand at all.
    pub(crate) fn is_empty(&self) -> bool {
        self.open.is_empty() && self.reports.is_empty()
    }
}

/// A report without a result.
pub(crate) fn without_result(fence: u64, tile: u32, end: TaskEnd, message: String) -> TaskReport {
    TaskReport { fence, tile, end: end.into(), message, ..TaskReport::default() }
}

#[cfg(test)]
mod tests {
    use super::{Desk, without_result};
    use karst_proto::v1::{Lease, TaskEnd, TaskReport, TaskVerdict, TileTask, UpdateWorkerSessionResponse};

    fn lease(fence: u64, tiles: &[u32]) -> Lease {
        let tiles = tiles.iter().map(|&tile| TileTask { tile, ..TileTask::default() }).collect();
        Lease { fence, tiles, ..Lease::default() }
    }

    fn answer(leases: Vec<Lease>, named: &[(u64, u32)], revoked: &[u64]) -> UpdateWorkerSessionResponse {
        let verdicts =
            named.iter().map(|&(fence, tile)| TaskVerdict { fence, tile, ..Default::default() }).collect();
        UpdateWorkerSessionResponse { verdicts, leases, revoked: revoked.to_vec(), ttl_milliseconds: 1 }
    }

    fn done(fence: u64, tile: u32, bytes: usize) -> TaskReport {
        TaskReport {
            result: vec![0; bytes].into(),
            ..without_result(fence, tile, TaskEnd::Done, String::new())
        }
    }

    #[test]
    fn a_repeated_lease_brings_only_what_is_not_in_hand() {
        let mut desk = Desk::default();
        assert_eq!(desk.take(answer(vec![lease(1, &[0, 1, 2])], &[], &[])).len(), 1);
        desk.report(done(1, 0, 10));
        assert!(desk.take(answer(vec![lease(1, &[0, 1, 2])], &[], &[])).is_empty());
        let again = desk.take(answer(vec![lease(1, &[0])], &[(1, 0)], &[]));
        assert_eq!(again[0].tiles[0].tile, 0, "the server did not take it and wants it again");
    }

    #[test]
    fn reports_stay_until_they_are_named() {
        let mut desk = Desk::default();
        desk.take(answer(vec![lease(7, &[3, 4])], &[], &[]));
        desk.report(done(7, 3, 10));
        desk.report(done(7, 4, 10));
        desk.report(done(8, 4, 10));
        assert_eq!((desk.outgoing().len(), desk.held()), (2, vec![7]));
        desk.take(answer(Vec::new(), &[(7, 3)], &[]));
        assert_eq!(desk.outgoing()[0].tile, 4);
        desk.take(answer(Vec::new(), &[], &[7]));
        assert!(desk.is_empty());
    }

    #[test]
    fn requests_stay_small_and_one_large_result_goes_alone() {
        let mut desk = Desk::default();
        desk.take(answer(vec![lease(1, &[0, 1, 2])], &[], &[]));
        desk.report(done(1, 0, 4 << 20));
        desk.report(done(1, 1, 2 << 20));
        desk.report(done(1, 2, 2 << 20));
        assert_eq!(desk.outgoing().len(), 1);
        desk.take(answer(Vec::new(), &[(1, 0)], &[]));
        assert_eq!(desk.outgoing().len(), 1);
        assert_eq!(desk.held(), [1]);
    }
}
