//! Owns the pixel filter, which is sampled: a sample belongs to one pixel and tiles need no border.

use crate::math::{cos, exp};
use glam::Vec2;
use std::f32::consts::PI;

/// Shape of the reconstruction filter; separable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilterKind {
    /// Constant.
    Box,
    /// A Gaussian with a standard deviation of a third of the radius, lowered to reach 0 at the radius.
    Gaussian,
    /// The four-term Blackman–Harris window (Harris 1978).
    BlackmanHarris,
}

impl FilterKind {
    /// Unnormalised weight at `x` in [−1, 1], where 1 is the radius.
    fn weight(self, x: f32) -> f32 {
        match self {
            Self::Box => 1.0,
            Self::Gaussian => (exp(-4.5 * x * x) - exp(-4.5)).max(0.0),
            Self::BlackmanHarris => {
                let t = PI * (x + 1.0);
                0.35875 - 0.48829 * cos(t) + 0.14128 * cos(2.0 * t) - 0.01168 * cos(3.0 * t)
            }
        }
    }
}

/// A filter ready to be sampled: the inverse of its cumulative distribution, tabulated.
#[derive(Debug, Clone)]
pub struct PixelFilter {
    radius: f32,
    /// Cumulative weight at the borders of equal cells over [−1, 1]; first 0, last 1.
    cdf: Vec<f32>,
    /// For even steps of the random number, the cell to look from.
    guide: Vec<u16>,
}

impl PixelFilter {
    const CELLS: usize = 512;

    /// A filter of a radius in pixels (half its width).
    pub fn new(kind: FilterKind, radius: f32) -> Self {
        let cells = Self::CELLS as f32;
        let mut sum = 0.0_f64;
        let mut totals = vec![0.0_f64];
        for i in 0..Self::CELLS {
            sum += f64::from(kind.weight(2.0 * (i as f32 + 0.5) / cells - 1.0).max(0.0));
            totals.push(sum);
        }
        let cdf: Vec<f32> = totals.iter().map(|t| (t / sum) as f32).collect();
        let last = |u: f32| cdf.partition_point(|&c| c <= u).clamp(1, Self::CELLS) - 1;
        let guide = (0..Self::CELLS).map(|step| last(step as f32 / cells) as u16).collect();
        Self { radius, cdf, guide }
    }

    /// An offset from the pixel's centre in pixels, distributed as the filter.
    pub fn sample(&self, u: Vec2) -> Vec2 {
        Vec2::new(self.sample_axis(u.x), self.sample_axis(u.y))
    }

    fn sample_axis(&self, u: f32) -> f32 {
        let mut cell = usize::from(self.guide[(u * Self::CELLS as f32) as usize]);
        while cell + 1 < Self::CELLS && self.cdf[cell + 1] <= u {
            cell += 1;
        }
        let (low, high) = (self.cdf[cell], self.cdf[cell + 1]);
        let inside = if high > low { ((u - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
        self.radius * (2.0 * (cell as f32 + inside) / Self::CELLS as f32 - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_follow_the_weights() {
        for kind in [FilterKind::Box, FilterKind::Gaussian, FilterKind::BlackmanHarris] {
            let filter = PixelFilter::new(kind, 1.5);
            let n = 100_000;
            let (mut mean, mut second, mut want, mut norm) = (0.0, 0.0, 0.0, 0.0);
            for i in 0..n {
                let u = (i as f32 + 0.5) / n as f32;
                let x = f64::from(filter.sample_axis(u));
                mean += x / f64::from(n);
                second += x * x / f64::from(n);
                let t = 2.0 * u - 1.0;
                let w = f64::from(kind.weight(t));
                want += w * (1.5 * f64::from(t)).powi(2);
                norm += w;
            }
            assert!(mean.abs() < 1e-4, "{kind:?} mean {mean}");
            assert!((second - want / norm).abs() < 1e-3, "{kind:?} {second} {}", want / norm);
        }
    }
}
