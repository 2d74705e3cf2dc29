//! Owns what a rendered tile carries: sums of its samples, and their bytes as they are hashed, stored and sent.

use super::{Region, Round, SampleRange, TileGrid};
use crate::sdf::MarchStats;
use glam::Vec3;
use half::f16;

/// Why bytes are not a result, a round or a film.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ResultError {
    /// The bytes are of another kind or version.
    #[error("not a {0} of this version")]
    Kind(&'static str),
    /// The bytes end early or go on too long.
    #[error("the length of the bytes does not fit their content")]
    Truncated,
    /// The content is not what the plan of the round asks for.
    #[error("the content does not fit the plan of the round: {0}")]
    Plan(&'static str),
}

/// What rendering counted. Only sums, so that order does not matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Camera samples taken.
    pub samples: u64,
    /// Closest-hit rays.
    pub rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Samples dropped because they were not a number.
    pub nan_samples: u64,
    /// Samples dropped because they were infinite.
    pub infinite_samples: u64,
    /// Evaluations of distance functions.
    pub sdf_evaluations: u64,
    /// Rays that ran out of marching steps.
    pub exhausted_rays: u64,
}

impl Counters {
    const WORDS: usize = 7;

    /// Adds another's counts.
    pub fn add(&mut self, other: &Self) {
        let sums: Vec<u64> = self.words().iter().zip(other.words()).map(|(a, b)| a + b).collect();
        *self = Self::from_words(&sums);
    }

    fn words(&self) -> [u64; Self::WORDS] {
        [
            self.samples,
            self.rays,
            self.shadow_rays,
            self.nan_samples,
            self.infinite_samples,
            self.sdf_evaluations,
            self.exhausted_rays,
        ]
    }

    fn from_words(w: &[u64]) -> Self {
        Self {
            samples: w[0],
            rays: w[1],
            shadow_rays: w[2],
            nan_samples: w[3],
            infinite_samples: w[4],
            sdf_evaluations: w[5],
            exhausted_rays: w[6],
        }
    }
}

/// What one round adds to one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelSums {
    /// Sum of the samples of replicate A.
    pub a: Vec3,
    /// Sum of the samples of replicate B.
    pub b: Vec3,
    /// Mean albedo over the samples of the round.
    pub albedo: [f16; 3],
    /// Mean shading normal over the samples of the round.
    pub normal: [f16; 3],
    /// Smallest distance to the first surface; infinite where there is none.
    pub depth: f32,
    /// Mean luminance over the samples of the round of the lights that are seen, themselves or behind nothing but mirrors
    /// and panes.
    pub emission: f16,
}

impl PixelSums {
    /// Nothing yet.
    pub const ZERO: Self = Self {
        a: Vec3::ZERO,
        b: Vec3::ZERO,
        albedo: [f16::ZERO; 3],
        normal: [f16::ZERO; 3],
        depth: f32::INFINITY,
        emission: f16::ZERO,
    };
    pub(super) const BYTES: usize = 42;

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        for v in [self.a.x, self.a.y, self.a.z, self.b.x, self.b.y, self.b.z] {
            out.extend(v.to_le_bytes());
        }
        for h in self.albedo.iter().chain(&self.normal) {
            out.extend(h.to_le_bytes());
        }
        out.extend(self.depth.to_le_bytes());
        out.extend(self.emission.to_le_bytes());
    }

    pub(super) fn read(reader: &mut Reader<'_>) -> Result<Self, ResultError> {
        let mut vec3 =
            || -> Result<Vec3, ResultError> { Ok(Vec3::new(reader.f32()?, reader.f32()?, reader.f32()?)) };
        let (a, b) = (vec3()?, vec3()?);
        let mut half3 =
            || -> Result<[f16; 3], ResultError> { Ok([reader.f16()?, reader.f16()?, reader.f16()?]) };
        let (albedo, normal) = (half3()?, half3()?);
        Ok(Self { a, b, albedo, normal, depth: reader.f32()?, emission: reader.f16()? })
    }
}

/// What one round adds to one block.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockResult {
    /// Which block.
    pub block: u32,
    /// The samples taken, the same for every pixel.
    pub range: SampleRange,
    /// Mean over pixels and channels of the relative variance of one sample, by replicate A and by replicate B;
    /// 0 where the round took fewer than two.
    pub spread: [f32; 2],
    /// What the samples of replicates A and B cost, in rays.
    pub work: [u32; 2],
    /// Its pixels, row by row.
    pub pixels: Vec<PixelSums>,
    /// Evaluations of distance functions by pixel; empty where the scene has none.
    pub evaluations: Vec<u32>,
}

/// The result of a task (frame, round, tile).
#[derive(Debug, Clone, PartialEq)]
pub struct TileResult {
    /// Which tile of the grid.
    pub tile: u32,
    /// Which round.
    pub round: u32,
    /// Blocks that got samples, in increasing order.
    pub blocks: Vec<BlockResult>,
    /// What was counted.
    pub counters: Counters,
    /// What rays cost by object made of distance functions, in the order of the document.
    pub objects: Vec<MarchStats>,
}

impl TileResult {
    const MAGIC: [u8; 4] = *b"KTR3";

