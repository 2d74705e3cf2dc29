//! Owns the merged state of a frame: per pixel the sums of two replicates and the auxiliary layers, per block the
//! sample counts and what error estimates need.
//!
//! Results are merged once each and rounds in order, so that the sums are the same whatever order the tiles of a
//! round arrive in.

use super::error::{Errors, block_errors, replicates};
use super::result::{Reader, write_counters};
use super::{BLOCK, Counters, FrameSize, Picture, PixelSums, Region, ResultError, TileGrid, TileResult};
use crate::sdf::MarchStats;
use glam::Vec3;
use half::f16;

/// What the plan of the next round needs to know of a block.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BlockStats {
    /// Samples per pixel of replicates A and B.
    pub samples: [u32; 2],
    /// Relative variance of one sample as A and as B saw it, averaged over the block; 0 where unknown.
    pub spread: [f64; 2],
    /// Rays that a sample of a pixel costs, as A and as B saw it; 0 where unknown.
    pub cost: [f64; 2],
    /// Estimate of the block's relMSE from the difference of the replicates; `None` until both have samples.
    pub rel_mse: Option<f64>,
}

/// Error and cost of a frame so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameSummary {
    /// relMSE = mean((x − truth)² / (truth² + 0.01)) at the film's exposure, estimated; `None` while only one
    /// replicate has samples.
    pub rel_mse: Option<f64>,
    /// Its 95 % interval, from the spread between pixels.
    pub rel_mse_ci95: Option<[f64; 2]>,
    /// Root of the mean squared error, estimated.
    pub rmse: Option<f64>,
    /// Camera samples taken.
    pub samples: u64,
    /// Mean samples per pixel.
    pub spp_mean: f64,
    /// Fewest samples of a pixel.
    pub spp_min: u32,
    /// Most samples of a pixel.
    pub spp_max: u32,
    /// What rendering counted.
    pub counters: Counters,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Block {
    samples: [u32; 2],
    /// Σ over rounds of (samples · relative variance), and the samples that went into it.
    spread: [f64; 2],
    spread_samples: [u32; 2],
    /// Rays cast so far.
    work: [u64; 2],
}

/// The merged state of one frame; 44 bytes a pixel, 48 in scenes with distance functions.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    size: FrameSize,
    grid: TileGrid,
    /// 2 to the power of the film's exposure: errors are judged as they will be seen.
    scale: f32,
    blocks: Vec<Block>,
    /// Block by block, each row by row, so that a tile touches whole runs.
    pixels: Vec<Vec<PixelSums>>,
    /// Evaluations of distance functions, in the order of `pixels`; empty where there are none.
    evaluations: Vec<Vec<u32>>,
    counters: Counters,
    /// What rays cost by object made of distance functions.
    objects: Vec<MarchStats>,
}

impl Film {
    const MAGIC: [u8; 4] = *b"KFM3";

    /// An empty film over `window`; `exposure` in stops scales the error measure.
    pub fn new(size: FrameSize, window: Region, exposure: f32) -> Self {
        let grid = TileGrid::new(window, BLOCK);
        let count = grid.block_count();
        Self {
            size,
            grid,
            scale: crate::math::powf(2.0, exposure),
            blocks: vec![Block::default(); count as usize],
            pixels: (0..count).map(|b| vec![PixelSums::ZERO; grid.block_region(b).area()]).collect(),
            evaluations: vec![Vec::new(); count as usize],
            counters: Counters::default(),
            objects: Vec::new(),
        }
    }

    /// What rays cost by object made of distance functions, in the order of the document; empty before the first
    /// result.
    pub fn objects(&self) -> &[MarchStats] {
        &self.objects
    }

    /// The rendered part of the frame.
    pub fn window(&self) -> Region {
        self.grid.window()
    }

    /// The full frame.
    pub fn size(&self) -> FrameSize {
        self.size
    }

    /// Adds a result. Each (round, tile) once, rounds in order; the tiles of a round in any order.
    ///
    /// # Errors
    /// The result's blocks or samples do not continue what the film holds; nothing is added then.
    pub fn merge(&mut self, result: &TileResult) -> Result<(), ResultError> {
        let functions = result.objects.len();
        if self.counters.samples > 0 && functions != self.objects.len() {
            return Err(ResultError::Plan("another number of objects made of distance functions"));
        }
        for block in &result.blocks {
            let Some(have) = self.blocks.get(block.block as usize) else {
                return Err(ResultError::Plan("a block outside the film"));
            };
            let starts = [block.range.a.start, block.range.b.start];
            if starts != have.samples || block.pixels.len() != self.pixels[block.block as usize].len() {
                return Err(ResultError::Plan("samples that do not continue the film's"));
            }
            if block.evaluations.len() != if functions > 0 { block.pixels.len() } else { 0 } {
                return Err(ResultError::Plan("evaluations of another number of pixels"));
            }
        }
        for block in &result.blocks {
            self.merge_block(block);
        }
        self.counters.add(&result.counters);
        self.objects.resize(functions, MarchStats::default());
        for (object, more) in self.objects.iter_mut().zip(&result.objects) {
            object.add(more);
        }
        Ok(())
    }

