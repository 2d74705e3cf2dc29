//! Owns the sums of one pixel block over one round, in the order that makes them reproducible.
//!
//! Sixteen consecutive samples of a replicate (a *sample block*) add in f32; sample blocks fold in index order in f64;
//! the total is rounded to f32 once.

use crate::color::luminance;
use crate::film::{Counters, Level, PixelSums, Seen, levels};
use crate::integrator::Paths;
use crate::sampler::Replicate;
use glam::{DVec3, Vec3};
use half::f16;

/// Samples of a replicate that add in f32 before they fold into f64.
pub(super) const SAMPLE_BLOCK: u32 = 16;

#[derive(Clone, Copy, Default)]
struct Pixel {
    sum: [DVec3; 2],
    square: [DVec3; 2],
    albedo: Vec3,
    normal: Vec3,
    depth: f32,
    emission: [f32; 2],
}

/// Sums over the pixels of a block.
pub(super) struct Accumulator {
    pixels: Vec<Pixel>,
    samples: [u32; 2],
    /// Evaluations of distance functions by pixel; empty in scenes without any.
    evaluations: Vec<u32>,
}

impl Accumulator {
    pub(super) fn new(pixels: usize) -> Self {
        let empty = Pixel { depth: f32::INFINITY, ..Pixel::default() };
        Self { pixels: vec![empty; pixels], samples: [0; 2], evaluations: Vec::new() }
    }

    /// Adds a traced wave: one sample block, or a part of one at the ends of a range.
    pub(super) fn add(&mut self, paths: &Paths, replicate: Replicate, counters: &mut Counters) {
        let (n, r) = (self.pixels.len(), replicate as usize);
        self.samples[r] += (paths.len() / n) as u32;
        for (at, pixel) in self.pixels.iter_mut().enumerate() {
            let (mut sum, mut square) = (Vec3::ZERO, Vec3::ZERO);
            for path in (at..paths.len()).step_by(n) {
                let value = checked(paths.radiance[path], counters);
                sum += value;
                square += value * value;
                let feature = &paths.features[path];
                pixel.albedo += feature.albedo;
                pixel.normal += feature.normal;
                pixel.depth = pixel.depth.min(feature.depth);
                // Nothing where the sample was dropped.
                pixel.emission[r] += feature.emission.min(luminance(value));
            }
            pixel.sum[r] += sum.as_dvec3();
            pixel.square[r] += square.as_dvec3();
        }
        if !paths.evaluations.is_empty() {
            self.evaluations.resize(n, 0);
            for (path, &evaluations) in paths.evaluations.iter().enumerate() {
                let sum = &mut self.evaluations[path % n];
                *sum = sum.saturating_add(evaluations);
            }
        }
    }

    /// Evaluations of distance functions by pixel; empty in scenes without any.
    pub(super) fn evaluations(&mut self) -> Vec<u32> {
        std::mem::take(&mut self.evaluations)
    }

    /// The sums as the film takes them.
    pub(super) fn pixels(&self) -> Vec<PixelSums> {
        let weight = 1.0 / (self.samples[0] + self.samples[1]).max(1) as f32;
        let halves = |v: Vec3| (v * weight).to_array().map(f16::from_f32);
        let resolve = |p: &Pixel| PixelSums {
            a: p.sum[0].as_vec3(),
            b: p.sum[1].as_vec3(),
            albedo: halves(p.albedo),
            normal: halves(p.normal),
            depth: p.depth,
            emission: f16::from_f32(((p.emission[0] + p.emission[1]) * weight).min(f16::MAX.to_f32())),
        };
        self.pixels.iter().map(resolve).collect()
    }

    /// Relative variance of one sample by replicate, averaged over pixels and channels; 0 below two samples.
    ///
    /// `width` is that of the block; `scale` is 2 to the power of the exposure: what is small on the screen counts little.
    pub(super) fn spread(&self, width: usize, scale: f32) -> [f32; 2] {
        let scale = f64::from(scale);
        std::array::from_fn(|r| {
            let n = f64::from(self.samples[r]);
            if n < 2.0 {
                return 0.0;
            }
            let moments = |p: &Pixel| {
                let mean = p.sum[r] / n;
                let variance = (p.square[r] / n - mean * mean).max(DVec3::ZERO) * (n / (n - 1.0));
                (mean * scale, variance * (scale * scale))
            };
            let seen = self.pixels.iter().map(|p| {
                let (mean, variance) = moments(p);
                let noise = DVec3::from(variance.to_array().map(|v| (v / n).sqrt()));
                Seen { mean, noise, emission: f64::from(p.emission[r]) / n * scale }
            });
            let of = |(p, level): (&Pixel, Level)| {
                (moments(p).1 / (level.likely * level.likely + 0.01)).element_sum() / 3.0
            };
            (self.pixels.iter().zip(levels(seen, width)).map(of).sum::<f64>() / self.pixels.len() as f64)
                as f32
        })
    }
}

/// The sample, or nothing where it is not finite: dropped and counted, its place in the mean kept.
fn checked(value: Vec3, counters: &mut Counters) -> Vec3 {
    if value.is_finite() {
        return value;
    }
    if value.is_nan() {
        counters.nan_samples += 1;
    } else {
        counters.infinite_samples += 1;
    }
    Vec3::ZERO
}
