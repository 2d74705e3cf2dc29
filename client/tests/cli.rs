//! The `karst` program from outside: help texts, error texts, exit codes, comparing pictures.

#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use karst_core::encode::{Layers, write_exr};
use serde_json::{Value, json};

const COMMANDS: [&str; 12] = [
    "render", "check", "convert", "compare", "submit", "watch", "view", "page", "fetch", "jobs", "cancel",
    "slurm",
];

fn karst(line: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_karst"))
        .args(line)
        .env_remove("KARST_SERVER")
        .env("NO_COLOR", "1")
        .output()
        .expect("karst starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn help_of(command: Option<&str>) -> (PathBuf, String) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/help");
    let output = karst(&[command.as_slice(), &["--help"]].concat());
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8(output.stdout).expect("help is text");
    (folder.join(format!("{}.txt", command.unwrap_or("karst"))), text)
}

fn all_help() -> Vec<(PathBuf, String)> {
    std::iter::once(None).chain(COMMANDS.map(Some)).map(help_of).collect()
}

#[test]
fn help_is_what_was_agreed() {
    for (path, text) in all_help() {
        if std::env::var_os("UPDATE_DOCS").is_some() {
            std::fs::write(&path, &text).unwrap();
        }
        let agreed = std::fs::read_to_string(&path).unwrap_or_default();
        assert_eq!(
            text,
            agreed,
            "{} differs; accept with `UPDATE_DOCS=1 cargo test --release -p karst-client --test cli`",
            path.display()
        );
    }
}

/// A little EXR of `width` x 2 pixels with these colours.
fn exr(path: &Path, width: u32, color: impl Fn(usize) -> [f32; 3]) {
    exr_with(path, width, color, None);
}

/// The same with a denoised layer of one colour.
fn exr_with(path: &Path, width: u32, color: impl Fn(usize) -> [f32; 3], denoised: Option<[f32; 3]>) {
    exr_by(path, width, color, denoised, &Value::Null);
}

/// The same with what karst says about the picture.
fn exr_by(
    path: &Path,
    width: u32,
    color: impl Fn(usize) -> [f32; 3],
    denoised: Option<[f32; 3]>,
    statistics: &Value,
) {
    let count = width as usize * 2;
    let pixels: Vec<_> = (0..count).map(|index| color(index).into()).collect();
    let denoised: Option<Vec<_>> = denoised.map(|color| (0..count).map(|_| color.into()).collect());
    let layers = Layers {
        full: (width, 2),
        window: (0, 0, width, 2),
        color: &pixels,
        albedo: None,
        normal: None,
        depth: None,
        samples: None,
        error: None,
        evaluations: None,
        denoised: denoised.as_deref(),
    };
    std::fs::write(path, write_exr(&layers, statistics).unwrap()).unwrap();
}

struct Pair {
    _folder: tempfile::TempDir,
    a: String,
    b: String,
    diff: PathBuf,
}

fn pair(a: impl Fn(usize) -> [f32; 3], b: impl Fn(usize) -> [f32; 3]) -> Pair {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    exr(&at("a.exr"), 4, a);
    exr(&at("b.exr"), 4, b);
    let text = |name: &str| at(name).display().to_string();
    Pair { a: text("a.exr"), b: text("b.exr"), diff: at("d.png"), _folder: folder }
}

