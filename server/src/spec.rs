//! Owns what a job asks for, after its fields were checked: plain data that is stored as JSON.

use std::collections::BTreeMap;

use karst_core::film::Region;
use karst_core::scene::{self, Overrides};
use serde::{Deserialize, Serialize};

use crate::digest::Digest;

/// Edge of a tile in pixels when a job leaves the choice to the server: 64 × 64 pixels are some ten milliseconds
/// of work in the first round, and a result that travels in one message.
pub const DEFAULT_TILE_SIZE: u32 = 64;

/// What to render and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobSpec {
    /// For people.
    pub display_name: String,
    /// Digest of the scene document.
    pub scene: Digest,
    /// Digests of the files that the document names, by their paths; stored beside the job, not in it.
    #[serde(skip)]
    pub files: BTreeMap<String, Digest>,
    /// Frames to render; `None` until the document was read: all of its frames.
    pub frames: Option<Frames>,
    /// Changes to what the document says.
    pub settings: Settings,
    /// Edge of a tile in pixels, a multiple of 16.
    pub tile_size: u32,
    /// Whether and how finished frames are denoised.
    pub denoise: Denoise,
}

/// Frame numbers `first`, `first + step`, … up to and including `last`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frames {
    /// First frame number.
    pub first: i32,
    /// Last frame number, at least `first`.
    pub last: i32,
    /// Distance between frames, from 1.
    pub step: u32,
}

impl Frames {
    /// How many frames these are.
    pub fn count(&self) -> u64 {
        (i64::from(self.last) - i64::from(self.first)).max(0) as u64 / u64::from(self.step.max(1)) + 1
    }

    /// The frame numbers in order.
    pub fn iter(&self) -> impl Iterator<Item = i32> {
        (self.first..=self.last).step_by(self.step.max(1) as usize)
    }
}

/// What Open Image Denoise gets to see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Denoise {
    /// Nothing: no denoising.
    Off,
    /// The colours alone.
    Color,
    /// Colours with albedo and normals.
    Full,
}

/// Which picture a target error is meant for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ErrorOf {
    /// The picture as it is rendered.
    Noisy,
    /// The denoised picture.
    Denoised,
}

impl From<ErrorOf> for scene::ErrorOf {
    fn from(of: ErrorOf) -> Self {
        match of {
            ErrorOf::Noisy => Self::Noisy,
            ErrorOf::Denoised => Self::Denoised,
        }
    }
}

impl From<scene::ErrorOf> for ErrorOf {
    fn from(of: scene::ErrorOf) -> Self {
        match of {
            scene::ErrorOf::Noisy => Self::Noisy,
            scene::ErrorOf::Denoised => Self::Denoised,
        }
    }
}

/// Changes to the document's film and sampling; unset fields keep what it says.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Square root of relMSE to reach.
    pub target_error: Option<f64>,
    /// Which picture has to reach it.
    pub error_of: Option<ErrorOf>,
    /// No pixel gets fewer samples.
    pub min_spp: Option<u32>,
    /// No pixel gets more samples.
    pub max_spp: Option<u32>,
    /// Begin no further round after this many seconds of rendering.
    pub time_limit: Option<f64>,
    /// Seed of all random numbers.
    pub seed: Option<u32>,
    /// Width and height of the full frame in pixels.
    pub size: Option<(u32, u32)>,
    /// Render only this part: x0, y0, x1, y1, half open.
    pub crop: Option<[u32; 4]>,
}

impl Settings {
    /// The same for the core.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            spp: self.spp,
            target_error: self.target_error,
            error_of: self.error_of.map(Into::into),
            min_spp: self.min_spp,
            max_spp: self.max_spp,
            time_limit: self.time_limit,
            seed: self.seed,
            size: self.size,
            crop: self.crop.map(|[x0, y0, x1, y1]| Region { x0, y0, x1, y1 }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Frames;

    #[test]
    fn frames_are_counted_without_overflow() {
        let frames = |first, last, step| Frames { first, last, step };
        assert_eq!(frames(1, 250, 1).count(), 250);
        assert_eq!(frames(1, 250, 2).iter().last(), Some(249));
        assert_eq!(frames(-3, 3, 3).iter().collect::<Vec<_>>(), [-3, 0, 3]);
        assert_eq!(frames(i32::MIN, i32::MAX, 1).count(), 1 << 32);
    }
}
