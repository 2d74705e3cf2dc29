//! Pictures of a rendered film: denoised if asked for, written as EXR or PNG.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use glam::Vec3;
use karst_client::Error;
use karst_core::encode::{film_exr, film_png, png};
use karst_core::film::{CrossError, Film, Picture, cross_error};
use karst_core::math::powf;
use karst_core::scene::Scene;
use karst_denoise::{Denoiser, Input, Mode};
use serde_json::Value;

use crate::args::DenoiseArg;
use crate::naming::denoised;

/// What is written of a frame.
pub(super) struct Pictures<'a> {
    scene: &'a Scene,
    film: &'a Film,
    denoised: Option<Vec<Vec3>>,
}

impl<'a> Pictures<'a> {
    /// Denoises the film if asked for.
    pub(super) fn new(
        film: &'a Film,
        scene: &'a Scene,
        denoise: DenoiseArg,
        threads: usize,
    ) -> Result<Self, Error> {
        let smooth = |mode| {
            let noisy = film.picture();
            denoised_colors(&noisy.color, &noisy, mode, threads)
        };
        let denoised = mode_of(denoise).map(smooth).transpose()?;
        Ok(Self { scene, film, denoised })
    }

    /// The denoised picture where there is one, with the layers of the noisy one.
    pub(super) fn best(&self) -> Picture {
        let mut picture = self.film.picture();
        if let Some(denoised) = &self.denoised {
            picture.color.clone_from(denoised);
        }
        picture
    }

    /// Writes `path`, an EXR with the statistics, and for a PNG the denoised picture beside it; returns what was written.
    pub(super) fn write(&self, path: &Path, statistics: &Value) -> Result<Vec<PathBuf>, Error> {
        if path.extension().is_some_and(|ending| ending == "exr") {
            return Ok(vec![self.write_exr(path, statistics)?]);
        }
        let (exposure, view) = (self.scene.exposure(), self.scene.view());
        let noisy = film_png(self.film, exposure, view).map_err(|error| encode_error(path, &error))?;
        let mut written = vec![write(path, &noisy)?];
        if let Some(color) = &self.denoised {
            let (path, window) = (denoised(path), self.film.window());
            let bytes = png(color, window.width(), window.height(), exposure, view)
                .map_err(|error| encode_error(&path, &error))?;
            written.push(write(&path, &bytes)?);
        }
        Ok(written)
    }

    /// Writes the EXR beside its place first: a picture that is there stays until the new one is whole.
    fn write_exr(&self, path: &Path, statistics: &Value) -> Result<PathBuf, Error> {
        let part = part_of(path);
        let file = File::create(&part).map_err(|source| Error::file(path, source))?;
        let mut file = BufWriter::new(file);
        let written = film_exr(self.film, self.denoised.as_deref(), statistics, &mut file)
            .map_err(|error| encode_error(path, &error))
            .and_then(|()| file.flush().map_err(|source| Error::file(&part, source)));
        if part == path {
            return written.map(|()| part);
        }
        let moved =
            written.and_then(|()| std::fs::rename(&part, path).map_err(|source| Error::file(path, source)));
        if let Err(error) = moved {
            // What went wrong is told; a part that cannot be removed either is harmless.
            let _ = std::fs::remove_file(&part);
            return Err(error);
        }
        Ok(path.to_owned())
    }
}

/// Where a file is written that takes its name once it is whole: `OUT.exr.part` beside it. What is there already and no
/// regular file is written to as it is.
fn part_of(path: &Path) -> PathBuf {
    if path.exists() && !path.is_file() {
        return path.to_owned();
    }
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

/// The error that the film has when it is denoised; `None` without a denoiser, and while a replicate has no samples.
pub(super) fn denoised_error(
    film: &Film,
    scene: &Scene,
    denoise: DenoiseArg,
    threads: usize,
) -> Result<Option<CrossError>, Error> {
    let Some(mode) = mode_of(denoise) else { return Ok(None) };
    let Some([a, b]) = film.replicates() else { return Ok(None) };
    let layers = film.picture();
    let [da, db] =
        [denoised_colors(&a, &layers, mode, threads)?, denoised_colors(&b, &layers, mode, threads)?];
    let width = layers.window.width() as usize;
    Ok(cross_error([&a, &b], [&da, &db], width, powf(2.0, scene.exposure())))
}

fn mode_of(denoise: DenoiseArg) -> Option<Mode> {
    match denoise {
        DenoiseArg::Off => None,
        DenoiseArg::Color => Some(Mode::Color),
        DenoiseArg::Full => Some(Mode::Full),
    }
}

/// Colours of a picture, denoised by its other layers.
fn denoised_colors(color: &[Vec3], layers: &Picture, mode: Mode, threads: usize) -> Result<Vec<Vec3>, Error> {
    let (width, height) = (layers.window.width(), layers.window.height());
    let input = Input { width, height, color, albedo: &layers.albedo, normal: &layers.normal };
    Denoiser::find()
        .and_then(|denoiser| denoiser.with_threads(threads as u32).denoise(&input, mode))
        .map_err(|error| Error::Failed(error.to_string()))
}

fn encode_error(path: &Path, error: &dyn std::fmt::Display) -> Error {
    Error::Failed(format!("{}: {error}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<PathBuf, Error> {
    std::fs::write(path, bytes).map_err(|source| Error::file(path, source))?;
    Ok(path.to_owned())
}
