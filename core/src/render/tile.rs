//! Owns rendering a tile of a round: the task that workers run.

use super::accumulate::{Accumulator, SAMPLE_BLOCK};
use crate::film::{BlockResult, Counters, Round, SampleRange, TileGrid, TileResult};
use crate::integrator::{Paths, Wave, trace};
use crate::math::powf;
use crate::sampler::Replicate;
use crate::scene::Scene;
use crate::sdf::MarchStats;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

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
    let mut counters = Counters::default();
    let mut paths = Paths::default();
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
        let mut sums = render_block(scene, &pixels, range, &mut paths, &mut counters);
        let spread = sums.spread(powf(2.0, scene.exposure()));
        let (pixels, evaluations) = (sums.pixels(), sums.evaluations());
        blocks.push(BlockResult { block, range: range.clone(), spread, pixels, evaluations });
    }
    let mut tally = paths.take_tally();
    counters.sdf_evaluations = tally.evaluations();
    counters.exhausted_rays = tally.exhausted();
    tally.objects.resize(scene.function_count(), MarchStats::default());
    Some(TileResult { tile, round: round.index, blocks, counters, objects: tally.objects })
}

fn render_block(
    scene: &Scene,
    pixels: &[[u32; 2]],
    range: &SampleRange,
    paths: &mut Paths,
    counters: &mut Counters,
) -> Accumulator {
    let mut sums = Accumulator::new(pixels.len());
    for (replicate, samples) in [(Replicate::A, &range.a), (Replicate::B, &range.b)] {
        for samples in sample_blocks(samples) {
            trace(scene, &Wave { pixels, replicate, samples }, paths, counters);
            sums.add(paths, replicate, counters);
        }
    }
    sums
}

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
