//! Owns the names of the parts of a wave's work, and who is told of them.

/// A part of the work on a wave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Rays of the camera, and the random numbers for them.
    Camera,
    /// Nearest hits.
    Intersect,
    /// Where media scatter, and what glows in them.
    Media,
    /// Surfaces at the hits, and the light that paths run into.
    Emit,
    /// Materials, lights and directions.
    Shade,
    /// Shadow rays.
    Shadow,
    /// Sums of the samples.
    Accumulate,
}

impl Stage {
    /// All, in the order of a wave.
    pub const ALL: [Self; 7] =
        [Self::Camera, Self::Intersect, Self::Media, Self::Emit, Self::Shade, Self::Shadow, Self::Accumulate];

    /// Its name in profiles.
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Intersect => "intersect",
            Self::Media => "media",
            Self::Emit => "emit",
            Self::Shade => "shade",
            Self::Shadow => "shadow",
            Self::Accumulate => "accumulate",
        }
    }
}

/// Somebody who is told which part of the work begins, a few times for thousands of paths. Pixels do not depend on it.
pub trait StageObserver {
    /// A part begins, and the one before it ends.
    fn begin(&mut self, stage: Stage);
}

/// Nobody.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl StageObserver for Unobserved {
    fn begin(&mut self, _stage: Stage) {}
}
