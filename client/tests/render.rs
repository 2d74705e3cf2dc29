//! `karst render` and `karst check` on small scenes: files, reports, errors, the same bits however it is done.
#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod program;

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::program::{done, karst, stderr};

/// A lit floor of a sphere in a folder of its own.
fn scene() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.json");
    let document = json!({
        "version": 1,
        "camera": {"type": "perspective", "vfov": 40,
                   "transform": {"look_at": {"eye": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0]}}},
        "film": {"width": 48, "height": 40, "filter": {"type": "gaussian", "radius": 1.5}},
        "sampling": {"spp": 8, "seed": 3},
        "materials": {"grey": {"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]}},
        "spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "grey"}},
        "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}},
        "animation": {"fps": 24, "frames": [1, 4], "tracks": {
            "spheres.ball.radius": {"interpolation": "linear",
                                    "keys": [{"frame": 1, "value": 1}, {"frame": 4, "value": 0.5}]}}},
    });
    std::fs::write(&path, document.to_string()).unwrap();
    (folder, path)
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn tiles_threads_and_runs_give_the_same_bytes() {
    let (folder, _) = scene();
    let at = folder.path();
    done(at, &["render", "ball.json", "-o", "first.exr"]);
    for tile_size in ["16", "32", "64", "96"] {
        for threads in ["1", "2", "3"] {
            let line = ["render", "ball.json", "-o", "a.exr", "--tile-size", tile_size, "--threads", threads];
            done(at, &line);
            let what = format!("tile size {tile_size}, {threads} threads");
            assert_eq!(read(at, "a.exr"), read(at, "first.exr"), "{what}");
        }
    }
    done(at, &["render", "ball.json", "-o", "other.exr", "--seed", "4"]);
    assert_ne!(read(at, "other.exr"), read(at, "first.exr"), "another seed gives another picture");
}

#[test]
fn a_report_has_what_was_agreed() {
    let (folder, _) = scene();
    let at = folder.path();
    done(at, &["render", "ball.json", "-o", "a.exr", "-o", "a.png", "--report", "r.json", "--threads", "2"]);
    assert!(read(at, "a.png").starts_with(b"\x89PNG"));
    let report: Value = serde_json::from_slice(&read(at, "r.json")).unwrap();
    for field in [
        "render_seconds",
        "wall_seconds",
        "spp_mean",
        "rays",
        "msamples_per_second",
        "rel_mse",
        "rel_mse_ci95",
        "exhausted_rays",
        "sdf_evaluations",
        "objects",
        "peak_rss_bytes",
        "stages",
        "profile",
        "rounds",
        "rmse",
        "mrays_per_second",
    ] {
        assert!(!report[field].is_null(), "{field} is missing in {report}");
    }
    assert_eq!((&report["width"], &report["height"]), (&48.into(), &40.into()));
    assert_eq!((&report["samples"], &report["threads"]), (&(48 * 40 * 8).into(), &2.into()));
    assert_eq!(report["nonfinite_samples"], 0);
    let rounds = report["rounds"].as_array().unwrap();
    assert_eq!(rounds.last().unwrap()["rel_mse"], report["rel_mse"]);
    assert!(rounds.is_sorted_by_key(|round| round["samples"].as_u64()), "{rounds:?}");
    let seconds: f64 = report["profile"].as_object().unwrap().values().filter_map(Value::as_f64).sum();
    let spent = report["render_seconds"].as_f64().unwrap() * 2.0;
    assert!(seconds > 0.0 && seconds <= spent, "{seconds} s in stages of {spent} s");
}

#[test]
fn a_report_is_a_page_too() {
    let (folder, _) = scene();
    let at = folder.path();
    let line =
        ["render", "ball.json", "-o", "a.png", "--target-error", "0.2", "--min-spp", "8", "--max-spp", "64"];
    let output = karst(at, &[&line[..], &["--report", "r.html", "--report", "r.json", "--profile"]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("time by stage") && stderr(&output).contains("intersect"),
        "{}",
        stderr(&output)
    );
    let page = String::from_utf8(read(at, "r.html")).unwrap();
    assert_eq!(page.matches("data:image/png;base64,").count(), 3, "a picture and two maps");
    assert!(page.contains("<circle") && page.contains("target 20.00 %") && page.contains("shade"), "{page}");
    assert!(!page.contains("http") && !page.contains("NaN"), "needs nothing else");
    // One sample has no error, and there is a page all the same; several frames come in a table.
    done(at, &["render", "ball.json", "-o", "b.png", "--spp", "1", "--report", "one.html"]);
    assert!(!String::from_utf8(read(at, "one.html")).unwrap().contains("NaN"));
    done(
        at,
        &["render", "ball.json", "-o", "c.png", "--frames", "1-3", "--spp", "2", "--report", "all.html"],
    );
    assert_eq!(String::from_utf8(read(at, "all.html")).unwrap().matches("<h2>Frame").count(), 3);
    let output = karst(at, &["render", "ball.json", "-o", "a.png", "--report", "r.txt"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("--report r.txt: expected a name in .json or .html"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn frames_are_numbered_and_differ() {
    let (folder, _) = scene();
    let at = folder.path();
    let said = done(at, &["render", "ball.json", "-o", "o.exr", "--frames", "1-4:3", "--spp", "2", "--json"]);
    let frames: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(frames.len(), 2);
    assert_eq!((&frames[1]["event"], &frames[1]["frame"]), (&"frame".into(), &4.into()));
    assert_eq!(frames[1]["files"], json!(["o.0004.exr"]));
    assert_ne!(read(at, "o.0001.exr"), read(at, "o.0004.exr"));
    done(at, &["render", "ball.json", "-o", "one.exr", "--frame", "4", "--spp", "2"]);
    assert_eq!(read(at, "one.exr"), read(at, "o.0004.exr"));
    let output = karst(at, &["render", "ball.json", "-o", "o.exr", "--frames", "4-9"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("the scene has frames 1 to 4"), "{}", stderr(&output));
}

#[test]
fn flags_change_the_scene() {
    let (folder, _) = scene();
    let at = folder.path();
    let line = ["render", "ball.json", "-o", "a.exr", "--report", "r.json"];
    done(at, &[&line[..], &["--size", "64x32", "--crop", "8,4,20,10", "--spp", "1"]].concat());
    let report: Value = serde_json::from_slice(&read(at, "r.json")).unwrap();
    assert_eq!(
        (&report["width"], &report["height"], &report["samples"]),
        (&20.into(), &10.into(), &200.into())
    );
    assert_eq!(report["rel_mse"], Value::Null, "one sample per pixel says nothing about its error");
    done(at, &[&line[..], &["--target-error", "0.2", "--min-spp", "8", "--max-spp", "64"]].concat());
    let report: Value = serde_json::from_slice(&read(at, "r.json")).unwrap();
    assert!(report["rel_mse"].as_f64().unwrap().sqrt() <= 0.2, "{report}");
    done(at, &[&line[..], &["--spp", "1048576", "--time-limit", "0.05"]].concat());
    let report: Value = serde_json::from_slice(&read(at, "r.json")).unwrap();
    assert!(report["spp_mean"].as_f64().unwrap() < 1_048_576.0);
    let output = karst(at, &["render", "ball.json", "-o", "a.exr", "--crop", "40,0,20,10"]);
    assert_eq!(output.status.code(), Some(2), "a crop outside the frame: {}", stderr(&output));
}

#[test]
fn a_denoised_picture_that_has_to_be_good_is_denoised() {
    let (folder, _) = scene();
    let at = folder.path();
    let line = ["render", "ball.json", "-o", "a.exr", "--target-error", "0.1", "--error-of", "denoised"];
    let output = karst(at, &line);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("nothing is denoised: add --denoise full"), "{}", stderr(&output));
    let output =
        karst(at, &[&line[..], &["--min-spp", "8", "--denoise", "full", "--report", "r.json"]].concat());
    if karst_denoise::Denoiser::find().is_err() {
        assert_eq!(output.status.code(), Some(1), "without a denoiser it says so: {}", stderr(&output));
        return;
    }
    assert!(output.status.success(), "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&read(at, "r.json")).unwrap();
    let error = report["denoised_rel_mse"].as_f64().unwrap().sqrt();
    let noisy = report["rel_mse"].as_f64().unwrap().sqrt();
    assert!(error <= 0.1 && error < noisy, "{error} {noisy}");
    assert!(report["denoised_rel_mse_ci95"].is_array());
}

#[test]
fn a_wrong_scene_says_where() {
    let (folder, path) = scene();
    let at = folder.path();
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("\"radius\":1,", "\"radius\":-3,").replace("vfov", "vfvo")).unwrap();
    for command in [&["check", "ball.json"][..], &["render", "ball.json", "-o", "a.exr"]] {
        let output = karst(at, command);
        assert_eq!(output.status.code(), Some(2));
        let text = stderr(&output);
        assert!(text.starts_with("error: ball.json:1:"), "{text}");
        assert!(text.contains("spheres.ball.radius: found -3") && text.contains("did you mean"), "{text}");
    }
    let output = karst(at, &["check", "ball.json", "--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["valid"], false);
    assert!(found["total"].as_u64().unwrap() >= 2);
}

#[test]
fn a_good_scene_is_called_valid() {
    let (folder, _) = scene();
    let found: Value = serde_json::from_str(&done(folder.path(), &["check", "ball.json", "--json"])).unwrap();
    assert_eq!(
        (&found["valid"], &found["width"], &found["last_frame"]),
        (&true.into(), &48.into(), &4.into())
    );
}

#[test]
fn check_says_how_objects_are_marched_and_why() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/sdf");
    for (file, said) in [
        ("union.json", "met by formula: no settings apply"),
        ("torus.json", "marched in at most 4096 steps; features thinner than half of a pixel's radius"),
        ("mandelbulb.json", "normals over 7.629e-6 (1/64 of a fractal's level"),
        ("fbm_noise.json", "normals are its gradient"),
    ] {
        let text = done(&scenes, &["check", file]);
        assert!(text.contains("sdf_object") && text.contains(said), "{text}");
        let found: Value = serde_json::from_str(&done(&scenes, &["check", file, "--json"])).unwrap();
        let objects = found["sdf_objects"].as_object().unwrap();
        assert_eq!(
            objects.values().any(|object| object["by_formula"] == true),
            file == "union.json",
            "{found}"
        );
    }
}

#[test]
fn a_missing_file_of_the_scene_is_named_where_it_is_used() {
    let (folder, path) = scene();
    let text = std::fs::read_to_string(&path).unwrap();
    let meshes = r#""meshes":{"floor":{"file":"meshes/floor.obj"}},"instances":{"f":{"mesh":"floor","material":"grey"}},"spheres""#;
    std::fs::write(&path, text.replacen("\"spheres\"", meshes, 1)).unwrap();
    for command in [&["check", "ball.json"][..], &["submit", "ball.json"]] {
        let output = karst(folder.path(), command);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains("meshes/floor.obj"), "{}", stderr(&output));
    }
}
