//! Pictures of a rendered film: denoised if asked for, written as EXR or PNG.

use std::path::{Path, PathBuf};

use karst_client::Error;
use karst_core::encode::{exr, object_statistics, png, statistics};
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
    noisy: Picture,
    denoised: Option<Picture>,
    statistics: Value,
}

impl<'a> Pictures<'a> {
    /// Resolves the film, and denoises it if asked for.
    pub(super) fn new(
        film: &Film,
        scene: &'a Scene,
        frame: i32,
        denoise: DenoiseArg,
        threads: usize,
    ) -> Result<Self, Error> {
        let noisy = film.picture();
        let smooth = |mode| denoised_colors(&noisy.color, &noisy, mode, threads);
        let denoised =
            mode_of(denoise).map(smooth).transpose()?.map(|color| Picture { color, ..noisy.clone() });
        let objects = object_statistics(scene.function_names(), film.objects());
        let statistics = statistics(frame, scene.sampling().seed, &film.summary(), &objects);
        Ok(Self { scene, noisy, denoised, statistics })
    }

    /// The denoised picture where there is one.
    pub(super) fn best(&self) -> &Picture {
        self.denoised.as_ref().unwrap_or(&self.noisy)
    }

    /// Writes `path`, and for a PNG the denoised picture beside it; returns what was written.
    pub(super) fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        if path.extension().is_some_and(|ending| ending == "exr") {
            let denoised = self.denoised.as_ref().map(|picture| picture.color.as_slice());
            let bytes =
                exr(&self.noisy, denoised, &self.statistics).map_err(|error| encode_error(path, &error))?;
            return Ok(vec![write(path, &bytes)?]);
        }
        let mut written = vec![self.write_png(path, &self.noisy)?];
        if let Some(picture) = &self.denoised {
            written.push(self.write_png(&denoised(path), picture)?);
        }
        Ok(written)
    }

    fn write_png(&self, path: &Path, picture: &Picture) -> Result<PathBuf, Error> {
        let (width, height) = (picture.window.width(), picture.window.height());
        let bytes = png(&picture.color, width, height, self.scene.exposure(), self.scene.view())
            .map_err(|error| encode_error(path, &error))?;
        write(path, &bytes)
    }
}

/// The error that the film has when it is denoised; `None` without a denoiser, and while a replicate has no samples.
pub(super) fn denoised_error(
    film: &Film,
    scene: &Scene,
    denoise: DenoiseArg,
    threads: usize,
) -> Result<Option<CrossError>, Error> {
    let (Some(mode), Some([a, b])) = (mode_of(denoise), film.replicates()) else { return Ok(None) };
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
fn denoised_colors<T: Copy + Into<[f32; 3]> + From<[f32; 3]>>(
    color: &[T],
    layers: &Picture,
    mode: Mode,
    threads: usize,
) -> Result<Vec<T>, Error> {
    let (color, albedo, normal) = (plane(color), plane(&layers.albedo), plane(&layers.normal));
    let input = Input {
        width: layers.window.width(),
        height: layers.window.height(),
        color: &color,
        albedo: &albedo,
        normal: &normal,
    };
    let smooth = Denoiser::find()
        .and_then(|denoiser| denoiser.with_threads(threads as u32).denoise(&input, mode))
        .map_err(|error| Error::Failed(error.to_string()))?;
    Ok(smooth.into_iter().map(T::from).collect())
}

fn plane<T: Copy + Into<[f32; 3]>>(values: &[T]) -> Vec<[f32; 3]> {
    values.iter().map(|value| (*value).into()).collect()
}

fn encode_error(path: &Path, error: &dyn std::fmt::Display) -> Error {
    Error::Failed(format!("{}: {error}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<PathBuf, Error> {
    std::fs::write(path, bytes).map_err(|source| Error::file(path, source))?;
    Ok(path.to_owned())
}
