//! Owns how many samples a pixel gets and how far its light paths go.

use serde_json::Value as Json;

use crate::scene::document::cursor::Cursor;
use crate::scene::document::decode::Decode;
use crate::scene::document::macros::{object, words};
use crate::scene::document::rule::{Allowed, optional, or};
use crate::scene::document::schema::Definitions;

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
        /// Which picture has to reach it.
        of: ErrorOf,
    },
}

/// Which picture a target error is meant for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ErrorOf {
    /// The picture as it is rendered.
    #[default]
    Noisy,
    /// The denoised picture, judged by the upper end of the interval that its denoised replicates tell after each round.
    Denoised,
}

words! {
    "error_of";
    ErrorOf {
        /// The picture as it is rendered.
        "noisy" => Noisy,
        /// The denoised picture; only where frames are denoised.
        "denoised" => Denoised,
    }
}

object! {
    "sampling";
    /// How many samples the pixels get: a fixed number, or as many as it takes to reach a target error.
    /// Cannot be animated.
    struct SamplingFields checked by is_one_goal {
        /// Samples per pixel; not together with `target_error`. 64 where neither is given.
        spp: Option<u32> = optional().from(1.0).to(MAX_SPP);
        /// Square root of the relative mean squared error at which a frame is finished.
        target_error: Option<f64> = optional().above(0.0).to(1.0e6);
        /// Which picture has to reach it: `noisy` unless said.
        error_of: Option<ErrorOf> = optional();
        /// Samples per pixel before the first decision; only with `target_error`, where it is 32 by default.
        min_spp: Option<u32> = optional().from(1.0).to(MAX_SPP);
        /// Samples per pixel at which to give up; only with `target_error`, where it is 1024 by default.
        max_spp: Option<u32> = optional().from(1.0).to(MAX_SPP);
        /// Chooses the random numbers: the same seed gives the same picture.
        seed: u32 = or(0);
        /// Time after which no further round of samples begins, in seconds.
        time_limit: Option<f64> = optional().above(0.0).to(1.0e9);
    }
}

/// Most samples per pixel.
const MAX_SPP: f64 = 16_777_216.0;
const DEFAULT_SPP: u32 = 64;
const DEFAULT_MIN_SPP: u32 = 32;
const DEFAULT_MAX_SPP: u32 = 1024;

impl Sampling {
    /// What a document without `sampling` gets.
    pub(in crate::scene::document) const DEFAULT: Self =
        Self { goal: Goal::Fixed { spp: DEFAULT_SPP }, seed: 0, time_limit: None };
}

fn is_one_goal(fields: &SamplingFields, at: &Cursor<'_>) -> bool {
    if fields.target_error.is_none() {
        let stray = [
            ("min_spp", fields.min_spp.is_some()),
            ("max_spp", fields.max_spp.is_some()),
            ("error_of", fields.error_of.is_some()),
        ];
        let mut stray = stray.iter().filter(|(_, is_given)| *is_given).peekable();
        let ok = stray.peek().is_none();
        for (name, _) in stray {
            let hint = "give \"target_error\" too, or \"spp\" instead".to_owned();
            at.member_problem(name, "has a meaning only with \"target_error\"", Some(hint));
        }
        return ok;
    }
    if fields.spp.is_some() {
        let hint = "with \"target_error\" use \"min_spp\" and \"max_spp\"".to_owned();
        at.member_problem("spp", "found together with \"target_error\", expected one of them", Some(hint));
        return false;
    }
    let (min, max) = fields.error_range();
    if max < min {
        at.problem(format!("found max_spp {max} below min_spp {min}"), None);
    }
    max >= min
}

impl SamplingFields {
    fn error_range(&self) -> (u32, u32) {
        (self.min_spp.unwrap_or(DEFAULT_MIN_SPP), self.max_spp.unwrap_or(DEFAULT_MAX_SPP))
    }

    fn goal(&self) -> Goal {
        let (min_spp, max_spp) = self.error_range();
        match self.target_error {
            Some(target) => Goal::Error { target, min_spp, max_spp, of: self.error_of.unwrap_or_default() },
            None => Goal::Fixed { spp: self.spp.unwrap_or(DEFAULT_SPP) },
        }
    }
}

impl Decode for Sampling {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let fields = SamplingFields::decode(at, allowed)?;
        Some(Self { goal: fields.goal(), seed: fields.seed, time_limit: fields.time_limit })
    }

    fn expected(allowed: &Allowed) -> String {
        SamplingFields::expected(allowed)
    }

    fn schema(allowed: &Allowed, definitions: &mut Definitions) -> Json {
        SamplingFields::schema(allowed, definitions)
    }

    fn show(&self) -> Json {
        let mut fields = serde_json::Map::new();
        match self.goal {
            Goal::Fixed { spp } => {
                fields.insert("spp".to_owned(), spp.show());
            }
            Goal::Error { target, min_spp, max_spp, of } => {
                fields.insert("target_error".to_owned(), target.show());
                fields.insert("min_spp".to_owned(), min_spp.show());
                fields.insert("max_spp".to_owned(), max_spp.show());
                if of != ErrorOf::default() {
                    fields.insert("error_of".to_owned(), of.show());
                }
            }
        }
        fields.insert("seed".to_owned(), self.seed.show());
        if let Some(limit) = self.time_limit {
            fields.insert("time_limit".to_owned(), limit.show());
        }
        Json::Object(fields)
    }
}

object! {
    "integrator";
    /// Limits of the light paths.
    pub struct Integrator {
        /// Most surfaces a path meets; 1 shows light that comes straight from emitters.
        max_depth: u32 = or(Self::DEFAULT.max_depth).from(1.0).to(1024.0);
        /// Surface from which on dim paths may end at random by Russian roulette; in scenes with media not before the fifth.
        /// It changes noise and time, never what a picture converges to.
        roulette_depth: u32 = or(Self::DEFAULT.roulette_depth).from(1.0).to(1024.0);
    }
}

impl Integrator {
    /// What a document without `integrator` gets.
    pub(in crate::scene::document) const DEFAULT: Self = Self { max_depth: 16, roulette_depth: 2 };
}
