//! What a picture says about its making: one JSON object, the same for the same pixels.

use serde_json::{Value, json};

use crate::film::FrameSummary;

/// The statistics that karst writes into an EXR: no times and no machine, so that equal pixels make equal files.
///
/// Errors that are not known are `null`; `rel_mse` is the estimated relMSE of the picture as it is.
pub fn statistics(frame: i32, seed: u32, summary: &FrameSummary) -> Value {
    let counters = &summary.counters;
    json!({
        "frame": frame,
        "seed": seed,
        "spp_mean": summary.spp_mean,
        "spp_min": summary.spp_min,
        "spp_max": summary.spp_max,
        "samples": summary.samples,
        "rays": counters.rays,
        "shadow_rays": counters.shadow_rays,
        "nonfinite_samples": counters.nan_samples + counters.infinite_samples,
        "exhausted_rays": counters.exhausted_rays,
        "rel_mse": summary.rel_mse,
        "rel_mse_ci95": summary.rel_mse_ci95,
    })
}
