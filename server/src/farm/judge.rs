//! Owns denoising, and judging how good a denoised picture is. Blocks.

use glam::Vec3;
use karst_core::film::{CrossError, Film, Picture, cross_error};
use karst_core::math::powf;
use karst_core::scene::Scene;
use karst_denoise::{DenoiseError, Denoiser, Input, Mode};

use crate::spec::Denoise;

/// What a denoiser's error is told from, copied: nobody waits for the film meanwhile.
pub(super) struct Halves {
    replicates: [Vec<Vec3>; 2],
    layers: Picture,
    scale: f32,
}

impl Halves {
    /// Those of a film; `None` while a replicate has no samples.
    pub(super) fn of(film: &Film, scene: &Scene) -> Option<Self> {
        let replicates = film.replicates()?;
        Some(Self { replicates, layers: film.picture(), scale: powf(2.0, scene.exposure()) })
    }

    /// The error that the film has when it is denoised; `None` without denoising.
    pub(super) fn error(&self, denoise: Denoise) -> Result<Option<CrossError>, DenoiseError> {
        let Some(mode) = mode_of(denoise) else { return Ok(None) };
        let [a, b] = &self.replicates;
        let [da, db] = [denoised(a, &self.layers, mode)?, denoised(b, &self.layers, mode)?];
        let width = self.layers.window.width() as usize;
        Ok(cross_error([a, b], [&da, &db], width, self.scale))
    }

    /// What they say of the film. With few samples the error is a rough guess: the upper end of its interval counts.
    pub(super) fn verdict(&self, denoise: Denoise) -> Verdict {
        match self.error(denoise) {
            Ok(error) => Verdict::AtMost(error.map(|error| error.ci95[1])),
            Err(error) => {
                tracing::warn!("the noisy picture is judged instead of the denoised one: {error}");
                Verdict::Failed
            }
        }
    }
}

/// What denoising makes of a picture; `None` without denoising.
pub(super) fn denoised_picture(
    picture: &Picture,
    denoise: Denoise,
) -> Result<Option<Vec<Vec3>>, DenoiseError> {
    mode_of(denoise).map(|mode| denoised(&picture.color, picture, mode)).transpose()
}

fn mode_of(denoise: Denoise) -> Option<Mode> {
    match denoise {
        Denoise::Off => None,
        Denoise::Color => Some(Mode::Color),
        Denoise::Full => Some(Mode::Full),
    }
}

/// Colours, denoised by the layers of a picture.
fn denoised(color: &[Vec3], layers: &Picture, mode: Mode) -> Result<Vec<Vec3>, DenoiseError> {
    let plane = |layer: &[Vec3]| layer.iter().map(Vec3::to_array).collect::<Vec<_>>();
    let (color, albedo, normal) = (plane(color), plane(&layers.albedo), plane(&layers.normal));
    let input = Input {
        width: layers.window.width(),
        height: layers.window.height(),
        color: &color,
        albedo: &albedo,
        normal: &normal,
    };
    let smooth = Denoiser::find()?.denoise(&input, mode)?;
    Ok(smooth.into_iter().map(Vec3::from_array).collect())
}

/// What denoised halves say of a film.
pub(super) enum Verdict {
    /// The relMSE that the denoised film has at most; `None` where that is unknown.
    AtMost(Option<f64>),
    /// The denoiser failed.
    Failed,
}

impl Verdict {
    /// The relMSE to judge the film by.
    ///
    /// Without a denoiser it is that of the noisy picture: whoever is content with a denoised picture is content with a noisy
    /// one of that error.
    pub(super) fn of(&self, film: &Film) -> Option<f64> {
        match self {
            Self::AtMost(error) => *error,
            Self::Failed => film.summary().rel_mse,
        }
    }
}
