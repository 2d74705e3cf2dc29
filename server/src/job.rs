//! Owns what may happen to a job: a pure machine, (state, event) → (state, effects).
//!
//! Everything that a watcher is told comes out of [`JobRun::step`] as [`Effect::Record`] with the next revision
//! of the job; the caller stores record and job in one transaction and tells watchers afterwards.
//! A final state is never left.

use std::collections::BTreeMap;

use crate::model::{
    Failure, Frame, FrameFile, FrameState, Job, JobState, Record, RoundReport, Statistics, Time,
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
    /// The files are stored; a failure says why a denoised one is missing.
    FrameFinished(i32, Vec<FrameFile>, Option<Failure>, Time),
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
            Event::FrameFinished(frame, files, failure, at) => {
                self.change(frame, FrameState::Finished, &mut effects, |f| {
                    f.files = files;
                    f.failure = failure;
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
mod tests {
    use super::{Effect, Event, JobRun};
    use crate::digest::Digest;
    use crate::model::{Cause, Failure, Frame, FrameState, Job, JobState, Record, RoundReport, Statistics};
    use crate::spec::{Denoise, JobSpec, Settings};
    use proptest::prelude::{Strategy, any, prop, prop_assert, prop_assert_eq, prop_oneof, proptest};

    fn spec() -> JobSpec {
        JobSpec {
            display_name: String::new(),
            scene: Digest::of(b""),
            files: std::collections::BTreeMap::new(),
            frames: None,
            settings: Settings::default(),
            tile_size: 64,
            denoise: Denoise::Off,
        }
    }

    fn run(frames: i32) -> JobRun {
        let job = Job::submitted("j".into(), spec(), frames as u32, 0);
        JobRun::new(job, (1..=frames).map(Frame::pending))
    }

    fn report(round: u32, samples: u64) -> RoundReport {
        RoundReport {
            round,
            spp: 2.0,
            rel_mse: None,
            rel_mse_ci95: None,
            seconds: 1.0,
            statistics: Statistics { samples, ..Statistics::default() },
        }
    }

    fn failure() -> Failure {
        Failure::new(Cause::Internal, "tile 3")
    }

    fn events() -> impl Strategy<Value = Event> {
        let frame = 0..4_i32;
        prop_oneof![
            4 => frame.clone().prop_map(|f| Event::FrameBegan(f, 1)),
            4 => (frame.clone(), 0..3_u32, any::<u16>())
                .prop_map(|(f, r, s)| Event::RoundFinished(f, report(r, s.into()))),
            4 => frame.clone().prop_map(Event::FrameRendered),
            4 => frame.clone().prop_map(|f| Event::FrameFinished(f, Vec::new(), None, 2)),
            1 => frame.prop_map(|f| Event::FrameFailed(f, failure(), 3)),
            1 => prop::strategy::Just(Event::Cancelled(4)),
        ]
    }

    proptest! {
        #[test]
        fn no_sequence_of_events_breaks_a_job(events in prop::collection::vec(events(), 0..60)) {
            let mut run = run(3);
            for event in events {
                let before = run.clone();
                let Ok(effects) = run.step(event) else {
                    prop_assert_eq!(&run, &before, "a refused event changed something");
                    continue;
                };
                prop_assert!(!before.job.state.is_final(), "left a final state");
                for (number, frame) in &before.frames {
                    prop_assert!(!frame.state.is_final() || &run.frames[number] == frame);
                }
                let revisions: Vec<u64> = effects
                    .iter()
                    .filter_map(|e| if let Effect::Record(r, _) = e { Some(*r) } else { None })
                    .collect();
                let expected: Vec<u64> = (before.job.revision + 1..=run.job.revision).collect();
                prop_assert_eq!(revisions, expected, "revisions rise by one");
                let all_final = run.frames.values().all(|f| f.state.is_final());
                prop_assert_eq!(run.job.state.is_final(), all_final);
                if run.job.state.is_final() {
                    let last = effects.last();
                    prop_assert!(
                        matches!(last, Some(Effect::Record(r, Record::Snapshot(job)))
                            if **job == run.job && *r == run.job.revision),
                        "the last record is the final snapshot, found {:?}", last
                    );
                }
            }
        }
    }

    #[test]
    fn a_frame_goes_through_its_states() {
        let mut run = run(1);
        assert!(run.step(Event::FrameRendered(1)).is_err(), "not begun");
        run.step(Event::FrameBegan(1, 5)).unwrap();
        assert_eq!((run.job.state, run.job.started_at), (JobState::Running, Some(5)));
        run.step(Event::RoundFinished(1, report(0, 10))).unwrap();
        assert_eq!((run.frames[&1].rounds, run.job.statistics.samples), (1, 10));
        run.step(Event::FrameRendered(1)).unwrap();
        run.step(Event::FrameFinished(1, Vec::new(), None, 9)).unwrap();
        assert_eq!((run.job.state, run.job.frames_finished), (JobState::Succeeded, 1));
        assert!(run.step(Event::Cancelled(10)).is_err(), "final");
    }

    #[test]
    fn a_failed_frame_fails_the_job_but_not_the_other_frames() {
        let mut run = run(2);
        let effects = run.step(Event::FrameFailed(1, failure(), 1)).unwrap();
        assert_eq!(effects[0], Effect::Stop(1));
        assert_eq!(run.job.state, JobState::Queued);
        run.step(Event::FrameBegan(2, 2)).unwrap();
        run.step(Event::FrameRendered(2)).unwrap();
        run.step(Event::FrameFinished(2, Vec::new(), None, 3)).unwrap();
        assert_eq!(run.job.state, JobState::Failed);
        assert_eq!(run.job.failure.as_ref().map(|f| f.message.as_str()), Some("frame 1: tile 3"));
        assert_eq!(run.frames[&2].state, FrameState::Finished);
    }
}
