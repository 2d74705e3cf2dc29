//! Owns the nouns of a job: its frames, what they cost, why they failed, what watchers are told.
//!
//! Plain data, stored as JSON: a field may be added with a default, never renamed.

use serde::{Deserialize, Serialize};

use crate::digest::Digest;
use crate::spec::JobSpec;

/// Microseconds since 1970, taken by the caller.
pub type Time = i64;

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum JobState {
    /// Waiting for a worker.
    Queued,
    /// At least one tile was begun.
    Running,
    /// All frames are finished.
    Succeeded,
    /// At least one frame failed, all others are finished.
    Failed,
    /// Stopped by a call.
    Cancelled,
}

impl JobState {
    /// Nothing changes any more.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// Where a frame stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameState {
    /// Not begun.
    Pending,
    /// At least one tile was begun.
    Rendering,
    /// All rounds are complete; its files are being made.
    Finishing,
    /// Its files can be downloaded.
    Finished,
    /// Stopped by an error.
    Failed,
    /// The job was cancelled before.
    Cancelled,
}

impl FrameState {
    /// Nothing changes any more.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Finished | Self::Failed | Self::Cancelled)
    }
}

/// What rendering cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Statistics {
    /// Camera samples.
    pub samples: u64,
    /// Rays along paths.
    pub rays: u64,
    /// Rays that ask only whether a light is visible.
    pub shadow_rays: u64,
    /// Samples dropped because they were not finite.
    pub nonfinite: u64,
    /// Rays that ran out of marching steps.
    pub exhausted: u64,
    /// Evaluations of distance functions.
    #[serde(default)]
    pub sdf_evaluations: u64,
}

impl std::ops::Add for Statistics {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            rays: self.rays + other.rays,
            shadow_rays: self.shadow_rays + other.shadow_rays,
            nonfinite: self.nonfinite + other.nonfinite,
            exhausted: self.exhausted + other.exhausted,
            sdf_evaluations: self.sdf_evaluations + other.sdf_evaluations,
        }
    }
}

/// Why something that ran did not succeed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Which kind of trouble.
    pub cause: Cause,
    /// For people.
    pub message: String,
}

impl Failure {
    /// A failure of kind `cause`.
    pub fn new(cause: Cause, message: impl Into<String>) -> Self {
        Self { cause, message: message.into() }
    }
}

/// Kinds of trouble after a call has returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Cause {
    /// The scene document or one of its files is wrong.
    Scene,
    /// Stored bytes are gone or no longer match their digest.
    Corrupt,
    /// The denoiser is missing or failed.
    Denoiser,
    /// A tile failed or killed its workers too often.
    Quarantine,
    /// Renders of one task differ.
    Disputed,
    /// A fault in karst itself.
    Internal,
}

/// Formats of a finished frame's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Format {
    /// `OpenEXR` with all layers.
    Exr,
    /// 8-bit picture of the noisy film.
    Png,
    /// 8-bit picture of the denoised film.
    PngDenoised,
}

/// A file of a finished frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameFile {
    /// What it holds.
    pub format: Format,
    /// Bytes.
    pub size: u64,
    /// Its name among the blobs.
    pub digest: Digest,
}

/// A frame of a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Frame number.
    pub frame: i32,
    /// Where it stands.
    pub state: FrameState,
    /// Rounds that are complete.
    pub rounds: u32,
    /// Mean samples per pixel of the finished rounds.
    pub spp: f64,
    /// Estimated relMSE after the last finished round.
    pub rel_mse: Option<f64>,
    /// Bounds of it with 95 % confidence.
    pub rel_mse_ci95: Option<[f64; 2]>,
    /// Seconds of rendering.
    pub seconds: f64,
    /// Why it failed; in a finished frame: why its denoised picture is missing.
    pub failure: Option<Failure>,
    /// Its files, once it is finished.
    pub files: Vec<FrameFile>,
    /// What it cost up to the last finished round.
    pub statistics: Statistics,
    /// Error of its denoised picture, once it is finished.
    #[serde(default)]
    pub denoised: Option<DenoisedError>,
}

/// The estimated relMSE of a denoised picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DenoisedError {
    /// The estimate.
    pub rel_mse: f64,
    /// Bounds of it with 95 % confidence.
    pub ci95: [f64; 2],
}

/// What finishing a frame made of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Finished {
    /// Its files.
    pub files: Vec<FrameFile>,
    /// Error of the denoised picture, where there is one and it is known.
    pub denoised: Option<DenoisedError>,
    /// Why the denoised picture is missing.
    pub failure: Option<Failure>,
}

impl Frame {
    /// A frame that nobody has begun.
    pub fn pending(frame: i32) -> Self {
        Self {
            frame,
            state: FrameState::Pending,
            rounds: 0,
            spp: 0.0,
            rel_mse: None,
            rel_mse_ci95: None,
            seconds: 0.0,
            failure: None,
            files: Vec::new(),
            statistics: Statistics::default(),
            denoised: None,
        }
    }
}

/// A job without its frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Given by the server.
    pub id: String,
    /// What was asked for.
    pub spec: JobSpec,
    /// Where it stands.
    pub state: JobState,
    /// Why it failed.
    pub failure: Option<Failure>,
    /// Revision of its newest record.
    pub revision: u64,
    /// Number of frames.
    pub frames_total: u32,
    /// Frames that are finished.
    pub frames_finished: u32,
    /// When it was stored.
    pub submitted_at: Time,
    /// When its first tile began.
    pub started_at: Option<Time>,
    /// When it reached a final state.
    pub finished_at: Option<Time>,
    /// Sums over its frames.
    pub statistics: Statistics,
}

impl Job {
    /// A job that was just submitted; its first record is its snapshot, revision 1.
    pub fn submitted(id: String, spec: JobSpec, frames_total: u32, at: Time) -> Self {
        Self {
            id,
            spec,
            state: JobState::Queued,
            failure: None,
            revision: 1,
            frames_total,
            frames_finished: 0,
            submitted_at: at,
            started_at: None,
            finished_at: None,
            statistics: Statistics::default(),
        }
    }
}

/// What a finished round brought, summed over all rounds of the frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoundReport {
    /// Rounds count from 0.
    pub round: u32,
    /// Mean samples per pixel.
    pub spp: f64,
    /// Estimated relMSE.
    pub rel_mse: Option<f64>,
    /// Bounds of it with 95 % confidence.
    pub rel_mse_ci95: Option<[f64; 2]>,
    /// Seconds of rendering since the frame began.
    pub seconds: f64,
    /// What the frame cost up to now.
    pub statistics: Statistics,
}

/// What a watcher is told; stored for good with its revision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Record {
    /// The job changed its state.
    Snapshot(Box<Job>),
    /// A frame changed its state.
    Frame(Box<Frame>),
    /// A round of a frame is finished.
    Round {
        /// Frame number.
        frame: i32,
        /// What it brought.
        report: RoundReport,
    },
}
