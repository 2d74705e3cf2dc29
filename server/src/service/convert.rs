//! Owns the translation between `karst.v1` and the server's own nouns. Fields of requests are checked in
//! `karst_proto::convert`; here they only change their types.

use std::collections::BTreeMap;

use karst_core::film::Region;
use karst_proto::convert::{job_from_wire, settings_to_wire};
use karst_proto::v1::{self, ErrorReason};
use prost_types::Timestamp;
use tonic::Code;

use crate::digest::Digest;
use crate::error::Error;
use crate::farm::feed::Progress;
use crate::model::{
    Cause, Failure, Format, Frame, FrameState, Job, JobState, Record, RoundReport, Statistics, Time,
};
use crate::spec::{DEFAULT_TILE_SIZE, Denoise, Frames, JobSpec, Settings};

/// A digest in field `field`.
///
/// # Errors
/// [`Error::Fields`] when it is not one.
pub(crate) fn digest(field: &str, text: &str) -> Result<Digest, Error> {
    text.parse().map_err(|e: crate::digest::DigestSyntax| Error::field(field, e.to_string()))
}

/// What a job asks for.
///
/// # Errors
/// [`Error::Fields`] with everything that is wrong.
pub(crate) fn spec(job: Option<&v1::JobSpec>) -> Result<JobSpec, Error> {
    let request = job_from_wire(job).map_err(Error::Fields)?;
    let files: Result<BTreeMap<String, Digest>, Error> = request
        .files
        .into_iter()
        .enumerate()
        .map(|(i, (path, text))| Ok((path, digest(&format!("job.scene.files[{i}].digest"), &text)?)))
        .collect();
    let o = request.overrides;
    Ok(JobSpec {
        display_name: request.display_name,
        scene: digest("job.scene.digest", &request.scene_digest)?,
        files: files?,
        frames: request.frames.map(|(first, last, step)| Frames { first, last, step }),
        settings: Settings {
            spp: o.spp,
            target_error: o.target_error,
            error_of: o.error_of.map(Into::into),
            min_spp: o.min_spp,
            max_spp: o.max_spp,
            time_limit: o.time_limit,
            seed: o.seed,
            size: o.size,
            crop: o.crop.map(|Region { x0, y0, x1, y1 }| [x0, y0, x1, y1]),
        },
        tile_size: request.tile_size.unwrap_or(DEFAULT_TILE_SIZE),
        denoise: match request.denoise {
            v1::Denoise::Unspecified | v1::Denoise::Off => Denoise::Off,
            v1::Denoise::Color => Denoise::Color,
            v1::Denoise::Full => Denoise::Full,
        },
    })
}

/// A job for the wire.
pub(crate) fn job(job: &Job) -> v1::Job {
    v1::Job {
        id: job.id.clone(),
        spec: Some(spec_to_wire(&job.spec)),
        state: job_state(job.state).into(),
        error: job.failure.as_ref().map(failure),
        frames_total: job.frames_total,
        frames_finished: job.frames_finished,
        submitted_at: Some(timestamp(job.submitted_at)),
        started_at: job.started_at.map(timestamp),
        finished_at: job.finished_at.map(timestamp),
        statistics: Some(statistics(&job.statistics)),
    }
}

/// A job's scene with its files, for workers.
pub(crate) fn spec_with_files(spec: &JobSpec) -> v1::JobSpec {
    let file =
        |(path, digest): (&String, &Digest)| v1::SceneFile { path: path.clone(), digest: digest.to_string() };
    let files = spec.files.iter().map(file).collect();
    let scene = Some(v1::Scene { digest: spec.scene.to_string(), files });
    v1::JobSpec { scene, ..spec_to_wire(spec) }
}

fn spec_to_wire(spec: &JobSpec) -> v1::JobSpec {
    let frames = spec.frames.map(|f| v1::FrameRange { first: f.first, last: f.last, step: f.step });
    let denoise = match spec.denoise {
        Denoise::Off => v1::Denoise::Off,
        Denoise::Color => v1::Denoise::Color,
        Denoise::Full => v1::Denoise::Full,
    };
    v1::JobSpec {
        display_name: spec.display_name.clone(),
        scene: Some(v1::Scene { digest: spec.scene.to_string(), files: Vec::new() }),
        frames,
        settings: Some(settings_to_wire(&spec.settings.overrides())),
        tile_size: spec.tile_size,
        denoise: denoise.into(),
    }
}

fn job_state(state: JobState) -> v1::JobState {
    match state {
        JobState::Queued => v1::JobState::Queued,
        JobState::Running => v1::JobState::Running,
        JobState::Succeeded => v1::JobState::Succeeded,
        JobState::Failed => v1::JobState::Failed,
        JobState::Cancelled => v1::JobState::Cancelled,
    }
}