fn compared(line: &[&str]) -> Value {
    let output = karst(&[&["compare", "--json"], line].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn equal_pictures_compare_as_identical() {
    let gradient = |index: usize| [index as f32, 1.0, 0.5];
    let files = pair(gradient, gradient);
    let found = compared(&[&files.a, &files.b]);
    assert_eq!(found["identical"], true);
    assert_eq!((&found["mse"], &found["width"], &found["height"]), (&0.0.into(), &4.into(), &2.into()));
    assert_eq!(found["sha256_a"], found["sha256_b"]);
    assert_eq!((&found["flip_mean"], &found["worst_tiles"]), (&0.0.into(), &Value::Array(Vec::new())));
    assert_eq!((&found["rel_mse_expected"], &found["mean_rel_diff_sigmas"]), (&Value::Null, &Value::Null));
}

#[test]
fn a_brighter_picture_is_measured() {
    let files = pair(|_| [1.1, 1.1, 1.1], |_| [1.0, 1.0, 1.0]);
    let diff = files.diff.display().to_string();
    let found = compared(&[&files.a, &files.b, "--reference-error", "0.05", "--diff", &diff]);
    let number = |name: &str| found[name].as_f64().unwrap();
    assert_eq!(found["identical"], false);
    assert!((number("mse") - 0.01).abs() < 1e-7);
    assert!((number("rel_mse") - 0.01 / 1.01).abs() < 1e-7);
    assert!((number("rel_mse_corrected") - (0.01 / 1.01 - 0.0025)).abs() < 1e-7);
    assert!((number("mean_rel_diff") - 0.1).abs() < 1e-6);
    assert!(std::fs::read(&files.diff).unwrap().starts_with(b"\x89PNG"));
    let tile = &found["worst_tiles"][0];
    assert_eq!(
        (&tile["x"], &tile["y"], &tile["width"], &tile["height"]),
        (&0.into(), &0.into(), &4.into(), &2.into())
    );
    assert!((tile["rel_mse"].as_f64().unwrap() - 0.01 / 1.01).abs() < 1e-7);
    // Above white both look the same; two stops darker they do not, and differ by 0.025 of 0.25.
    assert_eq!(number("flip_mean"), 0.0);
    let darker = compared(&[&files.a, &files.b, "--exposure", "-2"]);
    assert!(darker["flip_mean"].as_f64().unwrap() > 0.01, "{darker}");
    assert!((darker["rel_mse"].as_f64().unwrap() - 0.025 * 0.025 / (0.0625 + 0.01)).abs() < 1e-7);
    assert_eq!((&darker["sha256_a"], &darker["identical"]), (&found["sha256_a"], &false.into()));
}

#[test]
fn noise_is_known_from_a_second_picture_of_the_same_scene() {
    // Noise of ±0.2 and ±0.1 in turn, the other way round in the second picture; one bright sample in the dark.
    let spark = |index: usize| if index == 5 { 30.0 } else { 0.0 };
    let files = pair(
        |index| [[1.2, 0.9][index % 2] + spark(index); 3],
        |index| [if index == 5 { 0.0 } else { 1.0 }; 3],
    );
    let repeat = format!("{}2", files.a);
    exr(Path::new(&repeat), 4, |index| [[0.8, 1.1][index % 2]; 3]);
    let found = compared(&[&files.a, &files.b, "--repeat", &repeat, "--reference-error", "0.125"]);
    let differences = [0.4, 0.2, 0.4, 0.2, 0.4, 0.0, 0.4, 0.2].map(|d: f64| d * d / 1.01).iter().sum::<f64>();
    let dark = 29.8 * 29.8 / 0.01;
    let expected = (differences + dark) / 8.0 / 2.0 + 0.015_625;
    let value = found["rel_mse_expected"].as_f64().unwrap();
    assert!((value / expected - 1.0).abs() < 1e-5, "{value}, expected {expected}");

    exr(Path::new(&repeat), 2, |_| [1.0; 3]);
    let other = karst(&["compare", &files.a, &files.b, "--repeat", &repeat]);
    assert!(stderr(&other).contains("cannot compare: "), "{}", stderr(&other));
}

#[test]
fn what_noise_alone_would_make_of_it_comes_from_the_files() {
    let files = pair(|index| [[1.2, 0.9][index % 2]; 3], |_| [1.0; 3]);
    let known = |path: &str, rel_mse: f64, color: f32| {
        exr_by(Path::new(path), 4, |_| [color; 3], None, &json!({ "rel_mse": rel_mse }));
    };
    known(&files.a, 0.003, 1.1);
    let expected = |line: &[&str]| {
        let found = compared(&[&[files.a.as_str(), files.b.as_str()], line].concat());
        assert_eq!(found["rel_mse_ratio"].is_null(), found["rel_mse_expected"].is_null());
        found["rel_mse_expected"].as_f64()
    };
    assert_eq!(expected(&[]), None);
    assert_eq!(expected(&["--reference-error", "0.125"]), Some(0.003 + 0.015_625));
    known(&files.b, 0.001, 1.0);
    assert_eq!(expected(&[]), Some(0.004));
    assert_eq!(expected(&["--reference-error", "0.125"]), Some(0.003 + 0.015_625));
    let ratio = compared(&[&files.a, &files.b])["rel_mse_ratio"].as_f64().unwrap();
    assert!((ratio - 0.01 / 1.01 / 0.004).abs() < 1e-4, "{ratio}");
    let table = karst(&["compare", &files.a, &files.b]);
    let table = String::from_utf8(table.stdout).unwrap();
    for line in
        ["rel_mse_ratio         2.47", "flip_mean             ", "worst tile            9.9", "  4x2 at 0,0"]
    {
        assert!(table.contains(line), "{line:?} is not in\n{table}");
    }
}

#[test]
fn the_standard_error_says_how_sure_the_mean_is() {
    let files = pair(|index| [[1.2, 0.9][index % 2]; 3], |_| [1.0; 3]);
    let found = compared(&[&files.a, &files.b]);
    let number = |name: &str| found[name].as_f64().unwrap();
    // Sums of a pixel's three differences are 0.6 and -0.3, four of each: variance 8/7 of 0.45 squared, of the mean an
    // eighth of it; over 3.
    let stderr = (8.0_f64 / 7.0 * 0.45 * 0.45 / 8.0).sqrt() / 3.0;
    assert!((number("mean_rel_diff") - 0.05).abs() < 1e-6, "{found}");
    assert!((number("mean_rel_diff_stderr") - stderr).abs() < 1e-6, "{found}");
    assert!((number("mean_rel_diff_sigmas") - 0.05 / stderr).abs() < 1e-4, "{found}");
}

#[test]
fn a_layer_is_held_against_the_beauty_of_a_reference() {
    let files = pair(|_| [1.0; 3], |_| [3.0; 3]);
    exr_with(Path::new(&files.a), 4, |_| [1.0; 3], Some([3.0; 3]));
    let found = compared(&[&files.a, &files.b, "--layer", "Denoised", "--reference-layer", "beauty"]);
    assert_eq!((&found["identical"], &found["sha256_a"]), (&true.into(), &found["sha256_b"]));
    assert_eq!(compared(&[&files.a, &files.b])["identical"], false);
}

#[test]
fn pictures_of_other_sizes_cannot_be_compared() {
    let files = pair(|_| [1.0; 3], |_| [1.0; 3]);
    exr(Path::new(&files.b), 5, |_| [1.0; 3]);
    let output = karst(&["compare", &files.a, &files.b]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("a.exr is 4x2") && stderr(&output).contains("b.exr is 5x2"));
}

#[test]
fn a_file_that_is_no_picture_is_bad_input() {
    let files = pair(|_| [1.0; 3], |_| [1.0; 3]);
    std::fs::write(&files.b, "not a picture").unwrap();
    let output = karst(&["compare", &files.a, &files.b]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).starts_with("error: ") && stderr(&output).contains("b.exr"));
    assert_eq!(karst(&["compare", &files.a, &files.b, "--layer", "Nope"]).status.code(), Some(2));
}

#[test]
fn a_missing_file_is_named() {
    let output = karst(&["check", "/nowhere/scene.json"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).starts_with("error: /nowhere/scene.json: "), "{}", stderr(&output));
}

#[test]
fn nobody_listening_comes_with_a_hint() {
    let output = karst(&["jobs", "--server", "http://127.0.0.1:1"]);
    assert_eq!(output.status.code(), Some(1));
    let text = stderr(&output);
    assert!(text.starts_with("error: cannot reach http://127.0.0.1:1: connection refused"), "{text}");
    assert!(text.contains("\n  hint: start a server with `karst-server serve`"), "{text}");
    assert!(output.stdout.is_empty());
}

#[test]
fn a_senseless_server_address_is_bad_input() {
    for address in ["127.0.0.1:7878", "ftp://a", "http://", "x y"] {
        let output = karst(&["jobs", "--server", address]);
        assert_eq!(output.status.code(), Some(2), "{address}: {}", stderr(&output));
    }
}

#[test]
fn outputs_must_be_pictures() {
    let output = karst(&["render", "scene.json", "-o", "out.jpg"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(stderr(&output), "error: --output out.jpg: expected a name in .exr or .png\n");
}