    fn merge_block(&mut self, from: &super::BlockResult) {
        let block = &mut self.blocks[from.block as usize];
        let before = block.samples[0] + block.samples[1];
        let added = [from.range.a.len() as u32, from.range.b.len() as u32];
        for (r, &added) in added.iter().enumerate() {
            block.samples[r] += added;
            block.work[r] += u64::from(from.work[r]);
            if added >= 2 {
                block.spread[r] += f64::from(added) * f64::from(from.spread[r]);
                block.spread_samples[r] += added;
            }
        }
        let weight = (added[0] + added[1]) as f32 / (before + added[0] + added[1]).max(1) as f32;
        for (pixel, new) in self.pixels[from.block as usize].iter_mut().zip(&from.pixels) {
            pixel.a += new.a;
            pixel.b += new.b;
            pixel.depth = pixel.depth.min(new.depth);
            blend(&mut pixel.albedo, new.albedo, weight);
            blend(&mut pixel.normal, new.normal, weight);
            blend(std::array::from_mut(&mut pixel.emission), [new.emission], weight);
        }
        let evaluations = &mut self.evaluations[from.block as usize];
        evaluations.resize(from.evaluations.len(), 0);
        for (sum, more) in evaluations.iter_mut().zip(&from.evaluations) {
            *sum = sum.saturating_add(*more);
        }
    }

    /// What the plan of the next round needs, one entry a block.
    pub fn block_stats(&self) -> Vec<BlockStats> {
        (0..self.blocks.len()).map(|b| self.stats_of(b)).collect()
    }

    fn stats_of(&self, index: usize) -> BlockStats {
        let block = &self.blocks[index];
        let spread = std::array::from_fn(|r| block.spread[r] / f64::from(block.spread_samples[r].max(1)));
        let both = block.samples[0] > 0 && block.samples[1] > 0;
        let rel_mse = both.then(|| self.errors_of(index).relative / self.pixels[index].len().max(1) as f64);
        let cost = std::array::from_fn(|r| {
            block.work[r] as f64
                / (f64::from(block.samples[r].max(1)) * self.pixels[index].len().max(1) as f64)
        });
        BlockStats { samples: block.samples, spread, cost, rel_mse }
    }

    /// Error and cost so far.
    pub fn summary(&self) -> FrameSummary {
        let pixels = self.window().area().max(1) as f64;
        let spp = || self.blocks.iter().map(|b| b.samples[0] + b.samples[1]);
        let samples: u64 = self
            .blocks
            .iter()
            .zip(&self.pixels)
            .map(|(b, p)| u64::from(b.samples[0] + b.samples[1]) * p.len() as u64)
            .sum();
        let mut summary = FrameSummary {
            samples,
            spp_mean: samples as f64 / pixels,
            spp_min: spp().min().unwrap_or(0),
            spp_max: spp().max().unwrap_or(0),
            counters: self.counters,
            ..FrameSummary::default()
        };
        if self.blocks.iter().all(|b| b.samples[0] > 0 && b.samples[1] > 0) {
            let mut errors = Errors::default();
            (0..self.blocks.len()).for_each(|index| errors.add(&self.errors_of(index)));
            summary.rel_mse = Some(errors.relative / pixels);
            summary.rel_mse_ci95 = Some(errors.interval(pixels));
            summary.rmse = Some((errors.absolute / pixels).sqrt());
        }
        summary
    }

    /// Sums over the pixels of a block.
    fn errors_of(&self, index: usize) -> Errors {
        let width = self.grid.block_region(index as u32).width() as usize;
        block_errors(&self.pixels[index], width, self.blocks[index].samples, f64::from(self.scale))
    }

    /// The whole window, resolved.
    pub fn picture(&self) -> Picture {
        self.region(self.window())
    }

    /// What each replicate by itself makes of the window, linear Rec.709, row by row; `None` while a pixel has samples in one
    /// of them only.
    pub fn replicates(&self) -> Option<[Vec<Vec3>; 2]> {
        let window = self.window();
        let mut planes = [vec![Vec3::ZERO; window.area()], vec![Vec3::ZERO; window.area()]];
        for (index, block) in self.blocks.iter().enumerate() {
            if block.samples.contains(&0) {
                return None;
            }
            let places = self.grid.block_region(index as u32).pixels();
            for ([x, y], pixel) in places.zip(&self.pixels[index]) {
                let to = (y - window.y0) as usize * window.width() as usize + (x - window.x0) as usize;
                for (plane, half) in planes.iter_mut().zip(replicates(pixel, block.samples)) {
                    plane[to] = half;
                }
            }
        }
        Some(planes)
    }

    /// A part of the window, resolved; clipped to it.
    pub fn region(&self, region: Region) -> Picture {
        let window = region.intersection(&self.window());
        let n = window.area();
        let mut picture = Picture {
            size: self.size,
            window,
            color: vec![Vec3::ZERO; n],
            albedo: vec![Vec3::ZERO; n],
            normal: vec![Vec3::ZERO; n],
            depth: vec![f32::INFINITY; n],
            samples: vec![0.0; n],
            error: vec![f32::INFINITY; n],
            evaluations: if self.objects.is_empty() { Vec::new() } else { vec![0.0; n] },
        };
        for block in self.grid.blocks_of(window) {
            let of_block = self.grid.block_region(block);
            let part = of_block.intersection(&window);
            self.resolve_block(block as usize, of_block, part, &mut picture);
        }
        picture
    }

