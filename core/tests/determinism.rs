//! Owns the pure-pixel rule: tiles, threads, windows and results on the wire change no bit.

mod support;

use karst_core::encode::{exr, film_exr, film_png, png};
use karst_core::film::{Film, Region, ResultError, Round, TileGrid, TileResult};
use karst_core::render::{next_round, render_frame, render_tile};
use karst_core::scene::Scene;
use std::io::Cursor;
use std::sync::atomic::AtomicBool;
use support::{Nobody, fingerprint, render, scene};

fn text(sampling: &str, film: &str) -> String {
    format!(
        r#"{{"version": 1,
        "camera": {{"type": "perspective", "vfov": 50, "lens_radius": 0.05, "focus_distance": 4, "transform": {{"look_at": {{"eye": [0, 1, 4], "target": [0, 0, 0], "up": [0, 1, 0]}}}}}},
        "film": {{"width": 112, "height": 52{film}}},
        "sampling": {sampling},
        "integrator": {{"max_depth": 6}},
        "materials": {{"gray": {{"type": "diffuse", "reflectance": [0.6, 0.5, 0.4]}}}},
        "spheres": {{"lamp": {{"center": [2, 3, 1], "radius": 0.4, "material": "gray", "emission": [20, 18, 15]}},
                     "ground": {{"center": [0, -101, 0], "radius": 100, "material": "gray"}}}},
        "sdf_objects": {{"bulb": {{"material": "gray", "tree": {{"type": "mandelbulb", "iterations": 4}}}}}},
        "lights": {{"sky": {{"type": "environment", "radiance": [0.1, 0.2, 0.3]}}}}}}"#
    )
}

const FIXED: &str = r#"{"spp": 18, "seed": 5}"#;
const ADAPTIVE: &str = r#"{"target_error": 0.12, "min_spp": 8, "max_spp": 64, "seed": 5}"#;

#[test]
fn tile_size_threads_and_repetition_change_no_bit() {
    let (fixed, adaptive) = (scene(&text(FIXED, "")), scene(&text(ADAPTIVE, "")));
    let want = [&fixed, &adaptive].map(|s| fingerprint(&render(s, 16, 1).picture()));
    let matrix = [16, 32, 64, 96].into_iter().flat_map(|size| [1, 2, 3].map(|threads| (size, threads)));
    for (tile_size, threads) in matrix.flat_map(|case| [case; 2]) {
        let got = fingerprint(&render(&fixed, tile_size, threads).picture());
        assert_eq!(got, want[0], "tile size {tile_size}, {threads} threads");
    }
    for (tile_size, threads) in [(32, 3), (96, 2), (96, 8), (1000, 3)] {
        let got = fingerprint(&render(&adaptive, tile_size, threads).picture());
        assert_eq!(got, want[1], "adaptive, tile size {tile_size}, {threads} threads");
    }
}

