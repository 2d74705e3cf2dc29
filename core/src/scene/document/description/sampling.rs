//! Owns how many samples a pixel gets and how far its light paths go.

use crate::scene::document::macros::object;

/// How many samples the pixels get.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampling {
    /// When a frame is finished.
    pub goal: Goal,
    /// Number that chooses the random numbers: the same seed gives the same picture.
    pub seed: u32,
    /// Time after which no further round of samples begins, in seconds.
    pub time_limit: Option<f64>,
}

/// When a frame is finished.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Every pixel gets the same number of samples.
    Fixed {
        /// Samples per pixel, at least 1.
        spp: u32,
    },
    /// Samples go where the error is until the frame's estimated error is below the target.
    Error {
        /// Square root of the relative mean squared error over the frame, above 0.
        target: f64,
        /// Samples per pixel before the first decision.
        min_spp: u32,
        /// Samples per pixel at which to give up; at least `min_spp`.
        max_spp: u32,
    },
}

object! {
    "integrator";
    /// Limits of the light paths.
    pub struct Integrator {
        /// Most surfaces a path meets; 1 shows light that comes straight from emitters.
        max_depth: u32 = or(16).from(1.0).to(1024.0);
        /// Surface from which on paths end at random by Russian roulette.
        roulette_depth: u32 = or(5).from(1.0).to(1024.0);
    }
}
