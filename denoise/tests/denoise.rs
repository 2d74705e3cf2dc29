//! The denoiser against pictures whose truth is known, and against every way in which its program can fail.
#![allow(clippy::unwrap_used, reason = "a step that fails is a test that fails")]

use karst_denoise::{DenoiseError, Denoiser, Input, Mode, denoise};

const WIDTH: u32 = 160;
const HEIGHT: u32 = 96;

fn flat(value: f32) -> Vec<[f32; 3]> {
    vec![[value; 3]; (WIDTH * HEIGHT) as usize]
}

/// Tries again while another test, starting a program, still holds the file that was just written.
fn retry_while_busy(
    mut run: impl FnMut() -> Result<Vec<[f32; 3]>, DenoiseError>,
) -> Result<Vec<[f32; 3]>, DenoiseError> {
    loop {
        match run() {
            Err(DenoiseError::Io(error)) if error.kind() == std::io::ErrorKind::ExecutableFileBusy => {}
            other => return other,
        }
    }
}

#[test]
fn wrong_planes_and_sizes_are_refused_before_a_program_is_started() {
    let denoiser = Denoiser::at("no/such/program");
    let color = flat(0.5);
    let input = Input { width: WIDTH, height: HEIGHT, color: &color, albedo: &color[1..], normal: &color };
    let error = denoiser.denoise(&input, Mode::Full).unwrap_err();
    assert_eq!(error.to_string(), "albedo: found 15359 pixels, expected 15360");
    for (width, height) in [(0, 0), (u32::MAX, u32::MAX)] {
        let error = denoiser.denoise(&Input { width, height, ..input }, Mode::Color).unwrap_err();
        assert!(error.to_string().starts_with("picture: found"), "{error}");
    }
    let error = denoiser.denoise(&input, Mode::Color).unwrap_err();
    assert!(matches!(error, DenoiseError::ProgramMissing { .. }), "{error}");
    assert!(error.to_string().starts_with("karst-oidn: not found at no/such/program\nhint: "), "{error}");
}

#[cfg(not(feature = "oidn"))]
#[test]
fn without_the_feature_the_message_says_so() {
    let color = flat(0.5);
    let input = Input { width: WIDTH, height: HEIGHT, color: &color, albedo: &[], normal: &[] };
    let error = denoise(&input, Mode::Color).unwrap_err();
    assert!(matches!(error, DenoiseError::NotBuilt));
    assert_eq!(
        error.to_string(),
        "denoising is not part of this build\nhint: build with the feature `oidn`, which is on by default"
    );
}

/// A program that is not `karst-oidn`, written as a shell script into a fresh folder.
#[cfg(unix)]
mod foreign {
    use super::{HEIGHT, WIDTH, flat, retry_while_busy};
    use karst_denoise::{DenoiseError, Denoiser, Input, Mode};
    use std::os::unix::fs::PermissionsExt;

    fn run(script: &str) -> DenoiseError {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("karst-oidn");
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
        let color = flat(0.5);
        let input = Input { width: WIDTH, height: HEIGHT, color: &color, albedo: &color, normal: &color };
        retry_while_busy(|| Denoiser::at(&path).denoise(&input, Mode::Full)).unwrap_err()
    }

    #[test]
    fn one_that_crashes_is_reported_with_its_signal_and_last_words() {
        let error = run("echo 'terrible things' >&2; kill -SEGV $$");
        assert!(matches!(error, DenoiseError::Crashed { .. }), "{error:?}");
        let text = error.to_string();
        assert!(text.contains("signal: 11") && text.ends_with(": terrible things"), "{text}");
        assert!(matches!(run("exit 3"), DenoiseError::Crashed { .. }));
        assert!(matches!(run("exec head -c 1000"), DenoiseError::Answer(_)));
    }

    #[test]
    fn one_of_another_version_is_named() {
        let error = run("printf 'KARSTDNZ\\007\\000\\000\\000\\000\\000\\000\\000'; cat >/dev/null");
        assert_eq!(
            error.to_string(),
            "karst-oidn: speaks version 7, expected 1\nhint: build all programs together"
        );
    }

    #[test]
    fn one_that_never_reads_or_never_stops_writing_does_not_block() {
        assert!(matches!(run("exec yes"), DenoiseError::Answer(_)));
        assert!(matches!(run("head -c 1000000 /dev/zero >&2; exec yes"), DenoiseError::Answer(_)));
    }

    #[test]
    fn a_missing_library_is_named_with_the_command_that_fetches_it() {
        let said =
            "karst-oidn: error while loading shared libraries: libx.so.2: cannot open shared object file";
        let error = run(&format!("echo '{said}' >&2; exit 127"));
        assert!(matches!(error, DenoiseError::LibraryMissing { .. }), "{error:?}");
        assert!(error.to_string().ends_with("hint: `./run setup` fetches the OIDN libraries"), "{error}");
    }
}

