//! Owns denoising, and how wrong a denoised picture is. Blocks.

use glam::Vec3;
use karst_core::film::{CrossError, Film, Picture, cross_error};
use karst_core::math::powf;
use karst_core::scene::Scene;
use karst_denoise::{DenoiseError, Denoiser, Input, Mode};

use crate::spec::Denoise;

/// What each replicate of a film by itself makes of it, copied: nobody waits for the film while it is denoised.
pub(super) struct Replicates {
    planes: [Vec<Vec3>; 2],
    scale: f32,
}

impl Replicates {
    /// Those of a film; `None` while one of them has no samples.
    pub(super) fn of(film: &Film, scene: &Scene) -> Option<Self> {
        Some(Self { planes: film.replicates()?, scale: powf(2.0, scene.exposure()) })
    }

    /// The error that the film has when it is denoised by its layers; `None` without denoising, and where it is unknown.
    pub(super) fn error(
        &self,
        layers: &Picture,
        denoise: Denoise,
    ) -> Result<Option<CrossError>, DenoiseError> {
        let Some(mode) = mode_of(denoise) else { return Ok(None) };
        let [a, b] = &self.planes;
        let [da, db] = [denoised(a, layers, mode)?, denoised(b, layers, mode)?];
        Ok(cross_error([a, b], [&da, &db], layers.window.width() as usize, self.scale))
    }

    /// What they say of the film. With few samples the error is a rough guess: the upper end of its interval counts.
    pub(super) fn judgement(&self, layers: &Picture, denoise: Denoise) -> Judgement {
        match self.error(layers, denoise) {
            Ok(error) => Judgement::AtMost(error.map(|error| error.ci95[1])),
            Err(error) => {
                tracing::warn!("the noisy picture is judged instead of the denoised one: {error}");
                Judgement::NotDenoised
            }
        }
    }
}

/// What denoised replicates say of a film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Judgement {
    /// The relMSE that the denoised film has at most; `None` where that is unknown.
    AtMost(Option<f64>),
    /// The denoiser failed.
    NotDenoised,
}

impl Judgement {
    /// The relMSE to judge the film by.
    ///
    /// Without a denoiser it is that of the noisy picture: whoever is content with a denoised picture is content with a noisy
    /// one of that error.
    pub(super) fn of(self, film: &Film) -> Option<f64> {
        match self {
            Self::AtMost(error) => error,
            Self::NotDenoised => film.summary().rel_mse,
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
    let (width, height) = (layers.window.width(), layers.window.height());
    let input = Input { width, height, color, albedo: &layers.albedo, normal: &layers.normal };
    Denoiser::find()?.denoise(&input, mode)
}

#[cfg(test)]
mod tests {
    use super::{Judgement, Replicates};
    use crate::spec::Denoise;
    use karst_core::film::{Film, FrameSize};

    #[test]
    fn without_a_denoiser_the_noisy_picture_is_judged() {
        let size = FrameSize { width: 16, height: 16 };
        let film = Film::new(size, size.region(), 0.0);
        assert_eq!(Judgement::AtMost(Some(0.5)).of(&film), Some(0.5));
        assert_eq!(Judgement::AtMost(None).of(&film), None);
        assert_eq!(Judgement::NotDenoised.of(&film), film.summary().rel_mse);
        let replicates = Replicates { planes: [Vec::new(), Vec::new()], scale: 1.0 };
        assert_eq!(replicates.judgement(&film.picture(), Denoise::Off), Judgement::AtMost(None));
    }
}
