//! Owns what may happen to a job: a pure machine, (state, event) → (state, effects).
//!
//! Everything that a watcher is told comes out of [`JobRun::step`] as [`Effect::Record`] with the next revision
//! of the job; the caller stores record and job in one transaction and tells watchers afterwards.
//! A final state is never left.

use std::collections::BTreeMap;

use crate::model::{
    Failure, Finished, Frame, FrameState, Job, JobState, Record, RoundReport, Statistics, Time,
};

/// What happens to a job.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A worker may begin the frame.
    FrameBegan(i32, Time),
    /// A round is complete and merged.
    RoundFinished(i32, RoundReport),
    /// No further round.
    FrameRendered(i32),
    /// The files are stored.
    FrameFinished(i32, Finished, Time),
    /// The frame cannot be finished.
    FrameFailed(i32, Failure, Time),
    /// Somebody wants no more of it.
    Cancelled(Time),
}

/// What the caller has to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Store this record under this revision, then tell watchers.
    Record(u64, Record),
    /// Store the newest state of this frame.
    SaveFrame(i32),
    /// Render no more of this frame.
    Stop(i32),
}

/// The event does not fit the state; nothing changed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("job {job} is {state:?}: {event} is not possible")]
pub struct Illegal {
    /// The job's id.
    pub job: String,
    /// Its state.
    pub state: JobState,
    /// What was tried.
    pub event: String,
}

/// A job with its frames.
#[derive(Debug, Clone, PartialEq)]
pub struct JobRun {
    /// The job.
    pub job: Job,
    /// Its frames by their numbers.
    pub frames: BTreeMap<i32, Frame>,
}

impl JobRun {
    /// A job with these frames.
    pub fn new(job: Job, frames: impl IntoIterator<Item = Frame>) -> Self {
        Self { job, frames: frames.into_iter().map(|f| (f.frame, f)).collect() }
    }

    /// Takes one event; on error nothing has changed.
    ///
    /// # Errors
    /// [`Illegal`] when the event does not fit the state of the job or of the frame.
    pub fn step(&mut self, event: Event) -> Result<Vec<Effect>, Illegal> {
        self.check(&event)?;
        let mut effects = Vec::new();
        match event {
            Event::FrameBegan(frame, at) => self.begin(frame, at, &mut effects),
            Event::RoundFinished(frame, report) => self.finish_round(frame, report, &mut effects),
            Event::FrameRendered(frame) => {
                self.change(frame, FrameState::Finishing, &mut effects, |_| {});
            }
            Event::FrameFinished(frame, finished, at) => {
                self.change(frame, FrameState::Finished, &mut effects, |f| {
                    f.files = finished.files;
                    f.denoised = finished.denoised;
                    f.failure = finished.failure;
                });
                self.job.frames_finished += 1;
                self.settle(at, &mut effects);
            }
            Event::FrameFailed(frame, failure, at) => {
                effects.push(Effect::Stop(frame));
                self.change(frame, FrameState::Failed, &mut effects, |f| f.failure = Some(failure));
                self.settle(at, &mut effects);
            }
            Event::Cancelled(at) => self.cancel(at, &mut effects),
        }
        Ok(effects)
    }

    fn check(&self, event: &Event) -> Result<(), Illegal> {
        let state = |frame: &i32| self.frames.get(frame).map(|f| f.state);
        let fits = !self.job.state.is_final()
            && match event {
                Event::FrameBegan(frame, _) => state(frame) == Some(FrameState::Pending),
                Event::RoundFinished(frame, _) | Event::FrameRendered(frame) => {
                    state(frame) == Some(FrameState::Rendering)
                }
                Event::FrameFinished(frame, ..) => state(frame) == Some(FrameState::Finishing),
                Event::FrameFailed(frame, ..) => state(frame).is_some_and(|s| !s.is_final()),
                Event::Cancelled(_) => true,
            };
        let illegal = || Illegal {
            job: self.job.id.clone(),
            state: self.job.state,
            event: format!("{event:?}").chars().take(80).collect(),
        };
        if fits { Ok(()) } else { Err(illegal()) }
    }

    fn begin(&mut self, frame: i32, at: Time, effects: &mut Vec<Effect>) {
        if self.job.state == JobState::Queued {
            self.job.state = JobState::Running;
            self.job.started_at = Some(at);
            self.snapshot(effects);
        }
        self.change(frame, FrameState::Rendering, effects, |_| {});
    }

    fn finish_round(&mut self, frame: i32, report: RoundReport, effects: &mut Vec<Effect>) {
        if let Some(f) = self.frames.get_mut(&frame) {
            f.rounds = report.round + 1;
            f.spp = report.spp;
            f.rel_mse = report.rel_mse;
            f.rel_mse_ci95 = report.rel_mse_ci95;
            f.seconds = report.seconds;
            f.statistics = report.statistics;
        }
        self.job.statistics =
            self.frames.values().map(|f| f.statistics).fold(Statistics::default(), |a, b| a + b);
        effects.push(Effect::SaveFrame(frame));
        self.record(Record::Round { frame, report }, effects);
    }

    /// Ends the job when its last frame has ended.
    fn settle(&mut self, at: Time, effects: &mut Vec<Effect>) {
        if self.frames.values().any(|f| !f.state.is_final()) {
            return;
        }
        let failed = self.frames.values().find(|f| f.state == FrameState::Failed);
        self.job.state = if failed.is_some() { JobState::Failed } else { JobState::Succeeded };
        self.job.failure = failed.and_then(|f| {
            let failure = f.failure.as_ref()?;
            Some(Failure::new(failure.cause, format!("frame {}: {}", f.frame, failure.message)))
        });
        self.job.finished_at = Some(at);
        self.snapshot(effects);
    }

    fn cancel(&mut self, at: Time, effects: &mut Vec<Effect>) {
        let open: Vec<i32> = self.frames.values().filter(|f| !f.state.is_final()).map(|f| f.frame).collect();
        for frame in open {
            effects.push(Effect::Stop(frame));
            self.change(frame, FrameState::Cancelled, effects, |_| {});
        }
        self.job.state = JobState::Cancelled;
        self.job.finished_at = Some(at);
        self.snapshot(effects);
    }

    fn change(
        &mut self,
        frame: i32,
        state: FrameState,
        effects: &mut Vec<Effect>,
        edit: impl FnOnce(&mut Frame),
    ) {
        let Some(f) = self.frames.get_mut(&frame) else { return };
        f.state = state;
        edit(f);
        let copy = Box::new(f.clone());
        effects.push(Effect::SaveFrame(frame));
        self.record(Record::Frame(copy), effects);
    }

    fn snapshot(&mut self, effects: &mut Vec<Effect>) {
        let mut copy = Box::new(self.job.clone());
        copy.revision += 1;
        self.record(Record::Snapshot(copy), effects);
    }

    fn record(&mut self, record: Record, effects: &mut Vec<Effect>) {
        self.job.revision += 1;
        effects.push(Effect::Record(self.job.revision, record));
    }
}

#[cfg(test)]
#[path = "job_tests.rs"]
mod tests;
