//! Owns the plan of the next round: a pure function of what the film knows.
//!
//! Rounds end at totals of 2, 8 and 32 samples per pixel and then double. With a target error, every block gets
//! `min_spp` first; then blocks whose expected error is large get twice their samples. How many samples replicate A
//! gets in a block is decided by what B saw there and around it, and the other way round: whoever stops on his own
//! samples stops more often when they happened to be dark, and the picture would be too dark.

use crate::film::{BlockStats, Film, Round, SampleRange, TileGrid};
use crate::scene::{ErrorOf, Goal, Sampling};

/// The round after `done` finished ones; `None` when the frame is finished.
///
/// `denoised` tells what the relMSE of the denoised picture is at most, where that has to reach a target; `None` where it is
/// unknown.
pub fn next_round(
    sampling: &Sampling,
    grid: &TileGrid,
    film: &Film,
    done: u32,
    denoised: &dyn Fn(&Film) -> Option<f64>,
) -> Option<Round> {
    match sampling.goal {
        Goal::Fixed { spp } => uniform(grid, done, spp),
        Goal::Error { target, min_spp, max_spp, of } => {
            uniform(grid, done, min_spp.min(max_spp)).or_else(|| {
                let noisy = film.summary().rel_mse?;
                let judged = match of {
                    ErrorOf::Noisy => noisy,
                    // As long as nobody can tell, the target is not reached.
                    ErrorOf::Denoised => {
                        denoised(film).filter(|error| !error.is_nan()).unwrap_or(f64::INFINITY)
                    }
                };
                // The noise that would do if the judged picture's error fell as noise does; it falls less, so there are more
                // rounds to come, each of one doubling at most.
                let share = (target * target / judged.max(f64::MIN_POSITIVE)).max(LEAST_SHARE);
                (share < 1.0).then(|| adaptive(grid, film, done, (noisy, noisy * share), max_spp))?
            })
        }
    }
}

/// A round plans for no less of the error than this.
const LEAST_SHARE: f64 = 1e-6;

/// Total samples per pixel at the end of a round.
fn total_after(round: u32) -> u32 {
    match round {
        0 => 2,
        1 => 8,
        _ => 32_u32.checked_shl(round - 2).filter(|t| *t >= 32).unwrap_or(u32::MAX),
    }
}

/// The same samples everywhere, up to `spp`.
fn uniform(grid: &TileGrid, done: u32, spp: u32) -> Option<Round> {
    let start = if done == 0 { 0 } else { total_after(done - 1).min(spp) };
    let end = total_after(done).min(spp);
    let a = start.div_ceil(2)..end.div_ceil(2);
    let b = start / 2..end / 2;
    (start < end)
        .then(|| Round { index: done, blocks: vec![SampleRange { a, b }; grid.block_count() as usize] })
}

/// Twice the samples where they bring most.
fn adaptive(
    grid: &TileGrid,
    film: &Film,
    done: u32,
    (measured, goal): (f64, f64),
    max_spp: u32,
) -> Option<Round> {
    let stats = film.block_stats();
    let expected = expected_errors(grid, &stats, measured);
    let halves: Vec<Half> = stats
        .iter()
        .zip(&expected)
        .flat_map(|(block, expected)| (0..2).map(|r| Half::new(block, r, expected[r], max_spp / 2)))
        .collect();
    let worth = choose_worth(&halves, goal);
    let range = |half: &Half| half.samples..half.samples << half.doublings(worth).min(1);
    let blocks: Vec<_> =
        halves.chunks_exact(2).map(|half| SampleRange { a: range(&half[0]), b: range(&half[1]) }).collect();
    blocks.iter().any(|r| !r.is_empty()).then_some(Round { index: done, blocks })
}

/// One replicate of a block.
struct Half {
    samples: u32,
    /// Squared relative error that it is expected to have.
    expected: f64,
    /// What all its samples cost in rays, judged by the other replicate, with one for the sample itself.
    cost: f64,
    /// How often its samples may double.
    most: u32,
}

impl Half {
    fn new(block: &BlockStats, replicate: usize, expected: f64, max_samples: u32) -> Self {
        let samples = block.samples[replicate].max(1);
        let cost = f64::from(samples) * (1.0 + block.cost[1 - replicate]);
        Self { samples, expected, cost, most: (max_samples / samples).checked_ilog2().unwrap_or(0) }
    }

    /// What the samples are worth: squared error per ray.
    fn worth(&self) -> f64 {
        self.expected / self.cost
    }

    /// How often its samples double until they are worth less than `worth`: a doubling takes half of the error and costs as
    /// much as all before, so that each next one is worth a quarter.
    fn doublings(&self, worth: f64) -> u32 {
        // Where the goal is out of reach, nothing is taken for converged.
        if worth <= 0.0 {
            return self.most;
        }
        let mut doublings = 0;
        let mut left = self.worth();
        while left >= worth && doublings < self.most {
            left *= 0.25;
            doublings += 1;
        }
        doublings
    }
}

