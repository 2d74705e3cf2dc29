//! `karst view` against a real server and a tev that reads what it is sent with a decoder of its own.

#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![expect(clippy::print_stdout, reason = "a test that is skipped says why")]

mod decode;
mod stand;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use karst_core::encode::ExrImage;
use serde_json::json;

use decode::{Packet, Picture};
use stand::{Farm, Tev, stderr};

/// Enough samples that a frame is looked at before it is finished.
const SLOW: u32 = 256;

/// The picture has the bits of the EXR inside its window and is black elsewhere.
fn assert_exact(picture: &Picture, image: &ExrImage, channels: &[&str]) {
    assert_eq!((picture.width, picture.height), (image.full.0 as usize, image.full.1 as usize));
    let mut expected: Vec<&str> = channels.to_vec();
    expected.sort_unstable();
    assert_eq!(picture.channels.keys().collect::<Vec<_>>(), expected);
    let (left, top) = (image.origin.0 as usize, image.origin.1 as usize);
    for name in channels {
        let (shown, stored) = (&picture.channels[*name], image.channel(name).unwrap());
        for (at, value) in shown.iter().enumerate() {
            let (x, y) = ((at % picture.width).wrapping_sub(left), (at / picture.width).wrapping_sub(top));
            let inside = x < image.width as usize && y < image.height as usize;
            let wanted = if inside { stored[y * image.width as usize + x] } else { 0.0 };
            assert_eq!(
                value.to_bits(),
                wanted.to_bits(),
                "{name} at {x},{y} of the window: {value}, {wanted}"
            );
        }
    }
}

fn is_create(packet: &Packet) -> bool {
    matches!(packet, Packet::Create { .. })
}

#[test]
fn a_crop_improves_and_ends_with_the_bits_of_the_exr() {
    let (farm, tev) = (Farm::start(), Tev::start());
    let crop = ["--frame", "2", "--tile-size", "16", "--crop", "19,5,61,37"];
    let job = farm.submit(&json!({"spp": SLOW}), &crop);
    let layers = ["--layer", "Normal", "--layer", "color", "--layer", "depth"];
    let view = farm.view(&job, tev.address(), &layers);
    let mut seat = tev.accept();
    let _worker = farm.work();
    let mut before = Vec::new();
    while let Some(packet) = seat.take() {
        if let Packet::Update { corner, planes, .. } = packet {
            before.push((corner, planes));
        }
    }
    assert_eq!(view.end().0, Some(0));
    assert_eq!(seat.screen.front, ["cave 2 frame 2"]);
    let image = farm.exr(&job, "cave 2.exr");
    assert_eq!((image.origin, image.width, image.height), ((19, 5), 61, 37));
    let channels = ["R", "G", "B", "Normal.X", "Normal.Y", "Normal.Z", "Depth.Z"];
    assert_exact(&seat.screen.pictures["cave 2 frame 2"], &image, &channels);
    // The same tile came more than once, each time with other values.
    let states: Vec<_> = before.iter().filter(|(corner, p)| *corner == (32, 16) && p[0].0 == "R").collect();
    assert!(states.len() > 1, "{} updates, {} of one tile", before.len(), states.len());
    assert!(states.windows(2).any(|pair| pair[0].1 != pair[1].1), "a tile improves");
}

#[test]
fn a_finished_frame_comes_with_all_that_its_exr_has() {
    let (farm, tev) = (Farm::start(), Tev::start());
    let job = farm.submit(&json!({"spp": 4}), &["--frame", "1"]);
    let worker = farm.work();
    farm.done(&["watch", &job]);
    drop(worker);
    let layers = ["color", "albedo", "normal", "depth", "samples", "error", "denoised"];
    let options: Vec<&str> = layers.iter().flat_map(|layer| ["--layer", layer]).collect();
    let view = farm.view(&job, tev.address(), &options);
    let mut seat = tev.accept();
    seat.take_all();
    let (code, said) = view.end();
    assert_eq!(code, Some(0), "{said}");
    let missing = "warning: cave 2 frame 1 has no channels Denoised.R Denoised.G Denoised.B\n";
    assert!(said.contains(missing), "{said}");
    let picture = seat.screen.pictures.get_mut("cave 2 frame 1").unwrap();
    for name in ["Denoised.R", "Denoised.G", "Denoised.B"] {
        assert!(picture.channels.remove(name).unwrap().iter().all(|value| *value == 0.0));
    }
    let image = farm.exr(&job, "cave 2.exr");
    let names: Vec<&str> = image.channels.iter().map(|(name, _)| name.as_str()).collect();
    assert_exact(picture, &image, &names);
    assert!(image.channel("Depth.Z").unwrap().contains(&f32::INFINITY), "not every value is finite");
}

#[test]
fn frames_follow_each_other_through_a_crash_of_the_server() {
    let (mut farm, tev) = (Farm::start(), Tev::start());
    let job = farm.submit(&json!({"spp": SLOW}), &["--name", "walk\u{1}in"]);
    let view = farm.view(&job, tev.address(), &["--follow", "--frame", "2"]);
    let mut seat = tev.accept();
    let _worker = farm.work();
    assert!(is_create(&seat.take().unwrap()), "the picture is opened first");
    farm.kill();
    farm.restart();
    seat.take_all();
    let (code, said) = view.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("connection lost"), "{said}");
    assert_eq!(seat.screen.front, ["walk_in frame 2", "walk_in frame 3"]);
    for number in 2..=3 {
        let image = farm.exr(&job, &format!("walk_in.000{number}.exr"));
        assert_exact(&seat.screen.pictures[&format!("walk_in frame {number}")], &image, &["R", "G", "B"]);
    }
}

