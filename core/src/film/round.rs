//! Owns the plan of a round: which samples each pixel block gets.

use super::{ResultError, TileGrid};
use std::ops::Range;

/// Sample indices of both replicates.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SampleRange {
    /// Indices within replicate A.
    pub a: Range<u32>,
    /// Indices within replicate B.
    pub b: Range<u32>,
}

impl SampleRange {
    /// Number of samples of both.
    pub fn count(&self) -> u32 {
        self.a.len() as u32 + self.b.len() as u32
    }

    /// Whether there is nothing to take.
    pub fn is_empty(&self) -> bool {
        self.count() == 0
    }
}

/// One round of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Round {
    /// 0 is the first.
    pub index: u32,
    /// One entry for each block of the window; empty ranges mean nothing to do there.
    pub blocks: Vec<SampleRange>,
}

impl Round {
    /// Whether no block of the tile gets samples.
    pub fn tile_is_empty(&self, grid: &TileGrid, tile: u32) -> bool {
        grid.tile_blocks(tile).all(|block| self.blocks[block as usize].is_empty())
    }

    /// Samples that the round takes, over all pixels.
    pub fn samples(&self, grid: &TileGrid) -> u64 {
        (0..self.blocks.len() as u32).map(|block| self.block_samples(grid, block)).sum()
    }

    /// Samples that the round takes in a tile, over all its pixels.
    pub fn tile_samples(&self, grid: &TileGrid, tile: u32) -> u64 {
        grid.tile_blocks(tile).map(|block| self.block_samples(grid, block)).sum()
    }

    fn block_samples(&self, grid: &TileGrid, block: u32) -> u64 {
        u64::from(self.blocks[block as usize].count()) * grid.block_region(block).area() as u64
    }

    /// The round as bytes (little endian), for storage.
    pub fn to_bytes(&self) -> Vec<u8> {
        let numbers = self.blocks.iter().flat_map(|r| [r.a.start, r.a.end, r.b.start, r.b.end]);
        [self.index, self.blocks.len() as u32].into_iter().chain(numbers).flat_map(u32::to_le_bytes).collect()
    }

    /// Reads [`Round::to_bytes`].
    ///
    /// # Errors
    /// The bytes are of another length than they say, or a range ends before it begins.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ResultError> {
        let words: Vec<u32> =
            bytes.chunks_exact(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]])).collect();
        let [index, count, ranges @ ..] = words.as_slice() else { return Err(ResultError::Truncated) };
        if !bytes.len().is_multiple_of(4) || ranges.len() != *count as usize * 4 {
            return Err(ResultError::Truncated);
        }
        let blocks: Vec<_> =
            ranges.chunks_exact(4).map(|r| SampleRange { a: r[0]..r[1], b: r[2]..r[3] }).collect();
        if blocks.iter().any(|r| r.a.start > r.a.end || r.b.start > r.b.end) {
            return Err(ResultError::Plan("a sample range ends before it begins"));
        }
        Ok(Self { index: *index, blocks })
    }
}
