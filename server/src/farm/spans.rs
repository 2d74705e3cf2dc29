//! Owns what the farm tells a collector: when jobs, frames, rounds and tasks began and how they ended.

use std::collections::BTreeMap;

use opentelemetry::KeyValue;

use crate::clock;
use crate::farm::Farm;
use crate::farm::jobs::LiveJob;
use crate::farm::live::LiveFrame;
use crate::farm::queue::Task;
use crate::model::{FrameState, JobState, Time};
use crate::telemetry::Telemetry;
use crate::telemetry::counts::Outcome;
use crate::telemetry::traces::{Place, Span, Traces};

/// When the frames and rounds of a job began that are under way.
#[derive(Debug, Default)]
pub(crate) struct Times {
    /// By frame number; whether another server began it, before this one went on.
    frames: BTreeMap<i32, (Time, bool)>,
    /// By frame number: index of the round.
    rounds: BTreeMap<i32, (u32, Time)>,
}

impl Farm {
    /// Workers may begin a frame, or go on with it.
    pub(super) fn frame_begins(&mut self, frame: &LiveFrame, state: FrameState) {
        let Some(job) = self.jobs.get_mut(frame.number) else { return };
        job.times.frames.insert(frame.frame, (clock::now(), state != FrameState::Pending));
    }

    /// The tasks of a round are about to be opened.
    pub(super) fn round_begins(&mut self, frame: &LiveFrame, round: u32) {
        let Some(job) = self.jobs.get_mut(frame.number) else { return };
        job.times.rounds.insert(frame.frame, (round, clock::now()));
    }

    /// A round is complete and evaluated.
    pub(super) fn round_ended(&mut self, frame: &LiveFrame) {
        let samples = frame.current_round().map_or(0, |round| round.samples(&frame.grid));
        let Some(job) = self.jobs.get_mut(frame.number) else { return };
        let Some((round, began)) = job.times.rounds.remove(&frame.frame) else { return };
        let place = Place::Round(frame.frame, round);
        let span =
            || Span::of(&frame.job, place, (began, clock::now())).samples(samples).ended("complete", None);
        self.shared.telemetry.traces.send(span);
    }
}

/// What a job tells when something of it has ended: the spans of the frames that have, and its own.
pub(super) fn of_ended(job: &mut LiveJob, traces: &Traces) -> Vec<Span> {
    let LiveJob { run, times, .. } = job;
    let (id, now) = (&*run.job.id, clock::now());
    let mut spans = Vec::new();
    for frame in run.frames.values().filter(|frame| frame.state.is_final()) {
        let Some((began, resumed)) = times.frames.remove(&frame.frame) else { continue };
        if let Some((round, began)) = times.rounds.remove(&frame.frame) {
            let place = Place::Round(frame.frame, round);
            spans.push(Span::of(id, place, (began, now)).ended("stopped", None));
        }
        let failure = frame.failure.as_ref().filter(|_| frame.state == FrameState::Failed);
        let failure = failure.map(|failure| failure.message.clone());
        let outcome = match frame.state {
            FrameState::Finished => "finished",
            FrameState::Failed => "failed",
            FrameState::Cancelled => "cancelled",
            FrameState::Pending | FrameState::Rendering | FrameState::Finishing => continue,
        };
        let span = Span::of(id, Place::Frame(frame.frame), (began, now))
            .samples(frame.statistics.samples)
            .with(KeyValue::new("karst.resumed", resumed));
        spans.push(span.ended(outcome, failure));
    }
    let outcome = match run.job.state {
        JobState::Succeeded => "succeeded",
        JobState::Failed => "failed",
        JobState::Cancelled => "cancelled",
        JobState::Queued | JobState::Running => "",
    };
    if !outcome.is_empty() {
        let failure = run.job.failure.as_ref().map(|failure| failure.message.clone());
        let span = Span::of(id, Place::Job, (run.job.submitted_at, now)).samples(run.job.statistics.samples);
        spans.push(span.ended(outcome, failure));
    }
    if traces.is_on() { spans } else { Vec::new() }
}

impl Task {
    /// Tells and counts how the task ended in the hands of `worker`.
    pub(crate) fn ended(&self, telemetry: &Telemetry, worker: &str, outcome: Outcome, samples: u64) {
        telemetry.counts.ended(outcome);
        self.traced(telemetry, worker, outcome, samples);
    }

    /// Tells how the task ended in the hands of `worker`.
    pub(crate) fn traced(&self, telemetry: &Telemetry, worker: &str, outcome: Outcome, samples: u64) {
        if !self.taken.is_known() {
            return;
        }
        let place = Place::Task(self.frame.frame, self.round.index, self.tile, self.taken);
        let failure = matches!(outcome, Outcome::Failed | Outcome::Lost | Outcome::Disputed)
            .then(|| outcome.name().to_owned());
        telemetry.traces.send(|| {
            let span = Span::of(&self.frame.job, place, (self.taken.at, clock::now()));
            span.worker(worker).samples(samples).ended(outcome.name(), failure)
        });
    }
}
