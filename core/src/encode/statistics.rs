//! What a picture says about its making: one JSON object, the same for the same pixels.

use serde_json::{Value, json};

use crate::film::{CrossError, FrameSummary};
use crate::sdf::MarchStats;

/// Most objects that statistics name.
pub const MAX_OBJECTS: usize = 64;

/// What rays cost against objects made of distance functions: an object of JSON for each, the [`MAX_OBJECTS`] of the most
/// evaluations, most first. `rays` are those that entered its bounds, `exhausted_rays` those that ran out of steps,
/// `overshoots` steps that were too long and taken back, `brackets` the roots that were found.
pub fn object_statistics(names: &[String], counts: &[MarchStats]) -> Value {
    let mut objects: Vec<_> = names.iter().zip(counts).collect();
    objects.sort_by_key(|(_, counts)| std::cmp::Reverse(counts.evaluations));
    objects.truncate(MAX_OBJECTS);
    let statistics = |(name, counts): (&String, &MarchStats)| {
        json!({
            "object": name,
            "rays": counts.rays,
            "evaluations_per_ray": counts.evaluations as f64 / counts.rays.max(1) as f64,
            "exhausted_rays": counts.exhausted,
            "overshoots": counts.overshoots,
            "brackets": counts.brackets,
        })
    };
    objects.into_iter().map(statistics).collect()
}

/// The statistics that karst writes into an EXR: no times and no machine, so that equal pixels make equal files.
///
/// Errors that are not known are `null`; `rel_mse` is the estimated relMSE of the picture as it is, `denoised_rel_mse` that of
/// the denoised one.
pub fn statistics(
    frame: i32,
    seed: u32,
    summary: &FrameSummary,
    denoised: Option<&CrossError>,
    objects: &Value,
) -> Value {
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
        "sdf_evaluations": counters.sdf_evaluations,
        "objects": objects,
        "rel_mse": summary.rel_mse,
        "rel_mse_ci95": summary.rel_mse_ci95,
        "denoised_rel_mse": denoised.map(|error| error.rel_mse),
        "denoised_rel_mse_ci95": denoised.map(|error| error.ci95),
    })
}

#[cfg(test)]
mod tests {
    use super::{MAX_OBJECTS, object_statistics};
    use crate::sdf::MarchStats;
    use serde_json::json;

    #[test]
    fn the_costliest_objects_are_named_first() {
        let names: Vec<String> = (0..100).map(|number| format!("object {number}")).collect();
        let counts: Vec<_> =
            (0..100).map(|n| MarchStats { rays: 2, evaluations: n % 50, ..MarchStats::default() }).collect();
        let found = object_statistics(&names, &counts);
        assert_eq!(found.as_array().map(Vec::len), Some(MAX_OBJECTS));
        assert_eq!(
            (&found[0]["object"], &found[0]["evaluations_per_ray"]),
            (&json!("object 49"), &json!(24.5))
        );
        assert_eq!(found[1]["object"], "object 99", "of equal ones the first in the document");
        assert_eq!(object_statistics(&names, &[]), json!([]));
    }
}
