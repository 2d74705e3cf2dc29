//! Owns the adaptive rounds: targets are reached, samples go where the error is, the picture stays unbiased.

mod support;

use support::{mean_of, pooled_mean, render, scene};

/// One small lamp over a floor: most of the frame is easy, a rim is not.
fn text(sampling: &str) -> String {
    format!(
        r#"{{"version": 1,
        "camera": {{"type": "perspective", "vfov": 50, "transform": {{"look_at": {{"eye": [0, 2, 6], "target": [0, 0.5, 0], "up": [0, 1, 0]}}}}}},
        "film": {{"width": 128, "height": 96}},
        "sampling": {sampling},
        "integrator": {{"max_depth": 5}},
        "materials": {{"gray": {{"type": "diffuse", "reflectance": [0.6, 0.6, 0.6]}}}},
        "spheres": {{"lamp": {{"center": [1, 3, 0], "radius": 0.6, "material": "gray", "emission": [8, 8, 8]}},
                     "ball": {{"center": [-1, 0.6, 0], "radius": 0.6, "material": "gray"}},
                     "ground": {{"center": [0, -1000, 0], "radius": 1000, "material": "gray"}}}}}}"#
    )
}

#[test]
fn a_target_is_reached_with_fewer_samples_than_everywhere_the_same() {
    let target = 0.012;
    let film = render(
        &scene(&text(&format!(r#"{{"target_error": {target}, "min_spp": 32, "max_spp": 4096, "seed": 2}}"#))),
        32,
        2,
    );
    let summary = film.summary();
    assert!(summary.rel_mse.unwrap().sqrt() <= target, "{summary:?}");
    assert!(summary.spp_min < summary.spp_max, "{summary:?}");
    // The true error, against many samples of another seed.
    let reference = render(&scene(&text(r#"{"spp": 4096, "seed": 77}"#)), 32, 2).picture();
    let picture = film.picture();
    let true_error = picture.color.iter().zip(&reference.color).map(|(x, r)| {
        let d = (*x - *r) * (*x - *r) / (*r * *r + 0.01);
        f64::from(d.element_sum()) / 3.0
    });
    let true_error = (true_error.sum::<f64>() / picture.color.len() as f64).sqrt();
    assert!(true_error < 1.25 * target, "true error {true_error} against {target}");
    let bias = mean_of(&picture.color) / mean_of(&reference.color) - 1.0;
    assert!(bias.abs() < 0.01, "bias {bias}");
}

#[test]
fn one_sample_shows_a_picture_of_unknown_error() {
    let film = render(&scene(&text(r#"{"spp": 1, "seed": 2}"#)), 32, 2);
    let summary = film.summary();
    assert_eq!((summary.rel_mse, summary.rmse, summary.spp_max), (None, None, 1));
    let (mean, _) = pooled_mean(&film);
    assert!(mean > 0.0 && mean.is_finite());
}
