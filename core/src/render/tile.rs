//! Owns rendering a tile of a round: the task that workers run.

use super::accumulate::{Accumulator, SAMPLE_BLOCK};
use crate::film::{BlockResult, Counters, Round, SampleRange, TileGrid, TileResult};
use crate::integrator::{Paths, Stage, StageObserver, Unobserved, Wave, trace};
use crate::math::powf;
use crate::sampler::Replicate;
use crate::scene::Scene;
use crate::sdf::MarchStats;
use std::cell::Cell;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    /// The memory of this thread's waves, about a megabyte, kept from tile to tile: new pages for each cost up to a tenth of
    /// the time of small tiles. What was in it has no influence.
    static PATHS: Cell<Paths> = Cell::default();
}

/// Renders the samples that a round gives to a tile. Pure: the same arguments give the same bytes anywhere.
///
/// `None` when `stop` was set before the end.
pub fn render_tile(
    scene: &Scene,
    grid: &TileGrid,
    tile: u32,
    round: &Round,
    stop: &AtomicBool,
) -> Option<TileResult> {
    render_tile_observed(scene, grid, tile, round, stop, &mut Unobserved)
}

/// [`render_tile`], while `observer` is told which part of the work begins.
pub fn render_tile_observed(
    scene: &Scene,
    grid: &TileGrid,
    tile: u32,
    round: &Round,
    stop: &AtomicBool,
    observer: &mut dyn StageObserver,
) -> Option<TileResult> {
    let mut counters = Counters::default();
    let mut paths = PATHS.take();
    let mut blocks = Vec::new();
    for block in grid.tile_blocks(tile) {
        let range = &round.blocks[block as usize];
        if range.is_empty() {
            continue;
        }
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let pixels: Vec<[u32; 2]> = grid.block_region(block).pixels().collect();
        let (mut sums, work) = render_block(scene, &pixels, range, (&mut paths, &mut counters), observer);
        let spread = sums.spread(grid.block_region(block).width() as usize, powf(2.0, scene.exposure()));
        let (pixels, evaluations) = (sums.pixels(), sums.evaluations());
        blocks.push(BlockResult { block, range: range.clone(), spread, work, pixels, evaluations });
    }
    let mut tally = paths.take_tally();
    PATHS.set(paths);
    counters.sdf_evaluations = tally.evaluations();
    counters.exhausted_rays = tally.exhausted();
    tally.objects.resize(scene.function_count(), MarchStats::default());
    Some(TileResult { tile, round: round.index, blocks, counters, objects: tally.objects })
}

/// The sums of a block, and what each replicate cost.
fn render_block(
    scene: &Scene,
    pixels: &[[u32; 2]],
    range: &SampleRange,
    (paths, counters): (&mut Paths, &mut Counters),
    observer: &mut dyn StageObserver,
) -> (Accumulator, [u32; 2]) {
    let mut sums = Accumulator::new(pixels.len());
    let mut work = [0_u32; 2];
    for (replicate, samples) in [(Replicate::A, &range.a), (Replicate::B, &range.b)] {
        for samples in sample_blocks(samples) {
            let before = counters.rays + counters.shadow_rays;
            trace(scene, &Wave { pixels, replicate, samples }, paths, counters, observer);
            observer.begin(Stage::Accumulate);
            sums.add(paths, replicate, counters);
            let evaluations: u64 = paths.evaluations.iter().copied().map(u64::from).sum();
            let rays = counters.rays + counters.shadow_rays - before + evaluations / EVALUATIONS_OF_A_RAY;
            work[replicate as usize] =
                work[replicate as usize].saturating_add(u32::try_from(rays).unwrap_or(u32::MAX));
        }
    }
    (sums, work)
}

/// Evaluations of distance functions that cost about as much as a ray among triangles.
const EVALUATIONS_OF_A_RAY: u64 = 4;

/// A range cut at multiples of the sample block.
fn sample_blocks(range: &Range<u32>) -> impl Iterator<Item = Range<u32>> + use<> {
    let Range { start, end } = *range;
    let first = start / SAMPLE_BLOCK;
    let last = if start < end { end.div_ceil(SAMPLE_BLOCK) } else { first };
    (first..last).map(move |b| {
        let from = b.saturating_mul(SAMPLE_BLOCK).max(start);
        from..b.saturating_mul(SAMPLE_BLOCK).saturating_add(SAMPLE_BLOCK).min(end)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sample_blocks_cover_a_range_once_and_end_at_multiples() {
        for range in [0..0, 0..1, 1..4, 4..16, 16..64, 5..37] {
            let parts: Vec<_> = sample_blocks(&range).collect();
            let flat: Vec<u32> = parts.iter().cloned().flatten().collect();
            assert_eq!(flat, range.clone().collect::<Vec<_>>());
            assert!(parts.iter().all(|p| p.len() <= 16 && (p.end % 16 == 0 || p.end == range.end)));
        }
    }
}
