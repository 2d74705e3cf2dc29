//! Tests of the database: what was answered is there after opening the file again.

use std::collections::BTreeMap;

use crate::digest::Digest;
use crate::error::Error;
use crate::job::{Effect, Event, JobRun};
use crate::model::{Frame, FrameState, Job, JobState, Record};
use crate::spec::{Denoise, JobSpec, Settings};
use crate::state::{Row, State, StoredRound, Submission, Submitted};

fn job(id: &str) -> Job {
    let spec = JobSpec {
        display_name: "cave".into(),
        scene: Digest::of(b"scene"),
        files: BTreeMap::from([("a.obj".to_owned(), Digest::of(b"a"))]),
        frames: None,
        settings: Settings { spp: Some(4), ..Settings::default() },
        tile_size: 64,
        denoise: Denoise::Off,
    };
    Job::submitted(id.into(), spec, 2, 7)
}

async fn submit(state: &State, request_id: &str, body: &[u8], id: &str) -> Result<Submitted, Error> {
    let submission = Submission { request_id, body: Digest::of(body), job: &job(id), frames: &[1, 2] };
    state.submit(submission).await
}

fn rows(run: &JobRun, effects: Vec<Effect>) -> Vec<Row> {
    let id = run.job.id.clone();
    let mut rows: Vec<Row> = effects
        .into_iter()
        .filter_map(|effect| match effect {
            Effect::Record(revision, record) => Some(Row::Record(id.clone(), revision, record)),
            Effect::SaveFrame(frame) => Some(Row::Frame(id.clone(), Box::new(run.frames[&frame].clone()))),
            Effect::Stop(_) => None,
        })
        .collect();
    rows.push(Row::Job(Box::new(run.job.clone())));
    rows
}

#[tokio::test]
async fn a_request_makes_one_job() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("karst.db");
    let state = State::open(&file).await.unwrap();
    assert!(matches!(submit(&state, "r1", b"x", "j1").await.unwrap(), Submitted::New(1)));
    state.close().await;

    let state = State::open(&file).await.unwrap();
    let Submitted::Known(known) = submit(&state, "r1", b"x", "j2").await.unwrap() else { panic!("new") };
    assert_eq!(known.id, "j1");
    assert_eq!(state.known("r1", &Digest::of(b"x")).await.unwrap().unwrap().id, "j1");
    assert!(matches!(submit(&state, "r1", b"y", "j3").await, Err(Error::RequestIdReused(_))));
    assert!(matches!(submit(&state, "r2", b"y", "j1").await, Err(Error::Database(_))), "ids are unique");
    assert!(matches!(submit(&state, "r2", b"y", "j4").await.unwrap(), Submitted::New(2)));
}

#[tokio::test]
async fn unfinished_jobs_come_back_whole() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("karst.db");
    let state = State::open(&file).await.unwrap();
    submit(&state, "r1", b"x", "j1").await.unwrap();
    submit(&state, "r2", b"x", "j2").await.unwrap();
    let mut run = JobRun::new(job("j1"), [1, 2].map(Frame::pending));
    let effects = run.step(Event::FrameBegan(1, 9)).unwrap();
    state.commit(&rows(&run, effects)).await.unwrap();
    state.close().await;

    let state = State::open(&file).await.unwrap();
    let stored = state.unfinished().await.unwrap();
    assert_eq!(stored.iter().map(|s| s.number).collect::<Vec<_>>(), [1, 2]);
    assert_eq!(stored[0].run, run, "files included");
    let records = state.records("j1", 0, 100).await.unwrap();
    assert_eq!(records.iter().map(|r| r.0).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(matches!(&records[2].1, Record::Frame(f) if f.state == FrameState::Rendering));

    let effects = run.step(Event::Cancelled(10)).unwrap();
    state.commit(&rows(&run, effects)).await.unwrap();
    assert_eq!(state.unfinished().await.unwrap().len(), 1);
    assert_eq!(state.job("j1").await.unwrap().state, JobState::Cancelled);
}

#[tokio::test]
async fn a_transaction_is_stored_whole_or_not_at_all() {
    let dir = tempfile::tempdir().unwrap();
    let state = State::open(&dir.path().join("karst.db")).await.unwrap();
    submit(&state, "r1", b"x", "j1").await.unwrap();
    let pack = Row::Pack { job: "j1".into(), frame: 1, round: 0, pack: Digest::of(b"p") };
    let twice = Row::Record("j1".into(), 1, Record::Frame(Box::new(Frame::pending(1))));
    assert!(state.commit(&[pack, twice]).await.is_err(), "revision 1 exists");
    assert_eq!(state.round("j1", 1).await.unwrap(), StoredRound::default());
}

#[tokio::test]
async fn a_film_replaces_the_packs_of_its_round() {
    let dir = tempfile::tempdir().unwrap();
    let state = State::open(&dir.path().join("karst.db")).await.unwrap();
    submit(&state, "r1", b"x", "j1").await.unwrap();
    let pack =
        |frame, round, text: &[u8]| Row::Pack { job: "j1".into(), frame, round, pack: Digest::of(text) };
    state.commit(&[pack(1, 0, b"p"), pack(1, 0, b"q"), pack(1, 0, b"p"), pack(2, 0, b"r")]).await.unwrap();
    assert_eq!(state.round("j1", 1).await.unwrap().packs.len(), 2, "the same pack counts once");
    let film = Digest::of(b"film");
    state.commit(&[Row::Film { job: "j1".into(), frame: 1, rounds: 1, film }]).await.unwrap();
    let stored = StoredRound { rounds: 1, film: Some(film), packs: Vec::new() };
    assert_eq!(state.round("j1", 1).await.unwrap(), stored);
    assert_eq!(state.packs().await.unwrap().len(), 1, "the other frame's");
    assert_eq!(state.films().await.unwrap().len(), 1);
    state.commit(&[pack(1, 1, b"s"), Row::Forget("j1".into(), 2)]).await.unwrap();
    assert_eq!(state.round("j1", 1).await.unwrap().packs, [Digest::of(b"s")]);
    assert_eq!(state.packs().await.unwrap().len(), 1);
}

#[tokio::test]
async fn pages_and_filters() {
    let dir = tempfile::tempdir().unwrap();
    let state = State::open(&dir.path().join("karst.db")).await.unwrap();
    for i in 1..=5 {
        submit(&state, &format!("r{i}"), b"x", &format!("j{i}")).await.unwrap();
    }
    let mut run = JobRun::new(job("j4"), [1, 2].map(Frame::pending));
    let effects = run.step(Event::Cancelled(1)).unwrap();
    state.commit(&rows(&run, effects)).await.unwrap();
    let ids =
        |jobs: Vec<(i64, Job)>| jobs.into_iter().map(|(n, j)| format!("{n}{}", j.id)).collect::<Vec<_>>();
    assert_eq!(ids(state.jobs(&[], i64::MAX, 2).await.unwrap()), ["5j5", "4j4"]);
    assert_eq!(ids(state.jobs(&[JobState::Queued], 5, 2).await.unwrap()), ["3j3", "2j2"]);
    assert_eq!(
        ids(state.jobs(&[JobState::Cancelled, JobState::Failed], i64::MAX, 9).await.unwrap()),
        ["4j4"]
    );
    assert_eq!(state.frames("j1", 2, 9).await.unwrap().len(), 1);
    assert!(matches!(state.frame("j1", 3).await, Err(Error::FrameNotFound(..))));
    assert!(matches!(state.frame("j9", 1).await, Err(Error::JobNotFound(_))));
    assert!(matches!(state.job("j9").await, Err(Error::JobNotFound(_))));
}
