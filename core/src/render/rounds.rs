//! Owns the plan of the next round: a pure function of what the film knows.
//!
//! Rounds end at totals of 2, 8 and 32 samples per pixel and then double. With a target error, every block gets
//! `min_spp` first; then blocks whose expected error is large get twice their samples. How many samples replicate A
//! gets in a block is decided by what B saw there and around it, and the other way round: whoever stops on his own
//! samples stops more often when they happened to be dark, and the picture would be too dark.

use crate::film::{BlockStats, Film, Round, SampleRange, TileGrid};
use crate::scene::{Goal, Sampling};

/// The round after `done` finished ones; `None` when the frame is finished.
pub fn next_round(sampling: &Sampling, grid: &TileGrid, film: &Film, done: u32) -> Option<Round> {
    match sampling.goal {
        Goal::Fixed { spp } => uniform(grid, done, spp),
        Goal::Error { target, min_spp, max_spp } => {
            uniform(grid, done, min_spp.min(max_spp)).or_else(|| adaptive(grid, film, done, target, max_spp))
        }
    }
}

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

/// Twice the samples where the error is.
fn adaptive(grid: &TileGrid, film: &Film, done: u32, target: f64, max_spp: u32) -> Option<Round> {
    let goal = target * target;
    let measured = film.summary().rel_mse?;
    if measured <= goal {
        return None;
    }
    let stats = film.block_stats();
    let expected = expected_errors(grid, &stats, measured);
    let may_grow = |b: usize, r: usize| stats[b].samples[r].max(1) * 2 <= max_spp / 2;
    let threshold = choose_threshold(&expected, &may_grow, goal);
    let range = |b: usize, r: usize| {
        let n = stats[b].samples[r];
        n..if expected[b][r] >= threshold && may_grow(b, r) { n * 2 } else { n }
    };
    let blocks: Vec<_> = (0..stats.len()).map(|b| SampleRange { a: range(b, 0), b: range(b, 1) }).collect();
    blocks.iter().any(|r| !r.is_empty()).then_some(Round { index: done, blocks })
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
    // Independent samples would err by the variance over their number; ours err by less. One factor for the frame.
    let predicted = expected.iter().map(|e| (e[0] + e[1]) / 4.0).sum::<f64>() / expected.len().max(1) as f64;
    let factor = if predicted > 0.0 { (measured / predicted).clamp(1e-3, 1e3) } else { 1.0 };
    expected.iter_mut().flatten().for_each(|e| *e *= factor);
    expected
}

/// The spread of a block in one replicate, and the largest of its eight neighbours.
fn neighbourhood(stats: &[BlockStats], columns: usize, block: usize, replicate: usize) -> (f64, f64) {
    let (x, y) = (block % columns, block / columns);
    let rows = stats.len() / columns;
    let around = (y.saturating_sub(1)..=(y + 1).min(rows - 1))
        .flat_map(|y| (x.saturating_sub(1)..=(x + 1).min(columns - 1)).map(move |x| y * columns + x));
    let largest = around.map(|b| stats[b].spread[replicate]).fold(0.0, f64::max);
    (stats[block].spread[replicate], largest)
}

/// The largest threshold such that doubling everything above it is expected to reach the goal; 0 when nothing does.
fn choose_threshold(expected: &[[f64; 2]], may_grow: &dyn Fn(usize, usize) -> bool, goal: f64) -> f64 {
    let mut sum: f64 = expected.iter().flatten().sum();
    let mut growing: Vec<f64> = expected
        .iter()
        .enumerate()
        .flat_map(|(b, e)| (0..2).filter(move |&r| may_grow(b, r)).map(move |r| e[r]))
        .collect();
    growing.sort_by(|a, b| b.total_cmp(a));
    // Aim a little below the goal, so that the last round is rarely followed by another.
    let wanted = 0.9 * goal * 4.0 * expected.len() as f64;
    for error in growing {
        sum -= error / 2.0;
        if sum <= wanted {
            return error;
        }
    }
    0.0
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
}
