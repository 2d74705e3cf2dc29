//! `--report`: figures of a local render, as JSON and as a page.

mod chart;
mod page;

use std::collections::BTreeMap;

use karst_core::film::{FrameSummary, Region};
use serde::Serialize;
use serde_json::{Map, Value};

pub(crate) use page::{Finished, Page};

/// One rendered frame. Seconds are of the wall clock.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    /// What people are told besides the figures.
    #[serde(skip)]
    pub(crate) warnings: Vec<String>,
    pub(crate) frame: i32,
    /// Rendering alone.
    pub(crate) render_seconds: f64,
    /// From the start of the frame to its files.
    pub(crate) wall_seconds: f64,
    pub(crate) threads: usize,
    /// Of the rendered window.
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) samples: u64,
    pub(crate) spp_mean: f64,
    pub(crate) spp_min: u32,
    pub(crate) spp_max: u32,
    /// Along paths and to lights.
    pub(crate) rays: u64,
    pub(crate) shadow_rays: u64,
    pub(crate) msamples_per_second: f64,
    pub(crate) mrays_per_second: f64,
    /// Unknown with one sample per pixel.
    pub(crate) rel_mse: Option<f64>,
    pub(crate) rel_mse_ci95: Option<[f64; 2]>,
    pub(crate) rmse: Option<f64>,
    /// Of the denoised picture, from its denoised replicates; missing without one.
    pub(crate) denoised_rel_mse: Option<f64>,
    pub(crate) denoised_rel_mse_ci95: Option<[f64; 2]>,
    pub(crate) nonfinite_samples: u64,
    pub(crate) exhausted_rays: u64,
    pub(crate) sdf_evaluations: u64,
    /// Of the objects made of distance functions, the costliest first.
    pub(crate) objects: Value,
    /// Of the whole process so far; 0 where the system does not tell.
    pub(crate) peak_rss_bytes: u64,
    /// Seconds of each part of the work.
    pub(crate) stages: BTreeMap<&'static str, f64>,
    /// Seconds of each stage of rendering, all threads together.
    pub(crate) profile: Map<String, Value>,
    /// How the error fell.
    pub(crate) rounds: Vec<RoundFigures>,
}

/// The frame after a round.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct RoundFigures {
    pub(crate) round: u32,
    /// Of rendering so far.
    pub(crate) seconds: f64,
    pub(crate) samples: u64,
    pub(crate) spp_mean: f64,
    /// Unknown with one sample per pixel.
    pub(crate) rel_mse: Option<f64>,
}

impl RoundFigures {
    pub(crate) fn of(round: u32, seconds: f64, summary: &FrameSummary) -> Self {
        let FrameSummary { samples, spp_mean, rel_mse, .. } = *summary;
        Self { round, seconds, samples, spp_mean, rel_mse }
    }
}

impl Report {
    /// The figures that the film knows; times and stages are filled in by the caller.
    pub(crate) fn of(summary: &FrameSummary, window: Region, frame: i32, threads: usize) -> Self {
        let counters = &summary.counters;
        Self {
            warnings: Vec::new(),
            frame,
            render_seconds: 0.0,
            wall_seconds: 0.0,
            threads,
            width: window.width(),
            height: window.height(),
            samples: summary.samples,
            spp_mean: summary.spp_mean,
            spp_min: summary.spp_min,
            spp_max: summary.spp_max,
            rays: counters.rays + counters.shadow_rays,
            shadow_rays: counters.shadow_rays,
            msamples_per_second: 0.0,
            mrays_per_second: 0.0,
            rel_mse: summary.rel_mse,
            rel_mse_ci95: summary.rel_mse_ci95,
            rmse: summary.rmse,
            denoised_rel_mse: None,
            denoised_rel_mse_ci95: None,
            nonfinite_samples: counters.nan_samples + counters.infinite_samples,
            exhausted_rays: counters.exhausted_rays,
            sdf_evaluations: counters.sdf_evaluations,
            objects: Value::Null,
            peak_rss_bytes: peak_rss_bytes(),
            stages: BTreeMap::new(),
            profile: Map::new(),
            rounds: Vec::new(),
        }
    }

    /// Sets the time that rendering took and the rate that follows.
    pub(crate) fn rendered_in(&mut self, seconds: f64) {
        self.render_seconds = seconds;
        self.msamples_per_second = self.samples as f64 * 1e-6 / seconds.max(1e-9);
        self.mrays_per_second = self.rays as f64 * 1e-6 / seconds.max(1e-9);
    }
}

/// The most memory that this process ever had resident.
pub(crate) fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    parse_peak_rss(&status).unwrap_or(0)
}

fn parse_peak_rss(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::{parse_peak_rss, peak_rss_bytes};

    #[test]
    fn peak_memory_is_read() {
        assert_eq!(parse_peak_rss("VmPeak:\t 9 kB\nVmHWM:\t    1234 kB\nVmRSS: 1 kB"), Some(1234 * 1024));
        assert_eq!(parse_peak_rss("nothing"), None);
        assert!(peak_rss_bytes() > 1 << 16);
    }
}