/// Threads keep the memory of their waves from scene to scene, with and without fog and distance functions.
#[test]
fn what_a_thread_rendered_before_changes_no_bit() {
    let marched = text(FIXED, "");
    let fog = r#"{"media": {"fog": {"sigma_s": [0.1, 0.1, 0.2]}}, "medium": "fog", "version""#;
    let foggy = marched.replacen(r#"{"version""#, fog, 1);
    let kind =
        r#""sdf_objects": {"bulb": {"material": "gray", "tree": {"type": "mandelbulb", "iterations": 4}}},"#;
    let [without, foggy_without] = [&marched, &foggy].map(|text| text.replacen(kind, "", 1));
    assert!(foggy != marched && without != marched);
    let scenes = [marched, foggy, without, foggy_without].map(|text| scene(&text));
    let want = scenes.each_ref().map(|s| fingerprint(&render(s, 64, 1).picture()));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for which in [0, 1, 2, 3, 1, 0, 3, 2, 0, 2, 1, 3, 0] {
        let film =
            pool.install(|| render_frame(&scenes[which], 64, &AtomicBool::new(false), &Nobody)).unwrap();
        assert_eq!(fingerprint(&film.picture()), want[which], "scene {which}");
    }
}

#[test]
fn another_seed_or_frame_is_another_picture() {
    let base = fingerprint(&render(&scene(&text(FIXED, "")), 64, 2).picture());
    let seeded = fingerprint(&render(&scene(&text(r#"{"spp": 18, "seed": 6}"#, "")), 64, 2).picture());
    assert_ne!(base, seeded);
}

#[test]
fn a_crop_window_shows_the_same_pixels() {
    let full = render(&scene(&text(FIXED, "")), 32, 2);
    let window = Region { x0: 37, y0: 19, x1: 101, y1: 48 };
    let crop = r#", "crop": {"x": 37, "y": 19, "width": 64, "height": 29}"#;
    let cropped = render(&scene(&text(FIXED, crop)), 32, 2);
    // The error layer is a block's and blocks are clipped by the window: it may differ at its rim.
    let (mut want, mut got) = (full.region(window), cropped.picture());
    want.error.clear();
    got.error.clear();
    assert_eq!(fingerprint(&got), fingerprint(&want));
}

/// Files are written a band of rows at a time: the same bytes as of the whole picture.
#[test]
fn a_film_is_written_as_its_picture_is() {
    let crop = r#", "crop": {"x": 37, "y": 19, "width": 64, "height": 29}"#;
    let scene = scene(&text(FIXED, crop));
    let film = render(&scene, 32, 2);
    let (picture, statistics) = (film.picture(), serde_json::json!({"frame": 1}));
    for denoised in [None, Some(&picture.albedo[..])] {
        let mut bytes = Cursor::new(Vec::new());
        film_exr(&film, denoised, &statistics, &mut bytes).unwrap();
        assert!(bytes.into_inner() == exr(&picture, denoised, &statistics).unwrap());
    }
    assert!(film_exr(&film, Some(&picture.albedo[1..]), &statistics, Cursor::new(Vec::new())).is_err());
    let (exposure, view) = (scene.exposure(), scene.view());
    let whole = png(&picture.color, picture.window.width(), picture.window.height(), exposure, view);
    assert!(film_png(&film, exposure, view).unwrap() == whole.unwrap());
}

/// Renders a frame as the service does: results as bytes, merged backwards, the film through a checkpoint each round.
fn by_bytes(scene: &Scene, tile_size: u32) -> Result<Film, ResultError> {
    let grid = TileGrid::new(scene.window(), tile_size);
    let mut film = Film::new(scene.size(), scene.window(), scene.exposure());
    let mut done = 0;
    while let Some(round) = next_round(scene.sampling(), &grid, &film, done, &|_| None) {
        let round = Round::from_bytes(&round.to_bytes())?;
        let tiles = (0..grid.tile_count()).filter(|&t| !round.tile_is_empty(&grid, t));
        let results: Vec<Vec<u8>> = tiles
            .filter_map(|t| render_tile(scene, &grid, t, &round, &AtomicBool::new(false)))
            .map(|result| result.to_bytes())
            .collect();
        for bytes in results.iter().rev() {
            film.merge(&TileResult::from_bytes(bytes, &grid, &round)?)?;
        }
        film = Film::from_bytes(&film.to_bytes())?;
        done += 1;
    }
    Ok(film)
}

#[test]
fn results_and_films_survive_their_bytes() {
    for sampling in [FIXED, ADAPTIVE] {
        let scene = scene(&text(sampling, ""));
        assert_eq!(
            fingerprint(&by_bytes(&scene, 48).unwrap().picture()),
            fingerprint(&render(&scene, 64, 2).picture())
        );
    }
}

#[test]
fn damaged_bytes_are_refused() {
    let scene = scene(&text(FIXED, ""));
    let grid = TileGrid::new(scene.window(), 32);
    let film = Film::new(scene.size(), scene.window(), 0.0);
    let round = next_round(scene.sampling(), &grid, &film, 0, &|_| None).unwrap();
    let result = render_tile(&scene, &grid, 1, &round, &AtomicBool::new(false)).unwrap();
    let bytes = result.to_bytes();
    assert_eq!(TileResult::from_bytes(&bytes, &grid, &round).as_ref(), Ok(&result));
    for cut in [0, 3, 10, 60, bytes.len() / 2, bytes.len() - 1] {
        assert!(TileResult::from_bytes(&bytes[..cut], &grid, &round).is_err(), "cut at {cut}");
        assert!(Film::from_bytes(&film.to_bytes()[..cut]).is_err());
    }
    let longer = [bytes.as_slice(), &[0]].concat();
    assert!(TileResult::from_bytes(&longer, &grid, &round).is_err());
    let mut other = bytes.clone();
    other[4] = 200;
    assert!(TileResult::from_bytes(&other, &grid, &round).is_err(), "another tile");
    // A result merges once only.
    let mut film = film;
    film.merge(&result).unwrap();
    assert!(film.merge(&result).is_err());
}