    fn resolve_block(&self, block: usize, of_block: Region, part: Region, picture: &mut Picture) {
        let samples = self.blocks[block].samples;
        let error = self.stats_of(block).rel_mse.map_or(f32::INFINITY, |e| e.sqrt() as f32);
        for [x, y] in part.pixels() {
            let from = ((y - of_block.y0) * of_block.width() + x - of_block.x0) as usize;
            let to = (y - picture.window.y0) as usize * picture.window.width() as usize
                + (x - picture.window.x0) as usize;
            let pixel = &self.pixels[block][from];
            picture.color[to] = mean(pixel, samples);
            picture.albedo[to] = to_vec3(pixel.albedo);
            picture.normal[to] = to_vec3(pixel.normal);
            picture.depth[to] = pixel.depth;
            picture.samples[to] = (samples[0] + samples[1]) as f32;
            picture.error[to] = error;
            if let Some(&sum) = self.evaluations[block].get(from) {
                picture.evaluations[to] = sum as f32 / (samples[0] + samples[1]).max(1) as f32;
            }
        }
    }

    /// The film as bytes, little endian: a checkpoint.
    pub fn to_bytes(&self) -> Vec<u8> {
        let w = self.window();
        let mut out = Vec::with_capacity(128 + self.blocks.len() * 48 + w.area() * PixelSums::BYTES);
        out.extend(Self::MAGIC);
        for word in [self.size.width, self.size.height, w.x0, w.y0, w.x1, w.y1] {
            out.extend(word.to_le_bytes());
        }
        out.extend(self.scale.to_le_bytes());
        write_counters(&self.counters, &self.objects, &mut out);
        for ((block, pixels), evaluations) in self.blocks.iter().zip(&self.pixels).zip(&self.evaluations) {
            for word in block.samples.iter().chain(&block.spread_samples) {
                out.extend(word.to_le_bytes());
            }
            out.extend(block.spread.iter().flat_map(|s| s.to_le_bytes()));
            out.extend(block.work.iter().flat_map(|w| w.to_le_bytes()));
            for pixel in pixels {
                pixel.write(&mut out);
            }
            // Blocks without samples have none yet, and so many zeros in the file.
            let missing = if self.objects.is_empty() { 0 } else { pixels.len() - evaluations.len() };
            let counted = evaluations.iter().copied().chain(std::iter::repeat_n(0, missing));
            out.extend(counted.flat_map(u32::to_le_bytes));
        }
        out
    }

    /// Reads [`Film::to_bytes`]; allocates no more than the bytes can fill.
    ///
    /// # Errors
    /// The bytes are not a film.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ResultError> {
        let mut reader = Reader::new(bytes, Self::MAGIC, "film")?;
        let size = FrameSize { width: reader.u32()?, height: reader.u32()? };
        let window = Region { x0: reader.u32()?, y0: reader.u32()?, x1: reader.u32()?, y1: reader.u32()? };
        let scale = reader.f32()?;
        let (counters, objects) = reader.counters()?;
        if window.intersection(&size.region()) != window || window.area() > reader.left() / PixelSums::BYTES {
            return Err(ResultError::Truncated);
        }
        let counted = !objects.is_empty();
        let mut film = Self { scale, counters, objects, ..Self::new(size, window, 0.0) };
        let blocks = film.blocks.iter_mut().zip(&mut film.pixels).zip(&mut film.evaluations);
        for ((block, pixels), evaluations) in blocks {
            block.samples = [reader.u32()?, reader.u32()?];
            block.spread_samples = [reader.u32()?, reader.u32()?];
            block.spread = [reader.f64()?, reader.f64()?];
            block.work = [reader.u64()?, reader.u64()?];
            for pixel in &mut *pixels {
                *pixel = PixelSums::read(&mut reader)?;
            }
            *evaluations = reader.evaluations(if counted { pixels.len() } else { 0 })?;
        }
        reader.finish()?;
        Ok(film)
    }
}

/// The fixed-weight mean of both replicates, or the one that has samples.
fn mean(pixel: &PixelSums, samples: [u32; 2]) -> Vec3 {
    let [a, b] = replicates(pixel, samples);
    match samples {
        [_, 0] => a,
        [0, _] => b,
        _ => (a + b) * 0.5,
    }
}

fn blend<const N: usize>(into: &mut [f16; N], new: [f16; N], weight: f32) {
    for (have, new) in into.iter_mut().zip(new) {
        *have = f16::from_f32(have.to_f32() + (new.to_f32() - have.to_f32()) * weight);
    }
}

fn to_vec3(h: [f16; 3]) -> Vec3 {
    Vec3::new(h[0].to_f32(), h[1].to_f32(), h[2].to_f32())
}
