//! The real program, killed in the middle with `kill -9`: it goes on by itself, the picture has the same bits, and
//! a watcher misses nothing.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use karst_core::scene::Overrides;
use karst_proto::v1::{self, JobState, job_event};
use support::program::Program;
use support::{Client, fading, hash, is_record, render_locally, request_id, scene_text};
use tokio::time::Instant;

/// Watches until `enough` says so or the connection breaks; adds what it saw.
async fn watch(
    client: &mut Client,
    job: &str,
    seen: &mut Vec<v1::JobEvent>,
    enough: impl Fn(&v1::JobEvent) -> bool,
) {
    let resume_token = seen.last().map(|e| e.resume_token.clone()).unwrap_or_default();
    let request = v1::WatchJobRequest { job: job.to_owned(), resume_token };
    let mut stream = client.jobs.watch_job(request).await.unwrap().into_inner();
    while let Ok(Some(event)) = stream.message().await {
        let stop = enough(&event);
        if is_record(&event) {
            seen.push(event);
        }
        if stop {
            return;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_server_goes_on_where_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let text = scene_text((192, 128), r#"{"spp": 128, "seed": 5}"#, &fading(3));
    let mut program = Program::start(dir.path(), 2);
    let mut client = program.client().await;
    let spec = client.spec(&text).await;
    let spec = v1::JobSpec { tile_size: 32, ..spec };
    let request = request_id("killed");
    let job = client.submit(&request, &spec).await.unwrap().id;

    // Killed at six moments: after a number of samples in the running round, whatever round that is.
    let mut seen = Vec::new();
    for kill in 0..6_u64 {
        let began = Instant::now();
        let patience = Duration::from_millis(120 + 170 * kill);
        let enough = move |event: &v1::JobEvent| {
            let final_state =
                matches!(&event.event, Some(job_event::Event::Snapshot(j)) if j.finished_at.is_some());
            final_state || began.elapsed() > patience
        };
        watch(&mut client, &job, &mut seen, enough).await;
        program.kill();
        program = Program::start(dir.path(), 2);
        client = program.client().await;
        let again = client.submit(&request, &spec).await.unwrap().id;
        assert_eq!(again, job, "the request is remembered");
    }
    tokio::time::timeout(Duration::from_mins(2), watch(&mut client, &job, &mut seen, |_| false))
        .await
        .expect("the job finishes by itself");

    let revisions: Vec<u64> = seen.iter().map(|e| e.revision).collect();
    let first = revisions[0];
    assert_eq!(
        revisions,
        (first..first + revisions.len() as u64).collect::<Vec<_>>(),
        "no gap, nothing twice"
    );
    assert_eq!(client.job(&job).await.state(), JobState::Succeeded);
    for frame in client.frame_list(&job).await {
        let local = render_locally(&text, frame.frame, &Overrides::default(), 64);
        let pixels = client.collect(&job, frame.frame).await.unwrap();
        assert_eq!(hash(&pixels), hash(&local), "frame {}", frame.frame);
        assert_eq!(frame.statistics.unwrap().samples, 192 * 128 * 128, "nothing counted twice");
        let rounds = seen.iter().filter_map(|e| match &e.event {
            Some(job_event::Event::Round(r)) if r.frame == frame.frame => Some(r.round),
            _ => None,
        });
        assert_eq!(rounds.collect::<Vec<_>>(), (0..frame.rounds_finished).collect::<Vec<_>>());
    }
    // Nothing is left over: no packs, and one film for each frame.
    let count = |kind: &str| walk(&dir.path().join("blobs").join(kind));
    assert_eq!((count("packs"), count("films")), (0, 3));
    drop(program);
}

/// Number of files below a folder.
fn walk(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    entries.map(|e| e.unwrap().path()).map(|p| if p.is_dir() { walk(&p) } else { 1 }).sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_blobs_are_rendered_again() {
    let dir = tempfile::tempdir().unwrap();
    let text = scene_text((128, 96), r#"{"spp": 256, "seed": 5}"#, "");
    let program = Program::start(dir.path(), 2);
    let mut client = program.client().await;
    let spec = client.spec(&text).await;
    let job = client.submit(&request_id("rot"), &spec).await.unwrap().id;
    let mut seen = Vec::new();
    watch(
        &mut client,
        &job,
        &mut seen,
        |e| matches!(&e.event, Some(job_event::Event::Round(r)) if r.round == 2),
    )
    .await;
    program.kill();
    for kind in ["films", "packs"] {
        flip_a_bit_in_all(&dir.path().join("blobs").join(kind));
    }
    let program = Program::start(dir.path(), 2);
    let mut client = program.client().await;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    let local = render_locally(&text, 1, &Overrides::default(), 64);
    assert_eq!(hash(&client.collect(&job, 1).await.unwrap()), hash(&local));
    drop(program);
}

fn flip_a_bit_in_all(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.map(|e| e.unwrap().path()) {
        if path.is_dir() {
            flip_a_bit_in_all(&path);
        } else {
            let mut bytes = std::fs::read(&path).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            std::fs::write(&path, bytes).unwrap();
        }
    }
}

#[test]
fn other_addresses_are_refused_with_the_reason() {
    let output = Command::new(env!("CARGO_BIN_EXE_karst-server"))
        .args(["serve", "--listen", "0.0.0.0:0"])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && text.contains("token init --tls"), "{text}");
}
