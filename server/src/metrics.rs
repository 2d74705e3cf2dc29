//! Owns the page of metrics: what was counted since the start, and how things stand at this moment.
//!
//! `docs/metrics.md` is made from the families here by a test.

use prometheus::proto::MetricFamily;
use prometheus::{Error as MetricsError, IntCounter, IntGauge, IntGaugeVec, Opts, Registry, TextEncoder};

use crate::error::Error;
use crate::farm::Shared;
use crate::farm::fleet::WorkerStanding;
use crate::model::{FrameState, JobState};
use crate::state::Census;

/// What [`metrics`] writes, for the header `content-type`.
pub(crate) const CONTENT_TYPE: &str = prometheus::TEXT_FORMAT;

/// Everything that can be counted, in Prometheus' text format 0.0.4.
///
/// # Errors
/// A failing database.
pub(crate) async fn metrics(shared: &Shared) -> Result<String, Error> {
    let encoded = TextEncoder::new().encode_to_string(&families(shared).await?);
    encoded.map_err(|e| Error::Internal(format!("metrics: {e}")))
}

async fn families(shared: &Shared) -> Result<Vec<MetricFamily>, Error> {
    let (jobs, frames) = shared.state.census().await?;
    let now = now(shared, &jobs, &frames).map_err(|e| Error::Internal(format!("metrics: {e}")))?;
    let mut families = shared.telemetry.counts.registry.gather();
    families.extend(now.gather());
    families.sort_by(|a, b| a.name().cmp(b.name()));
    Ok(families)
}

const JOB_STATES: [JobState; 5] =
    [JobState::Queued, JobState::Running, JobState::Succeeded, JobState::Failed, JobState::Cancelled];

const FRAME_STATES: [FrameState; 6] = [
    FrameState::Pending,
    FrameState::Rendering,
    FrameState::Finishing,
    FrameState::Finished,
    FrameState::Failed,
    FrameState::Cancelled,
];

/// How things stand; `jobs` and `frames` are numbers by the names of states.
fn now(shared: &Shared, jobs: &Census, frames: &Census) -> Result<Registry, MetricsError> {
    let (fleet, roster) = (&shared.fleet, shared.fleet.roster());
    let named = |census: &Census, name: String| {
        let number = census.get(&name).copied().unwrap_or_default();
        (name.to_lowercase(), number)
    };
    let workers = WorkerStanding::ALL.map(|standing| {
        let number = roster.iter().filter(|member| member.standing == standing).count();
        (standing.name().to_owned(), number as u64)
    });
    let alive = roster.iter().filter(|member| member.standing == WorkerStanding::Alive);
    let there: u64 = alive.map(|member| u64::from(member.threads)).sum();
    let leased: usize = roster.iter().map(|member| member.tasks).sum();
    let pair = |name: &str, number: u64| (name.to_owned(), number);
    let tasks = [pair("open", fleet.open_tasks() as u64), pair("leased", leased as u64)];
    let threads = [pair("server", fleet.local_threads() as u64), pair("workers", there)];
    let registry = Registry::new();
    let gauges = |name: &str, help: &str, label: &str, values: &[(String, u64)]| {
        let gauges = IntGaugeVec::new(Opts::new(name, help), &[label])?;
        for (value, number) in values {
            gauges.with_label_values(&[value.as_str()]).set(*number as i64);
        }
        registry.register(Box::new(gauges))
    };
    let jobs = JOB_STATES.map(|state| named(jobs, format!("{state:?}")));
    let frames = FRAME_STATES.map(|state| named(frames, format!("{state:?}")));
    gauges("karst_jobs", "Jobs, by where they stand.", "state", &jobs)?;
    gauges("karst_frames", "Frames, by where they stand.", "state", &frames)?;
    gauges("karst_tasks", "Tasks that nobody has taken, and that worker processes hold.", "state", &tasks)?;
    gauges("karst_workers", "Worker processes, by where they stand.", "state", &workers)?;
    gauges("karst_worker_threads", "Threads that can render, by where they run.", "place", &threads)?;
    let viewers = IntGauge::new("karst_viewers", "Viewers that watch pixels of a job.")?;
    viewers.set(shared.hub.viewers() as i64);
    registry.register(Box::new(viewers))?;
    let written = IntCounter::new("karst_blob_written_bytes_total", "Bytes that were stored as blobs.")?;
    written.inc_by(shared.blobs.written());
    registry.register(Box::new(written))?;
    let about = Opts::new("karst_build_info", "Always 1; the labels say which build this is.");
    let build = IntGaugeVec::new(about, &["version", "core"])?;
    build.with_label_values(&[env!("CARGO_PKG_VERSION"), karst_core::BUILD]).set(1);
    registry.register(Box::new(build))?;
    Ok(registry)
}

#[cfg(test)]
#[path = "metrics_tests.rs"]
mod tests;
