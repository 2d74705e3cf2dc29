//! Round trips and refusals of the translation.

use karst_core::film::Region;
use karst_core::scene::{ErrorOf, Overrides, Problem, Problems};

use super::{
    from_f16, job_from_wire, problems_to_status, rgb_f16, rgb_f32, settings_from_wire, settings_to_wire,
};
use crate::errors::violations;
use crate::v1;

fn good() -> v1::JobSpec {
    v1::JobSpec {
        display_name: "cave".to_owned(),
        scene: Some(v1::Scene {
            digest: "a".repeat(64),
            files: vec![v1::SceneFile { path: "meshes/floor.obj".to_owned(), digest: "0".repeat(64) }],
        }),
        ..v1::JobSpec::default()
    }
}

/// The fields that are refused after a change to a good job.
fn refused(change: impl FnOnce(&mut v1::JobSpec)) -> Vec<String> {
    let mut job = good();
    change(&mut job);
    let found = job_from_wire(Some(&job)).expect_err("must be refused");
    found.into_iter().map(|violation| violation.field).collect()
}

fn refused_settings(settings: v1::RenderSettings) -> Vec<String> {
    refused(|job| job.settings = Some(settings))
}

#[test]
fn a_good_job_passes_with_its_defaults() {
    let job = job_from_wire(Some(&good())).unwrap();
    assert_eq!(job.files, [("meshes/floor.obj".to_owned(), "0".repeat(64))]);
    assert_eq!((job.frames, job.tile_size, job.denoise), (None, None, v1::Denoise::Off));
    let frames = Some(v1::FrameRange { first: -3, last: 9, step: 0 });
    let job = job_from_wire(Some(&v1::JobSpec { frames, ..good() })).unwrap();
    assert_eq!(job.frames, Some((-3, 9, 1)));
}

#[test]
fn settings_survive_the_round_trip() {
    let adaptive = Overrides {
        spp: None,
        target_error: Some(0.05),
        error_of: Some(ErrorOf::Denoised),
        min_spp: Some(8),
        max_spp: Some(512),
        time_limit: Some(1.5),
        seed: Some(7),
        size: Some((640, 360)),
        crop: Some(Region { x0: 1, y0: 2, x1: 3, y1: 4 }),
    };
    assert_eq!(settings_from_wire(&settings_to_wire(&adaptive)).as_ref(), Ok(&adaptive));
    let fixed = Overrides { spp: Some(1), ..Overrides::default() };
    assert_eq!(settings_from_wire(&settings_to_wire(&fixed)).as_ref(), Ok(&fixed));
}

#[test]
fn a_job_without_parts_is_refused() {
    assert_eq!(job_from_wire(None).unwrap_err()[0].field, "job");
    assert_eq!(refused(|job| job.scene = None), ["job.scene"]);
}

#[test]
fn bad_fields_are_all_named() {
    let bad = refused(|job| {
        job.display_name = "x".repeat(201);
        job.frames = Some(v1::FrameRange { first: 2, last: 1, step: 1 });
        job.tile_size = 24;
    });
    assert_eq!(bad, ["job.display_name", "job.frames.last", "job.tile_size"]);
    assert_eq!(refused(|job| job.tile_size = 272), ["job.tile_size"]);
}

#[test]
fn bad_digests_and_paths_are_refused() {
    for digest in ["", "abc", &"A".repeat(64), &"g".repeat(64), &"é".repeat(32), &"0".repeat(1000)] {
        let bad = refused(|job| job.scene.as_mut().unwrap().digest = digest.to_owned());
        assert_eq!(bad, ["job.scene.digest"], "{digest:?}");
    }
    for path in ["", "../a.obj", "a/../../b.obj", "/etc/passwd", "a//b", "a\\b", "a\0b", &"x".repeat(513)] {
        let bad = refused(|job| job.scene.as_mut().unwrap().files[0].path = path.to_owned());
        assert_eq!(bad, ["job.scene.files[0].path"], "{path:?}");
    }
    let twice = refused(|job| {
        let files = &mut job.scene.as_mut().unwrap().files;
        files.push(files[0].clone());
    });
    assert_eq!(twice, ["job.scene.files[1].path"]);
}

#[test]
fn senseless_settings_are_refused() {
    let none = v1::RenderSettings::default();
    let cases = [
        (v1::RenderSettings { spp: Some(0), ..none }, "spp"),
        (v1::RenderSettings { spp: Some(u32::MAX), ..none }, "spp"),
        (v1::RenderSettings { spp: Some(4), target_error: Some(0.1), ..none }, "spp"),
        (v1::RenderSettings { target_error: Some(f64::NAN), ..none }, "target_error"),
        (v1::RenderSettings { target_error: Some(-1.0), ..none }, "target_error"),
        (v1::RenderSettings { time_limit_seconds: Some(f64::INFINITY), ..none }, "time_limit_seconds"),
        (v1::RenderSettings { min_spp: Some(8), max_spp: Some(4), ..none }, "min_spp"),
        (v1::RenderSettings { max_spp: Some(1), ..none }, "max_spp"),
        (v1::RenderSettings { size: Some(v1::Size { width: 0, height: 9 }), ..none }, "size"),
        (v1::RenderSettings { crop: Some(v1::Region { x0: 5, y0: 0, x1: 5, y1: 1 }), ..none }, "crop"),
        (v1::RenderSettings { crop: Some(v1::Region { x0: 9, y0: 0, x1: 5, y1: 1 }), ..none }, "crop"),
    ];
    for (settings, field) in cases {
        assert_eq!(refused_settings(settings), [format!("job.settings.{field}")], "{settings:?}");
    }
}

#[test]
fn scene_problems_keep_their_places() {
    let problem = Problem {
        origin: "scene.json".to_owned(),
        line: 12,
        column: 9,
        path: "spheres.lamp.radius".to_owned(),
        message: "found -3, expected a number above 0".to_owned(),
        hint: Some("use 3".to_owned()),
    };
    let status = problems_to_status(&Problems { problems: vec![problem], total: 61 });
    let (listed, total) = violations(&status);
    assert_eq!((listed[0].field.as_str(), total), ("scene.json:12:9: spheres.lamp.radius", 61));
    assert_eq!(listed[0].description, "found -3, expected a number above 0\n  hint: use 3");
}

#[test]
fn pixels_are_little_endian() {
    assert_eq!(rgb_f32([[1.0, 0.0, -2.0]]), [0, 0, 128, 63, 0, 0, 0, 0, 0, 0, 0, 192]);
    assert_eq!(rgb_f16([[1.0, 1e30, -1e30]]), [0, 60, 255, 123, 255, 251]);
    assert_eq!(rgb_f16([[f32::NAN, 0.0, 0.0]]).len(), 6);
    assert_eq!(from_f16(&rgb_f16([[0.5, -3.0, 1e30]])).collect::<Vec<_>>(), [0.5, -3.0, 65504.0]);
    assert_eq!(from_f16(&[0, 60, 1]).collect::<Vec<_>>(), [1.0]);
}