#[cfg(feature = "oidn")]
mod real {
    use super::{Denoiser, HEIGHT, Input, Mode, WIDTH, denoise, flat, retry_while_busy};
    use karst_denoise::DenoiseError;

    /// A small, portable generator (SplitMix64): uniform in [0, 1).
    struct Uniform(u64);

    impl Uniform {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f32 / (1_u64 << 24) as f32
        }
    }

    struct Picture {
        truth: Vec<[f32; 3]>,
        color: Vec<[f32; 3]>,
        albedo: Vec<[f32; 3]>,
        normal: Vec<[f32; 3]>,
    }

    /// Tiles of two reflectances under a light that falls off, with the noise of a few samples per pixel.
    fn picture() -> Picture {
        let mut random = Uniform(1);
        let mut picture = Picture { truth: vec![], color: vec![], albedo: vec![], normal: vec![] };
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let tile = if (x / 5 + y / 5) % 2 == 0 { [0.8, 0.3, 0.2] } else { [0.2, 0.5, 0.7] };
                let light = 8.0 * falloff(x as f32 / WIDTH as f32, y as f32 / HEIGHT as f32);
                let truth = tile.map(|value: f32| value * light);
                // Two samples that find the light one time in four.
                let hits = (0..2).filter(|_| random.next() < 0.25).count();
                let wobble = 1.0 + 0.1 * (random.next() - 0.5);
                picture.truth.push(truth);
                picture.color.push(truth.map(|value| value * 2.0 * hits as f32));
                picture.albedo.push(tile.map(|value| value * wobble));
                picture.normal.push([0.05 * (random.next() - 0.5), 0.0, 1.0]);
            }
        }
        picture
    }

    fn falloff(x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - 0.3, y - 0.6);
        1.0 / (1.0 + 20.0 * (dx * dx + dy * dy))
    }

    /// relMSE as everywhere in karst: mean of (x - truth)² / (truth² + 0.01).
    fn error(found: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
        let pairs = found.as_flattened().iter().zip(truth.as_flattened());
        let sum: f64 =
            pairs.map(|(&x, &t)| (f64::from(x) - f64::from(t)).powi(2) / (f64::from(t).powi(2) + 0.01)).sum();
        sum / (truth.len() * 3) as f64
    }

    #[test]
    fn the_error_falls_and_features_help() {
        let Picture { truth, color, albedo, normal } = picture();
        let input = Input { width: WIDTH, height: HEIGHT, color: &color, albedo: &albedo, normal: &normal };
        let noisy = error(&color, &truth);
        let alone = error(&denoise(&input, Mode::Color).unwrap(), &truth);
        let full = error(&denoise(&input, Mode::Full).unwrap(), &truth);
        println!("relMSE: noisy {noisy:.4}, color {alone:.4}, full {full:.4}");
        assert!(alone < noisy / 4.0, "color: {alone} of {noisy}");
        assert!(full < alone / 2.0, "full: {full}, color alone: {alone}");
    }

    #[test]
    fn the_picture_does_not_depend_on_run_or_threads() {
        let Picture { color, albedo, normal, .. } = picture();
        let input = Input { width: WIDTH, height: HEIGHT, color: &color, albedo: &albedo, normal: &normal };
        let denoiser = Denoiser::find().unwrap();
        let first = denoiser.clone().with_threads(1).denoise(&input, Mode::Full).unwrap();
        assert!(first == denoiser.clone().with_threads(2).denoise(&input, Mode::Full).unwrap());
        assert!(first == denoiser.denoise(&input, Mode::Full).unwrap());
    }

    #[test]
    fn one_pixel_is_a_picture() {
        let one = [[0.25, 0.5, 0.75]];
        let input = Input { width: 1, height: 1, color: &one, albedo: &one, normal: &one };
        assert_eq!(denoise(&input, Mode::Full).unwrap().len(), 1);
    }

    /// Away from its folder the program finds no libraries: the loader's message must arrive with a hint.
    #[test]
    fn a_copy_far_from_the_libraries_says_which_one_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let copy = folder.path().join("karst-oidn");
        std::fs::copy(env!("CARGO_BIN_EXE_karst-oidn"), &copy).unwrap();
        let color = flat(0.5);
        let input = Input { width: WIDTH, height: HEIGHT, color: &color, albedo: &[], normal: &[] };
        let Err(error) = retry_while_busy(|| Denoiser::at(&copy).denoise(&input, Mode::Color)) else {
            return println!("skipped: OIDN is installed for the whole system");
        };
        let text = error.to_string();
        assert!(matches!(error, DenoiseError::LibraryMissing { .. }), "{text}");
        assert!(text.contains("libOpenImageDenoise.so.2") && text.contains("./run setup"), "{text}");
    }
}
