//! Owns counting what rays cost while they look for what they meet.

use crate::sdf::MarchStats;

/// Counts of rays against objects made of distance functions, and of rays that gave up.
#[derive(Debug, Default)]
pub struct Tally {
    /// By object, in the order of the document; objects that no ray came near may be missing at the end.
    pub objects: Vec<MarchStats>,
    /// Rays that had too many surfaces to cross.
    pub lost: u64,
    evaluations: u64,
}

impl Tally {
    /// Adds what an object cost.
    pub(super) fn add(&mut self, number: u32, stats: &MarchStats) {
        let number = number as usize;
        if number >= self.objects.len() {
            self.objects.resize(number + 1, MarchStats::default());
        }
        self.objects[number].add(stats);
        self.evaluations += stats.evaluations;
    }

    /// Evaluations of all objects.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Rays that gave up: out of steps, or out of surfaces that they may cross.
    pub fn exhausted(&self) -> u64 {
        self.lost + self.objects.iter().map(|object| object.exhausted).sum::<u64>()
    }
}