#[test]
fn a_tev_that_does_not_read_holds_up_nobody() {
    let (farm, tev) = (Farm::start(), Tev::start());
    // Three layers of 1024 x 768 are more than a connection holds on its way.
    let job = farm.submit(&json!({"spp": 2}), &["--frame", "1", "--size", "1024x768"]);
    let layers = ["--layer", "color", "--layer", "albedo", "--layer", "normal"];
    let view = farm.view(&job, tev.address(), &layers);
    let mut seat = tev.accept();
    let _worker = farm.work();
    farm.done(&["watch", &job]);
    seat.take_all();
    assert_eq!(view.end().0, Some(0));
    let channels = ["R", "G", "B", "Albedo.R", "Albedo.G", "Albedo.B", "Normal.X", "Normal.Y", "Normal.Z"];
    assert_exact(&seat.screen.pictures["cave 2 frame 1"], &farm.exr(&job, "cave 2.exr"), &channels);
}

#[test]
fn a_tev_that_quits_ends_the_command_and_not_the_job() {
    let (farm, tev) = (Farm::start(), Tev::start());
    let job = farm.submit(&json!({"spp": SLOW}), &["--frame", "1"]);
    let address = tev.address();
    let closed = |(code, said): (Option<i32>, String)| {
        assert_eq!(code, Some(1), "{said}");
        assert!(said.ends_with(&format!("error: tev at {address} closed the connection\n")), "{said}");
    };
    // Before anything was to be sent, in the middle, and while the values are on their way.
    let view = farm.view(&job, address, &[]);
    drop(tev.accept());
    closed(view.end());
    let view = farm.view(&job, address, &[]);
    let mut seat = tev.accept();
    let _worker = farm.work();
    for _ in 0..3 {
        seat.take().unwrap();
    }
    drop(seat);
    closed(view.end());
    farm.done(&["watch", &job]);
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let (farm, tev) = (Farm::start(), Tev::start());
    let job = farm.submit(&json!({"spp": 2}), &[]);
    let address = tev.address().to_string();
    drop(tev);
    let refused = |line: &[&str], code: i32| {
        let output = farm.karst(line);
        assert_eq!(output.status.code(), Some(code), "{line:?}: {}", stderr(&output));
        stderr(&output)
    };
    let said = refused(&["view", &job, "--tev", &address], 1);
    assert!(said.contains(&format!("error: cannot reach tev at {address}: connection refused")), "{said}");
    assert!(said.contains("hint: start tev first") && said.contains("--hostname"), "{said}");
    let said = refused(&["view", &job, "--tev", &address, "--frame", "4"], 2);
    assert_eq!(said, "error: --frame: found 4, the job has 3 frames from 1 to 3\n");
    let said = refused(&["view", "nope", "--tev", &address], 1);
    assert!(said.contains("job \"nope\" is not known here"), "{said}");
    assert!(refused(&["view", &job, "--tev", "14158"], 2).contains("expected HOST:PORT"));
    let tev = Tev::start();
    farm.done(&["cancel", &job]);
    let view = farm.view(&job, tev.address(), &[]);
    tev.accept().take_all();
    let (code, said) = view.end();
    assert_eq!((code, said.ends_with("error: frame 1 was cancelled\n")), (Some(1), true), "{said}");
}

/// A Python that has `tevclient`, the encoder of tev's own author.
fn python() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("tevclient");
    let inside = folder.join("bin/python3");
    let has = |python: &Path| {
        let import =
            Command::new(python).args(["-c", "import tevclient, numpy"]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    };
    if let Some(python) = [PathBuf::from("python3"), inside.clone()].into_iter().find(|python| has(python)) {
        return Some(python);
    }
    if std::env::var_os("KARST_TEST_INSTALL").is_none_or(|value| value != "1") {
        println!("skipped: the Python package tevclient is not installed");
        return None;
    }
    let run = |command: &mut Command| command.status().is_ok_and(|status| status.success());
    let install = ["install", "--quiet", "--disable-pip-version-check", "tevclient==1.0.4", "numpy"];
    let made = run(Command::new("python3").args(["-m", "venv", "--without-pip"]).arg(&folder))
        && run(Command::new("python3").args(["-m", "pip", "--python"]).arg(&inside).args(install));
    if !made {
        println!("skipped: the Python package tevclient cannot be installed here");
    }
    made.then_some(inside)
}

#[test]
fn another_encoder_makes_the_same_bytes() {
    let Some(python) = python() else { return };
    let (farm, tev) = (Farm::start(), Tev::start());
    let job = farm.submit(&json!({"spp": 32}), &["--frame", "1", "--crop", "3,2,71,51", "--name", "Höhle"]);
    let view = farm.view(&job, tev.address(), &["--layer", "color", "--layer", "normal", "--layer", "depth"]);
    let mut seat = tev.accept();
    let _worker = farm.work();
    seat.take_all();
    assert_eq!(view.end().0, Some(0));
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &seat.bytes).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tev/oracle.py");
    let output = Command::new(python).arg(script).arg(file.path()).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(said, format!("{} packets are the same\n", seat.packets));
}