/// What a sample must be worth so that the halves, doubled as long as they are worth it, are expected to reach the goal; 0 when
/// they can not.
///
/// Only the first of these doublings is taken: what is known of a block is better after it. But where the others will be is
/// decided now, else all blocks would grow as long as the goal is more than one doubling away.
fn choose_worth(halves: &[Half], goal: f64) -> f64 {
    // Aim a little below the goal, so that the last round is rarely followed by another.
    let wanted = 0.9 * goal * 2.0 * halves.len() as f64;
    let reached = |worth: f64| {
        let left: f64 =
            halves.iter().map(|half| half.expected / f64::from(1_u32 << half.doublings(worth).min(31))).sum();
        left <= wanted
    };
    let largest = halves.iter().map(Half::worth).fold(0.0, f64::max);
    // Halve the interval of its logarithm: fifty octaves are more than samples can double in.
    let (mut low, mut high) = (largest * 2.0_f64.powi(-50), largest);
    if !reached(low) {
        return 0.0;
    }
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        *(if reached(middle) { &mut low } else { &mut high }) = middle;
    }
    low
}

/// Squared relative error that each replicate of each block is expected to have, judged by the other replicate.
fn expected_errors(grid: &TileGrid, stats: &[BlockStats], measured: f64) -> Vec<[f64; 2]> {
    let columns = grid.block_columns() as usize;
    let mut expected: Vec<[f64; 2]> = (0..stats.len())
        .map(|b| {
            std::array::from_fn(|r| {
                let (own, around) = neighbourhood(stats, columns, b, 1 - r);
                // What a block has not seen yet its neighbours may have: no variance is not taken for converged.
                own.max(around / 8.0) / f64::from(stats[b].samples[r].max(1))
            })
        })
        .collect();
    // Independent samples would err by the variance over their number; ours err by less, and the more the smoother a part of the
    // picture is. How much less, the blocks around know: what this one's own samples say must not decide on them.
    let predicted: Vec<f64> = expected.iter().map(|e| (e[0] + e[1]) / 4.0).collect();
    let frame = [measured, predicted.iter().sum::<f64>() / predicted.len().max(1) as f64];
    for (b, expected) in expected.iter_mut().enumerate() {
        let mut sums = frame;
        for other in around(stats.len(), columns, b).filter(|&other| other != b) {
            sums[0] += stats[other].rel_mse.unwrap_or(0.0);
            sums[1] += predicted[other];
        }
        let factor = if sums[1] > 0.0 { (sums[0] / sums[1]).clamp(1e-3, 1e3) } else { 1.0 };
        *expected = expected.map(|e| e * factor);
    }
    expected
}

/// The spread of a block in one replicate, and the largest of it and its eight neighbours.
fn neighbourhood(stats: &[BlockStats], columns: usize, block: usize, replicate: usize) -> (f64, f64) {
    let spread = |b: usize| stats[b].spread[replicate];
    (spread(block), around(stats.len(), columns, block).map(spread).fold(0.0, f64::max))
}

/// A block of so many and its eight neighbours.
fn around(blocks: usize, columns: usize, block: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (block % columns, block / columns);
    let rows = blocks / columns;
    (y.saturating_sub(1)..=(y + 1).min(rows - 1))
        .flat_map(move |y| (x.saturating_sub(1)..=(x + 1).min(columns - 1)).map(move |x| y * columns + x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Region;

    #[test]
    fn uniform_rounds_end_at_their_totals_and_the_last_at_spp() {
        let grid = TileGrid::new(Region { x0: 0, y0: 0, x1: 40, y1: 20 }, 16);
        let ends = |spp| {
            let rounds: Vec<Round> = (0..).map_while(|done| uniform(&grid, done, spp)).collect();
            rounds.iter().map(|r| r.blocks[0].a.end + r.blocks[0].b.end).collect::<Vec<_>>()
        };
        assert_eq!(ends(1), [1]);
        assert_eq!(ends(2), [2]);
        assert_eq!(ends(100), [2, 8, 32, 64, 100]);
        assert_eq!(ends(5), [2, 5]);
        assert_eq!(ends(u32::MAX).last(), Some(&u32::MAX));
        let one = uniform(&grid, 0, 1).unwrap();
        assert_eq!((one.blocks[0].a.clone(), one.blocks[0].b.clone()), (0..1, 0..0));
    }

    fn half(expected: f64, cost: f64) -> Half {
        Half { samples: 16, expected, cost, most: 4 }
    }

    #[test]
    fn samples_go_where_they_take_most_error_for_their_cost() {
        let halves = [half(1.0, 16.0), half(0.1, 16.0), half(1.0, 1600.0), half(0.0, 16.0)];
        let left =
            |worth: f64| halves.iter().map(|h| h.expected / f64::from(1 << h.doublings(worth))).sum::<f64>();
        for goal in [0.2, 0.1, 0.05] {
            let worth = choose_worth(&halves, goal);
            let wanted = 0.9 * goal * 8.0;
            assert!(left(worth) <= wanted && left(worth * 1.001) > wanted, "{goal}: {}", left(worth));
            let doublings: Vec<u32> = halves.iter().map(|h| h.doublings(worth)).collect();
            assert!(
                doublings[0] > doublings[1] && doublings[0] > doublings[2] && doublings[3] == 0,
                "{doublings:?}"
            );
        }
        // Out of reach: all take what they may.
        assert_eq!(choose_worth(&halves, 1e-3), 0.0);
        assert!(halves.iter().all(|h| h.doublings(0.0) == 4));
        // Nothing known to be wrong, but the goal not reached: all go on.
        let dark = [half(0.0, 16.0), half(0.0, 16.0)];
        assert!(dark.iter().all(|h| h.doublings(choose_worth(&dark, 1e-9)) == 4));
    }
}