    /// The result as bytes, little endian: what is hashed, stored and sent.
    pub fn to_bytes(&self) -> Vec<u8> {
        let pixels: usize = self.blocks.iter().map(|b| b.pixels.len()).sum();
        let bytes = pixels * (PixelSums::BYTES + 4) + self.objects.len() * OBJECT_BYTES;
        let mut out = Vec::with_capacity(128 + self.blocks.len() * 36 + bytes);
        out.extend(Self::MAGIC);
        for word in [self.tile, self.round, self.blocks.len() as u32] {
            out.extend(word.to_le_bytes());
        }
        write_counters(&self.counters, &self.objects, &mut out);
        for block in &self.blocks {
            let range = &block.range;
            for word in [block.block, range.a.start, range.a.end, range.b.start, range.b.end] {
                out.extend(word.to_le_bytes());
            }
            out.extend(block.spread.iter().flat_map(|s| s.to_le_bytes()));
            out.extend(block.work.iter().flat_map(|w| w.to_le_bytes()));
            for pixel in &block.pixels {
                pixel.write(&mut out);
            }
            out.extend(block.evaluations.iter().flat_map(|e| e.to_le_bytes()));
        }
        out
    }

    /// Reads [`TileResult::to_bytes`] and holds it against the plan: exactly the blocks and samples that the round
    /// gives the tile.
    ///
    /// # Errors
    /// The bytes are not a result, or not the one that was asked for.
    pub fn from_bytes(bytes: &[u8], grid: &TileGrid, round: &Round) -> Result<Self, ResultError> {
        let mut reader = Reader::new(bytes, Self::MAGIC, "tile result")?;
        let (tile, index, count) = (reader.u32()?, reader.u32()?, reader.u32()?);
        if tile >= grid.tile_count() || index != round.index {
            return Err(ResultError::Plan("another tile or round"));
        }
        let (counters, objects) = reader.counters()?;
        let planned: Vec<u32> =
            grid.tile_blocks(tile).filter(|&b| !round.blocks[b as usize].is_empty()).collect();
        if planned.len() != count as usize {
            return Err(ResultError::Plan("another number of blocks"));
        }
        let counted = !objects.is_empty();
        let read = |block| Self::read_block(&mut reader, block, round, grid.block_region(block), counted);
        let blocks = planned.into_iter().map(read).collect::<Result<_, _>>()?;
        reader.finish()?;
        Ok(Self { tile, round: index, blocks, counters, objects })
    }

    fn read_block(
        reader: &mut Reader<'_>,
        block: u32,
        round: &Round,
        region: Region,
        counted: bool,
    ) -> Result<BlockResult, ResultError> {
        let found = reader.u32()?;
        let range = SampleRange { a: reader.u32()?..reader.u32()?, b: reader.u32()?..reader.u32()? };
        if found != block || range != round.blocks[block as usize] {
            return Err(ResultError::Plan("another block or sample range"));
        }
        let spread = [reader.f32()?, reader.f32()?];
        let work = [reader.u32()?, reader.u32()?];
        let pixels = (0..region.area()).map(|_| PixelSums::read(reader)).collect::<Result<_, _>>()?;
        let evaluations = reader.evaluations(if counted { region.area() } else { 0 })?;
        Ok(BlockResult { block, range, spread, work, pixels, evaluations })
    }
}

/// Reads little-endian numbers and never past the end.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8], magic: [u8; 4], kind: &'static str) -> Result<Self, ResultError> {
        bytes.strip_prefix(&magic).map(|bytes| Self { bytes }).ok_or(ResultError::Kind(kind))
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ResultError> {
        let (head, rest) = self.bytes.split_first_chunk::<N>().ok_or(ResultError::Truncated)?;
        self.bytes = rest;
        Ok(*head)
    }

    pub(super) fn u32(&mut self) -> Result<u32, ResultError> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, ResultError> {
        self.take().map(u64::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, ResultError> {
        self.take().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, ResultError> {
        self.take().map(f64::from_le_bytes)
    }

    fn f16(&mut self) -> Result<f16, ResultError> {
        self.take().map(f16::from_le_bytes)
    }

    /// What [`write_counters`] wrote.
    pub(super) fn counters(&mut self) -> Result<(Counters, Vec<MarchStats>), ResultError> {
        let mut words = [0; Counters::WORDS];
        for word in &mut words {
            *word = self.u64()?;
        }
        let count = self.u32()? as usize;
        if count > self.left() / OBJECT_BYTES {
            return Err(ResultError::Truncated);
        }
        let mut object = || -> Result<MarchStats, ResultError> {
            Ok(MarchStats {
                rays: self.u64()?,
                evaluations: self.u64()?,
                exhausted: self.u64()?,
                overshoots: self.u64()?,
                brackets: self.u64()?,
            })
        };
        let objects = (0..count).map(|_| object()).collect::<Result<_, _>>()?;
        Ok((Counters::from_words(&words), objects))
    }

    /// Numbers of evaluations of so many pixels.
    pub(super) fn evaluations(&mut self, pixels: usize) -> Result<Vec<u32>, ResultError> {
        (0..pixels).map(|_| self.u32()).collect()
    }

    /// Bytes that are left.
    pub(super) fn left(&self) -> usize {
        self.bytes.len()
    }

    pub(super) fn finish(&self) -> Result<(), ResultError> {
        if self.bytes.is_empty() { Ok(()) } else { Err(ResultError::Truncated) }
    }
}

/// Bytes of what is counted of one object.
const OBJECT_BYTES: usize = 40;

pub(super) fn write_counters(counters: &Counters, objects: &[MarchStats], out: &mut Vec<u8>) {
    out.extend(counters.words().iter().flat_map(|w| w.to_le_bytes()));
    out.extend((objects.len() as u32).to_le_bytes());
    for object in objects {
        let MarchStats { rays, evaluations, exhausted, overshoots, brackets } = object;
        for word in [rays, evaluations, exhausted, overshoots, brackets] {
            out.extend(word.to_le_bytes());
        }
    }
}
