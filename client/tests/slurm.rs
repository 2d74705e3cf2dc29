//! `karst slurm` from outside, with programs of a cluster that only write down how they were called.
#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

const SERVER: &str = "http://farm.example:7878";

/// A folder with a scene of nine frames and a folder `bin` for programs.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        std::fs::create_dir(place.path("bin")).unwrap();
        let document = json!({
            "version": 1,
            "camera": {"type": "perspective", "vfov": 40,
                       "transform": {"look_at": {"eye": [0, 0, 4], "target": [0, 0, 0]}}},
            "film": {"width": 32, "height": 16},
            "sampling": {"spp": 2},
            "materials": {"grey": {"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]}},
            "spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "grey"}},
            "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}},
            "animation": {"fps": 24, "frames": [1, 9], "tracks": {
                "spheres.ball.radius": {"interpolation": "linear",
                                        "keys": [{"frame": 1, "value": 1}, {"frame": 9, "value": 0.5}]}}},
        });
        std::fs::write(place.path("ball.json"), document.to_string()).unwrap();
        place
    }

    /// The same with a cluster: programs that write their arguments into `calls`, one a line; `sbatch` keeps the
    /// script as well, and `squeue` prints `queue.json`.
    fn with_slurm() -> Self {
        let place = Self::new();
        let note = "printf '%s\\n' \"${0##*/}\" \"$@\" END >>\"$KARST_TEST_CALLS\"";
        let keep = "for word in \"$@\"; do case \"$word\" in */karst-*) cat \"$word\" >\"$KARST_TEST_CALLS.script\" \
                    2>/dev/null;; esac; done";
        place.program("sbatch", &format!("{note}\n{keep}\necho '77;cluster'"));
        place.program("squeue", "cat \"$KARST_TEST_CALLS.queue\"");
        place.program("scancel", note);
        place.program("scontrol", "printf 'MaxArraySize            = 1001\\nMaxJobCount = 10000\\n'");
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn program(&self, name: &str, body: &str) {
        let path = self.path("bin").join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{body}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn karst(&self, line: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_karst"))
            .arg("slurm")
            .args(line)
            .current_dir(self.0.path())
            .env("PATH", format!("{}:/usr/bin:/bin", self.path("bin").display()))
            .env("KARST_TEST_CALLS", self.path("calls"))
            .env_remove("KARST_SERVER")
            .env_remove("KARST_TOKEN_FILE")
            .env_remove("KARST_CA_FILE")
            .output()
            .unwrap()
    }

    /// Standard output of a command that succeeds.
    fn done(&self, line: &[&str]) -> String {
        let output = self.karst(line);
        assert_eq!(output.status.code(), Some(0), "{line:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// What the programs were called with since the last question.
    fn calls(&self) -> Vec<Vec<String>> {
        let text = std::fs::read_to_string(self.path("calls")).unwrap_or_default();
        let _ = std::fs::remove_file(self.path("calls"));
        let words: Vec<String> = text.lines().map(str::to_owned).collect();
        words.split(|word| word == "END").filter(|call| !call.is_empty()).map(<[String]>::to_vec).collect()
    }

    fn script(&self) -> String {
        std::fs::read_to_string(self.path("calls.script")).unwrap()
    }

    fn queue(&self, jobs: &Value) {
        std::fs::write(self.path("calls.queue"), json!({"jobs": jobs}).to_string()).unwrap();
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn user() -> u32 {
    std::fs::metadata("/proc/self").unwrap().uid()
}

/// The file in the repository that a command embeds.
fn own_script(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../slurm").join(name)).unwrap()
}

#[test]
fn a_task_renders_what_karst_render_does_and_only_once() {
    let place = Place::new();
    let task = ["render", "ball.json", "-o", "film", "--frame", "4", "--png", "--threads", "1"];
    let said = place.done(&task);
    assert_eq!(said, "film/ball.0004.png\nfilm/ball.0004.exr");
    let read = |name: &str| std::fs::read(place.path(name)).unwrap();
    let local = Command::new(env!("CARGO_BIN_EXE_karst"))
        .args(["render", "ball.json", "-o", "one.exr", "-o", "one.png", "--frame", "4"])
        .current_dir(place.0.path())
        .output()
        .unwrap();
    assert!(local.status.success(), "{}", stderr(&local));
    assert_eq!(read("film/ball.0004.exr"), read("one.exr"));
    assert_eq!(read("film/ball.0004.png"), read("one.png"));
    let made = std::fs::metadata(place.path("film/ball.0004.exr")).unwrap();
    assert_eq!(made.permissions().mode() & 0o400, 0o400);
    assert!(place.done(&task).contains("frame 4 is complete"));
    assert_eq!(std::fs::metadata(place.path("film/ball.0004.exr")).unwrap().ino(), made.ino());
    let names: Vec<_> =
        std::fs::read_dir(place.path("film")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names.len(), 3, "nothing is left beside the frame and its note: {names:?}");
}

#[test]
fn a_frame_is_missing_for_each_of_its_reasons() {
    let place = Place::new();
    for frame in ["1", "2", "3", "4", "5", "6", "7", "9"] {
        place.done(&["render", "ball.json", "-o", "film", "--frame", frame]);
    }
    let missing = |more: &[&str]| place.done(&[&["missing", "ball.json", "-o", "film"], more].concat());
    assert_eq!(missing(&[]), "8");
    place.done(&["render", "ball.json", "-o", "film", "--frame", "8"]);
    let output = place.karst(&["missing", "ball.json", "-o", "film"]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(0), 0));
    assert!(stderr(&output).contains("all 9 frames are complete"), "{}", stderr(&output));
    assert_eq!(missing(&["--spp", "2", "--seed", "0"]), "", "what the scene says anyway changes nothing");
    assert_eq!(missing(&["--spp", "4"]), "1-9");
    assert_eq!(missing(&["--png"]), "1-9");
    assert_eq!(missing(&["--frames", "1-9:4", "--denoise", "full"]), "1-9:4");

    std::fs::remove_file(place.path("film/ball.0001.exr")).unwrap();
    std::fs::remove_file(place.path("film/ball.0003.json")).unwrap();
    let mut damaged = std::fs::read(place.path("film/ball.0005.exr")).unwrap();
    *damaged.last_mut().unwrap() ^= 1;
    std::fs::write(place.path("film/ball.0005.exr"), damaged).unwrap();
    std::fs::copy(place.path("film/ball.0007.exr"), place.path("film/ball.0006.exr")).unwrap();
    std::fs::copy(place.path("film/ball.0007.json"), place.path("film/ball.0006.json")).unwrap();
    let found: Value = serde_json::from_str(&missing(&["--json"])).unwrap();
    assert_eq!(found, json!({"array": "1-5:2,6", "missing": [1, 3, 5, 6], "complete": 5, "total": 9}));

    let scene = std::fs::read_to_string(place.path("ball.json")).unwrap();
    std::fs::write(place.path("ball.json"), scene.replace("0.4", "0.6")).unwrap();
    assert_eq!(missing(&[]), "1-9", "another scene");
}

#[test]
fn a_scene_that_changes_under_a_frame_leaves_nothing() {
    let place = Place::new();
    let mut task = Command::new(env!("CARGO_BIN_EXE_karst"))
        .args(["slurm", "render", "ball.json", "-o", "film", "--frame", "1", "--spp", "5000"])
        .current_dir(place.0.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(task.stderr.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().ends_with("rendering"));
    let scene = std::fs::read_to_string(place.path("ball.json")).unwrap();
    std::fs::write(place.path("ball.json"), scene.replace("0.4", "0.6")).unwrap();
    let said: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(task.wait().unwrap().code(), Some(1));
    assert!(said.join("\n").contains("the scene changed while frame 1 was rendered"), "{said:?}");
    assert_eq!(std::fs::read_dir(place.path("film")).unwrap().count(), 0);
}

#[test]
fn what_cannot_be_rendered_or_kept_is_said_before() {
    let place = Place::new();
    let refused = |line: &[&str], code: i32, text: &str| {
        let output = place.karst(line);
        assert_eq!(output.status.code(), Some(code), "{line:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(text), "{}", stderr(&output));
    };
    refused(
        &["render", "nothing.json", "-o", "film", "--frame", "1"],
        1,
        "error: nothing.json: No such file",
    );
    refused(&["render", "ball.json", "-o", "film", "--frame", "10"], 2, "the scene has frames 1 to 9");
    refused(&["render", "ball.json", "-o", "ball.json/film", "--frame", "1"], 1, "error: ball.json/film: ");
    refused(&["preflight", "ball.json", "-o", "ball.json/film"], 1, "error: ball.json/film: ");
    for command in ["frames", "missing", "preflight"] {
        refused(&[command, "nothing.json", "-o", "film"], 1, "error: nothing.json: No such file");
    }
    assert!(!place.path("film").exists());
}

#[test]
fn preflight_renders_small_and_leaves_nothing() {
    let place = Place::new();
    for line in [&["preflight"][..], &["frames", "--preflight"]] {
        let line =
            [line, &["ball.json", "-o", "film", "--size", "640x320", "--spp", "100", "--json"]].concat();
        let found: Value = serde_json::from_str(&place.done(&line)).unwrap();
        assert_eq!((&found["frames"], &found["at_most"]), (&9.into(), &false.into()));
        let number = |name: &str| found[name].as_f64().unwrap();
        assert!(number("estimated_seconds_per_frame") > number("trial_seconds"), "{found}");
        assert!((number("estimated_seconds") / number("estimated_seconds_per_frame") - 9.0).abs() < 1e-6);
    }
    assert_eq!(std::fs::read_dir(place.path("film")).unwrap().count(), 0);
}

#[test]
fn frames_submits_what_is_missing() {
    let place = Place::with_slurm();
    place.done(&["render", "ball.json", "-o", "film", "--frame", "3", "--spp", "5"]);
    let line =
        ["frames", "ball.json", "-o", "film", "--spp", "5", "--at-once", "4", "--", "-p", "long", "--time=9"];
    assert_eq!(place.done(&line), "77");
    let calls = place.calls();
    let [call] = calls.as_slice() else { panic!("one call of sbatch: {calls:?}") };
    let root = place.0.path().display().to_string();
    let has = |words: &[&str]| call.windows(words.len()).any(|found| found == words);
    assert!(has(&["sbatch", "--parsable"]) && has(&["-p", "long", "--time=9"]), "{call:?}");
    assert!(has(&["--array=1-2,4-9%4"]), "{call:?}");
    assert!(has(&[&format!("{root}/ball.json"), "--output", &format!("{root}/film"), "--spp=5"]), "{call:?}");
    assert_eq!(place.script(), own_script("frames.sbatch"));
    assert!(place.path("film/logs").is_dir(), "Slurm does not make the folder of a log");
    for frame in ["1", "2", "4", "5", "6", "7", "8", "9"] {
        place.done(&["render", "ball.json", "-o", "film", "--frame", frame, "--spp", "5"]);
    }
    assert_eq!((place.done(&line).as_str(), place.calls().len()), ("", 0));
}

#[test]
fn a_cluster_with_small_arrays_gets_several() {
    let place = Place::with_slurm();
    place.program("scontrol", "echo 'MaxArraySize = 4'");
    assert_eq!(place.done(&["frames", "ball.json", "-o", "film"]), "77\n77\n77");
    let word = |call: &[String], start: &str| call.iter().find(|word| word.starts_with(start)).cloned();
    let calls = place.calls();
    let arrays: Vec<_> = calls.iter().map(|call| word(call, "--array").unwrap()).collect();
    assert_eq!(arrays, ["--array=0-3", "--array=0-3", "--array=0"]);
    let shifts: Vec<_> = calls
        .iter()
        .map(|call| call[call.iter().position(|word| word == "--shift").unwrap() + 1].clone())
        .collect();
    assert_eq!(shifts, ["1", "5", "9"]);
}

#[test]
fn up_submits_pilots_that_are_found_again() {
    let place = Place::with_slurm();
    std::fs::write(place.path("farm.token"), "secret\n").unwrap();
    std::fs::write(place.path("cert.pem"), "x").unwrap();
    let files = ["--token-file", "farm.token", "--ca-file", "cert.pem"];
    let line =
        [&["up", "--server", SERVER, "--workers", "12"], &files[..], &["--", "--comment=mine"]].concat();
    assert_eq!(place.done(&line), "77");
    let calls = place.calls();
    let call = &calls[0];
    let at = |word: &str| {
        call.iter().position(|found| found == word).unwrap_or_else(|| panic!("{word}: {call:?}"))
    };
    assert!(at("--comment=karst server=http://farm.example:7878") > at("--comment=mine"), "ours counts");
    let (_, _) = (at("--array=0-11"), at("--job-name=karst-workers"));
    let root = place.0.path();
    assert_eq!(call[at("--server") + 1], SERVER);
    assert_eq!(call[at("--token-file") + 1], root.join("farm.token").display().to_string());
    assert_eq!(call[at("--ca-file") + 1], root.join("cert.pem").display().to_string());
    assert!(!call.iter().any(|word| word.contains("secret")), "a token is never on a command line");
    assert_eq!(place.script(), own_script("workers.sbatch"));
    let output = place.karst(&["up", "--workers", "1", "--token-file", "nothing.token"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("nothing.token") && place.calls().is_empty());
    assert!(stderr(&place.karst(&["up", "--workers", "1"])).contains("means each node itself"));
}

/// A task of an array of pilots for `SERVER`.
fn pilot(job: u32, index: u32, state: &str) -> Value {
    json!({"job_id": job + index, "array_job_id": job, "array_task_id": index, "array_task_string": "",
           "job_state": state, "state_reason": "None", "name": "karst-workers", "nodes": format!("n{index}"),
           "comment": format!("karst server={SERVER}"), "user_id": user(), "restart_cnt": 0})
}

#[test]
fn status_and_down_know_whose_pilots_are_whose() {
    let place = Place::with_slurm();
    let mut waiting = pilot(40, 3, "PENDING");
    waiting["array_task_id"] = Value::Null;
    waiting["array_task_string"] = "3-9%3".into();
    waiting["state_reason"] = "Priority".into();
    waiting["nodes"] = "".into();
    let mut stranger = pilot(60, 0, "RUNNING");
    stranger["user_id"] = (user() + 1).into();
    let mut other = pilot(70, 0, "RUNNING");
    other["comment"] = "karst server=http://other:1".into();
    let over = pilot(50, 0, "FAILED");
    place.queue(&json!([pilot(40, 0, "RUNNING"), waiting, pilot(40, 1, "RUNNING"), over, stranger, other]));

    let text = place.done(&["status", "--server", SERVER]);
    assert!(text.ends_with("2 workers run for http://farm.example:7878, 7 wait"), "{text}");
    assert!(text.contains("40_3-9%3") && text.contains("(Priority)") && text.contains("FAILED"), "{text}");
    assert!(!text.contains("60_0") && !text.contains("70_0"), "{text}");
    let found: Value =
        serde_json::from_str(&place.done(&["status", "--json", "--server", &format!("{SERVER}/")])).unwrap();
    assert_eq!((&found["workers"], &found["waiting"]), (&2.into(), &7.into()));
    assert_eq!(found["states"], json!({"FAILED": 1, "PENDING": 7, "RUNNING": 2}));

    let found: Value = serde_json::from_str(&place.done(&["down", "--json", "--server", SERVER])).unwrap();
    assert_eq!((&found["ending"], &found["cancelled"], &found["jobs"]), (&2.into(), &7.into(), &json!([40])));
    let calls = place.calls();
    assert_eq!(
        calls,
        [
            ["scancel", "--quiet", "--state=PENDING", "40"].map(str::to_owned).to_vec(),
            ["scancel", "--quiet", "--batch", "--signal=TERM", "40"].map(str::to_owned).to_vec(),
        ]
    );
    place.queue(&json!([]));
    assert_eq!(place.done(&["status", "--server", SERVER]), format!("0 workers run for {SERVER}, 0 wait"));
    place.done(&["down", "--server", SERVER]);
    assert!(place.calls().is_empty(), "nothing to cancel");
}

#[test]
fn without_slurm_it_says_where_to_go() {
    let place = Place::new();
    // A PATH without any program.
    let run = |line: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_karst"));
        command.arg("slurm").args(line).current_dir(place.0.path()).env("PATH", place.path("bin"));
        command.output().unwrap()
    };
    for line in
        [&["up", "--workers", "2"][..], &["status"], &["down"], &["frames", "ball.json", "-o", "film"]]
    {
        let output = run(line);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains("login node"), "{line:?}: {}", stderr(&output));
    }
    assert_eq!(run(&["missing", "ball.json", "-o", "film"]).status.code(), Some(0), "needs no Slurm");
}

#[test]
fn what_slurm_says_against_it_is_passed_on() {
    let place = Place::with_slurm();
    place.program("sbatch", "echo 'sbatch: error: invalid partition specified: x' >&2; exit 1");
    let output = place.karst(&["frames", "ball.json", "-o", "film", "--", "-p", "x"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("invalid partition specified: x"), "{}", stderr(&output));
    place.program("sbatch", "echo 'Submitted'");
    let output = place.karst(&["up", "--server", SERVER, "--workers", "1"]);
    assert!(stderr(&output).contains("expected the id of a job"), "{}", stderr(&output));
    place.program("squeue", "echo 'squeue: unrecognized option'");
    let output = place.karst(&["status", "--server", SERVER]);
    assert!(stderr(&output).contains("Slurm 21.08"), "{}", stderr(&output));
}
