//! Tests of the job machine: any sequence of events, and the ways that matter.

use super::{Effect, Event, JobRun};
use crate::digest::Digest;
use crate::model::{
    Cause, Failure, Finished, Frame, FrameState, Job, JobState, Record, RoundReport, Statistics,
};
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
        4 => frame.clone().prop_map(|f| Event::FrameFinished(f, Finished::default(), 2)),
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
    run.step(Event::FrameFinished(1, Finished::default(), 9)).unwrap();
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
    run.step(Event::FrameFinished(2, Finished::default(), 3)).unwrap();
    assert_eq!(run.job.state, JobState::Failed);
    assert_eq!(run.job.failure.as_ref().map(|f| f.message.as_str()), Some("frame 1: tile 3"));
    assert_eq!(run.frames[&2].state, FrameState::Finished);
}
