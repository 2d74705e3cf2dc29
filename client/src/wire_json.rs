//! Wire messages as the JSON lines of `--json`. Field names are those of the protos.

use karst_proto::v1::job_event::Event;
use karst_proto::v1::{Frame, FrameState, Job, JobEvent, JobState, Progress, RoundFinished, Statistics};
use serde_json::{Value, json};

/// `running` for `JOB_STATE_RUNNING`.
pub(crate) fn job_state_name(state: JobState) -> String {
    state.as_str_name().trim_start_matches("JOB_STATE_").to_lowercase()
}

fn frame_state_name(state: FrameState) -> String {
    state.as_str_name().trim_start_matches("FRAME_STATE_").to_lowercase()
}

pub(crate) fn job_json(job: &Job) -> Value {
    let error = job.error.as_ref();
    let seconds = |time: &Option<prost_types::Timestamp>| {
        time.as_ref().map(|time| time.seconds as f64 + f64::from(time.nanos) * 1e-9)
    };
    json!({
        "id": job.id,
        "name": job.spec.as_ref().map(|spec| spec.display_name.as_str()),
        "state": job_state_name(job.state()),
        "error": error.map(|error| json!({"reason": error.reason().as_str_name(), "message": error.message})),
        "frames_total": job.frames_total,
        "frames_finished": job.frames_finished,
        "submitted_at": seconds(&job.submitted_at),
        "started_at": seconds(&job.started_at),
        "finished_at": seconds(&job.finished_at),
        "statistics": job.statistics.as_ref().map(statistics_json),
    })
}

/// One line for an event: `event` names its kind.
pub(crate) fn event_json(event: &JobEvent) -> Value {
    let mut line = match &event.event {
        Some(Event::Snapshot(job)) => json!({"event": "snapshot", "job": job_json(job)}),
        Some(Event::Frame(frame)) => frame_json(frame),
        Some(Event::Round(round)) => round_json(round),
        Some(Event::Progress(progress)) => progress_json(progress),
        Some(Event::Bookmark(_)) | None => json!({"event": "bookmark"}),
    };
    line["revision"] = event.revision.into();
    line["resume_token"] = event.resume_token.as_str().into();
    line
}

fn frame_json(frame: &Frame) -> Value {
    json!({
        "event": "frame",
        "frame": frame.frame,
        "state": frame_state_name(frame.state()),
        "rounds_finished": frame.rounds_finished,
        "spp": frame.spp,
        "rel_mse": frame.rel_mse,
        "rel_mse_ci95": pair(&frame.rel_mse_ci95),
        "denoised_rel_mse": frame.denoised_rel_mse,
        "denoised_rel_mse_ci95": pair(&frame.denoised_rel_mse_ci95),
        "render_seconds": frame.render_seconds,
        "error": frame.error.as_ref().map(|error| error.message.as_str()),
        "statistics": frame.statistics.as_ref().map(statistics_json),
    })
}

/// An interval; `null` where there is none.
fn pair(ends: &[f64]) -> Value {
    if ends.is_empty() { Value::Null } else { json!(ends) }
}

fn round_json(round: &RoundFinished) -> Value {
    json!({
        "event": "round",
        "frame": round.frame,
        "round": round.round,
        "spp": round.spp,
        "rel_mse": round.rel_mse,
        "seconds": round.seconds,
    })
}

fn progress_json(progress: &Progress) -> Value {
    json!({
        "event": "progress",
        "frame": progress.frame,
        "samples_done": progress.samples_done,
        "samples_planned": progress.samples_planned,
        "samples_per_second": progress.samples_per_second,
        "rel_mse": progress.rel_mse,
        "seconds_left": progress.seconds_left,
        "frames_finished": progress.frames_finished,
        "frames_total": progress.frames_total,
    })
}

fn statistics_json(statistics: &Statistics) -> Value {
    json!({
        "samples": statistics.samples,
        "rays": statistics.rays,
        "shadow_rays": statistics.shadow_rays,
        "nonfinite_samples": statistics.nonfinite_samples,
        "exhausted_rays": statistics.exhausted_rays,
        "sdf_evaluations": statistics.sdf_evaluations,
    })
}

#[cfg(test)]
mod tests {
    use super::event_json;
    use karst_proto::v1::job_event::Event;
    use karst_proto::v1::{Job, JobEvent, JobState};

    #[test]
    fn an_event_is_one_flat_line() {
        let job = Job { id: "j1".to_owned(), state: JobState::Running.into(), ..Job::default() };
        let event = JobEvent { revision: 7, resume_token: "t".to_owned(), event: Some(Event::Snapshot(job)) };
        let line = event_json(&event);
        assert_eq!(line["event"], "snapshot");
        assert_eq!(line["revision"], 7);
        assert_eq!(line["job"]["state"], "running");
        assert!(!line.to_string().contains('\n'));
    }
}
