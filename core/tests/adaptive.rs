//! Owns the adaptive rounds: targets are reached, samples go where the error is, the picture stays unbiased.

mod support;

use karst_core::film::Film;
use karst_core::render::{FrameObserver, render_frame};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
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

/// Judges a denoiser that leaves a part of the squared error.
struct Judge {
    left: Option<f64>,
    found: Mutex<Vec<f64>>,
}

impl FrameObserver for Judge {
    fn denoised_error(&self, film: &Film) -> Option<f64> {
        let error = film.summary().rel_mse? * self.left?;
        self.found.lock().expect("nobody panics with it").push(error);
        Some(error)
    }
}

#[test]
fn a_frame_goes_on_until_its_denoised_picture_is_good() {
    let target: f64 = 0.008;
    let sampling = |of: &str| {
        scene(&text(&format!(
            r#"{{"target_error": {target}, "error_of": "{of}", "min_spp": 8, "max_spp": 512, "seed": 2}}"#
        )))
    };
    let samples = |of: &str, left: Option<f64>| {
        let judge = Judge { left, found: Mutex::default() };
        let film = render_frame(&sampling(of), 32, &AtomicBool::new(false), &judge).unwrap();
        (film.summary(), judge.found.into_inner().unwrap())
    };
    let (noisy, asked) = samples("noisy", Some(0.1));
    assert!(asked.is_empty(), "the noisy picture has to be good, and nobody asks for another");
    let (tenth, asked) = samples("denoised", Some(0.1));
    let (last, before) = asked.split_last().unwrap();
    assert!(*last <= target * target && before.iter().all(|error| *error > target * target), "{asked:?}");
    assert!(tenth.samples < noisy.samples / 2, "{} {}", tenth.samples, noisy.samples);
    // Where nobody can tell, it goes on to the end.
    for left in [None, Some(f64::NAN)] {
        let (unknown, _) = samples("denoised", left);
        assert_eq!((unknown.spp_min, unknown.spp_max), (512, 512));
    }
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

/// Pixels whose light a few samples find, where stopping on one's own samples would leave the picture too dark: name and
/// what is added to a dim room.
const HARD: [(&str, &str); 4] = [
    // A lamp behind the camera, seen now and then by a small glossy ball.
    (
        "firefly",
        r#""spheres": {"lamp": {"center": [0, 4, 9], "radius": 0.15, "material": "gray", "emission": [900, 900, 900]},
        "ball": {"center": [0, 0.4, 0], "radius": 0.4, "material": "gloss"},
        "ground": {"center": [0, -1000, 0], "radius": 1000, "material": "gray"}}"#,
    ),
    // A thin bright wire: some fiftieth of the pixels that it crosses.
    (
        "edge",
        r#""spheres": {"lamp": {"center": [0, 1, 0], "radius": 0.03, "material": "gray", "emission": [20, 20, 20]},
        "fill": {"center": [0, 60, 0], "radius": 20, "material": "gray", "emission": [1, 1, 1]},
        "ground": {"center": [0, -1000, 0], "radius": 1000, "material": "gray"}}"#,
    ),
    // Light through a glass ball onto a floor that is lit otherwise.
    (
        "caustic",
        r#""spheres": {"lamp": {"center": [2, 5, 0], "radius": 1, "material": "gray", "emission": [6, 6, 6]},
        "fill": {"center": [0, 60, 0], "radius": 20, "material": "gray", "emission": [1, 1, 1]},
        "ball": {"center": [0, 0.7, 0], "radius": 0.5, "material": "glass"},
        "ground": {"center": [0, -1000, 0], "radius": 1000, "material": "gray"}}"#,
    ),
    // One lit corner of a dark picture.
    (
        "corner",
        r#""spheres": {"lamp": {"center": [-2.6, 0.5, 0], "radius": 0.4, "material": "gray", "emission": [3, 3, 3]},
        "ground": {"center": [0, -1000, 0], "radius": 1000, "material": "gray"}}"#,
    ),
];

#[test]
fn adaptive_pictures_are_as_bright_as_others() {
    let text = |objects: &str, sampling: &str| {
        format!(
            r#"{{"version": 1,
        "camera": {{"type": "perspective", "vfov": 50, "transform": {{"look_at": {{"eye": [0, 2, 6], "target": [0, 0.5, 0], "up": [0, 1, 0]}}}}}},
        "film": {{"width": 64, "height": 48}}, "sampling": {sampling}, "integrator": {{"max_depth": 6}},
        "materials": {{"gray": {{"type": "diffuse", "reflectance": [0.6, 0.6, 0.6]}},
            "gloss": {{"type": "conductor", "alpha": 0.02, "eta": [0.2, 0.9, 1.1], "k": [3.9, 2.4, 2.2]}},
            "glass": {{"type": "dielectric", "ior": 1.5}}}},
        {objects}}}"#
        )
    };
    for (name, objects) in HARD {
        let [(adaptive, adaptive_error), (truth, truth_error)] =
            [(36, r#""target_error": 0.06, "min_spp": 8, "max_spp": 2048"#), (8, r#""spp": 1024"#)].map(
                |(pictures, goal)| {
                    let means: Vec<f64> = (0..pictures)
                        .map(|seed| {
                            let sampling = format!(r#"{{{goal}, "seed": {}}}"#, seed + 1);
                            mean_of(&render(&scene(&text(objects, &sampling)), 32, 2).picture().color)
                        })
                        .collect();
                    let mean = means.iter().sum::<f64>() / f64::from(pictures);
                    let variance =
                        means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / f64::from(pictures - 1);
                    (mean, (variance / f64::from(pictures)).sqrt())
                },
            );
        let (bias, error) =
            (adaptive / truth - 1.0, (adaptive_error.powi(2) + truth_error.powi(2)).sqrt() / truth);
        println!("{name}: {:.3} % +- {:.3} %", 100.0 * bias, 100.0 * error);
        // The test can tell 1 %.
        assert!(error < 0.004, "{name}: too noisy to tell, {error}");
        assert!(bias.abs() < 0.01, "{name}: {bias} +- {error}");
    }
}
