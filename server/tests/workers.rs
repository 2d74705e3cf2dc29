//! Real worker processes: the picture has the same bits over any number of them, killed or told to end.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::path::Path;
use std::time::Duration;

use karst_core::scene::Overrides;
use karst_proto::v1::{self, FrameState, JobState};
use support::program::{Program, Worker};
use support::{Client, fading, hash, render_locally, request_id, scene_text};

fn spec(spec: v1::JobSpec) -> v1::JobSpec {
    v1::JobSpec { tile_size: 16, ..spec }
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_workers_gives_the_same_bits() {
    let text = scene_text((160, 96), r#"{"spp": 32, "seed": 3}"#, "");
    let local = hash(&render_locally(&text, 1, &Overrides::default(), 64));
    let cache = tempfile::tempdir().unwrap();
    for (threads, count) in [(0, 1), (0, 2), (0, 5), (1, 2)] {
        let dir = tempfile::tempdir().unwrap();
        let server = Program::start(dir.path(), threads);
        let workers: Vec<_> = (0..count).map(|_| Worker::start(&server, cache.path())).collect();
        let mut client = server.client().await;
        let job = client.spec(&text).await;
        let job = client.submit(&request_id("bits"), &spec(job)).await.unwrap().id;
        assert_eq!(client.finish(&job).await.state(), JobState::Succeeded, "{threads} here, {count} there");
        assert_eq!(hash(&client.collect(&job, 1).await.unwrap()), local, "{threads} here, {count} there");
        let samples = client.frame_list(&job).await[0].statistics.unwrap().samples;
        assert_eq!(samples, 160 * 96 * 32, "nothing counted twice");
        drop(workers);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_adaptive_frame_is_planned_from_what_workers_report() {
    let text = scene_text((96, 64), r#"{"target_error": 0.05, "min_spp": 8, "max_spp": 256}"#, "");
    let local = hash(&render_locally(&text, 1, &Overrides::default(), 64));
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let server = Program::start(dir.path(), 0);
    let _workers = [Worker::start(&server, cache.path()), Worker::start(&server, cache.path())];
    let mut client = server.client().await;
    let job = client.spec(&text).await;
    let job = client.submit(&request_id("adaptive"), &spec(job)).await.unwrap().id;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    assert_eq!(hash(&client.collect(&job, 1).await.unwrap()), local);
}

/// Workers are killed all the time and replaced, the server once.
#[tokio::test(flavor = "multi_thread")]
async fn killed_workers_and_a_killed_server_leave_no_trace() {
    let text = scene_text((192, 128), r#"{"spp": 256, "seed": 5}"#, &fading(3));
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut server = Program::start(dir.path(), 0);
    let address = server.address().to_owned();
    let mut workers: Vec<_> = (0..3).map(|_| Worker::start(&server, cache.path())).collect();
    let mut client = server.client().await;
    let job = client.spec(&text).await;
    let job = client.submit(&request_id("killed"), &v1::JobSpec { tile_size: 32, ..job }).await.unwrap().id;
    for turn in 0..6 {
        tokio::time::sleep(Duration::from_millis(400)).await;
        workers.remove(turn % 3).kill();
        workers.push(Worker::start(&server, cache.path()));
        if turn == 2 {
            server.kill();
            server = Program::start_on(dir.path(), 0, &address);
            client = server.client().await;
        }
    }
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    check_frames(&mut client, &job, &text).await;
    assert_eq!(leftovers(dir.path()), 0, "packs");
}

/// A worker that is told to end hands back what it has and is not held against anything.
#[tokio::test(flavor = "multi_thread")]
async fn a_drained_worker_loses_nothing() {
    let text = scene_text((192, 128), r#"{"spp": 128, "seed": 5}"#, &fading(2));
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let server = Program::start(dir.path(), 0);
    let mut client = server.client().await;
    let job = client.spec(&text).await;
    let job = client.submit(&request_id("drained"), &v1::JobSpec { tile_size: 32, ..job }).await.unwrap().id;
    for _ in 0..4 {
        let worker = Worker::start(&server, cache.path());
        tokio::time::sleep(Duration::from_millis(500)).await;
        let began = tokio::time::Instant::now();
        let status = tokio::task::spawn_blocking(move || worker.terminate()).await.unwrap();
        assert!(status.success(), "{status}");
        assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
    }
    let _last = Worker::start(&server, cache.path());
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    check_frames(&mut client, &job, &text).await;
}

async fn check_frames(client: &mut Client, job: &str, text: &str) {
    for frame in client.frame_list(job).await {
        assert_eq!(frame.state(), FrameState::Finished);
        let local = render_locally(text, frame.frame, &Overrides::default(), 64);
        assert_eq!(
            hash(&client.collect(job, frame.frame).await.unwrap()),
            hash(&local),
            "frame {}",
            frame.frame
        );
        let samples = local.len() as u64 / 3 * frame.spp as u64;
        assert_eq!(frame.statistics.unwrap().samples, samples, "nothing counted twice");
    }
}

fn leftovers(data: &Path) -> usize {
    fn files(folder: &Path) -> usize {
        let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
        entries.map(|e| e.unwrap().path()).map(|p| if p.is_dir() { files(&p) } else { 1 }).sum()
    }
    files(&data.join("blobs/packs"))
}