/// A state that jobs are filtered by; `None` for UNSPECIFIED, which no stored job has.
pub(crate) fn job_state_from_wire(state: v1::JobState) -> Option<JobState> {
    match state {
        v1::JobState::Unspecified => None,
        v1::JobState::Queued => Some(JobState::Queued),
        v1::JobState::Running => Some(JobState::Running),
        v1::JobState::Succeeded => Some(JobState::Succeeded),
        v1::JobState::Failed => Some(JobState::Failed),
        v1::JobState::Cancelled => Some(JobState::Cancelled),
    }
}

/// A frame for the wire.
pub(crate) fn frame(frame: &Frame) -> v1::Frame {
    let state = match frame.state {
        FrameState::Pending => v1::FrameState::Pending,
        FrameState::Rendering => v1::FrameState::Rendering,
        FrameState::Finishing => v1::FrameState::Finishing,
        FrameState::Finished => v1::FrameState::Finished,
        FrameState::Failed => v1::FrameState::Failed,
        FrameState::Cancelled => v1::FrameState::Cancelled,
    };
    let file = |f: &crate::model::FrameFile| v1::FrameFile {
        format: format_to_wire(f.format).into(),
        size: f.size,
        digest: f.digest.to_string(),
    };
    v1::Frame {
        frame: frame.frame,
        state: state.into(),
        rounds_finished: frame.rounds,
        spp: frame.spp,
        rel_mse: frame.rel_mse,
        rel_mse_ci95: frame.rel_mse_ci95.map(Vec::from).unwrap_or_default(),
        render_seconds: frame.seconds,
        error: frame.failure.as_ref().map(failure),
        files: frame.files.iter().map(file).collect(),
        statistics: Some(statistics(&frame.statistics)),
        denoised_rel_mse: frame.denoised.map(|error| error.rel_mse),
        denoised_rel_mse_ci95: frame.denoised.map(|error| error.ci95.to_vec()).unwrap_or_default(),
    }
}

fn format_to_wire(format: Format) -> v1::FrameFormat {
    match format {
        Format::Exr => v1::FrameFormat::Exr,
        Format::Png => v1::FrameFormat::Png,
        Format::PngDenoised => v1::FrameFormat::PngDenoised,
    }
}

/// The file that a download asks for.
///
/// # Errors
/// [`Error::Fields`] for UNSPECIFIED.
pub(crate) fn format(format: v1::FrameFormat) -> Result<Format, Error> {
    match format {
        v1::FrameFormat::Exr => Ok(Format::Exr),
        v1::FrameFormat::Png => Ok(Format::Png),
        v1::FrameFormat::PngDenoised => Ok(Format::PngDenoised),
        v1::FrameFormat::Unspecified => Err(Error::field("format", "expected EXR, PNG or PNG_DENOISED")),
    }
}

fn failure(failure: &Failure) -> v1::Error {
    let (code, reason) = match failure.cause {
        Cause::Scene => (Code::InvalidArgument, ErrorReason::SceneInvalid),
        Cause::Corrupt => (Code::DataLoss, ErrorReason::BlobCorrupt),
        Cause::Denoiser => (Code::FailedPrecondition, ErrorReason::DenoiserUnavailable),
        Cause::Quarantine => (Code::Internal, ErrorReason::TileQuarantined),
        Cause::Disputed => (Code::Internal, ErrorReason::DeterminismViolation),
        Cause::Internal => (Code::Internal, ErrorReason::InternalFault),
    };
    let end = failure.message.floor_char_boundary(2048);
    v1::Error { code: code.into(), message: failure.message[..end].to_owned(), reason: reason.into() }
}

fn statistics(s: &Statistics) -> v1::Statistics {
    v1::Statistics {
        samples: s.samples,
        rays: s.rays,
        shadow_rays: s.shadow_rays,
        nonfinite_samples: s.nonfinite,
        exhausted_rays: s.exhausted,
        sdf_evaluations: s.sdf_evaluations,
    }
}

fn timestamp(time: Time) -> Timestamp {
    let nanos = time.rem_euclid(1_000_000) * 1000;
    Timestamp { seconds: time.div_euclid(1_000_000), nanos: nanos as i32 }
}

/// What a watcher is told.
pub(crate) fn record(record: &Record) -> v1::job_event::Event {
    match record {
        Record::Snapshot(snapshot) => v1::job_event::Event::Snapshot(job(snapshot)),
        Record::Frame(changed) => v1::job_event::Event::Frame(frame(changed)),
        Record::Round { frame, report } => v1::job_event::Event::Round(round(*frame, report)),
    }
}

fn round(frame: i32, report: &RoundReport) -> v1::RoundFinished {
    v1::RoundFinished {
        frame,
        round: report.round,
        spp: report.spp,
        rel_mse: report.rel_mse,
        seconds: report.seconds,
    }
}

/// How a job is going.
pub(crate) fn progress(progress: &Progress) -> v1::Progress {
    v1::Progress {
        frame: progress.frame,
        samples_done: progress.samples_done,
        samples_planned: progress.samples_planned,
        samples_per_second: progress.samples_per_second,
        rel_mse: progress.rel_mse,
        seconds_left: progress.seconds_left,
        frames_finished: progress.frames_finished,
        frames_total: progress.frames_total,
    }
}
