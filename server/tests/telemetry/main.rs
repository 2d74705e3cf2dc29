//! Traces of real jobs, taken by a real OTLP collector in this process: the spans of server and workers make one tree,
//! and a collector that is away, stalled or lied to changes nothing.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod collector;
mod liar;
#[path = "../support/mod.rs"]
mod support;

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use collector::{Got, TestCollector};
use karst_core::scene::Overrides;
use karst_proto::v1::{self, JobState};
use karst_server::config::{self, Collector};
use karst_server::digest::Digest;
use liar::Liar;
use support::program::{Program, Worker};
use support::{Client, TestServer, hash, render_locally, request_id, scene_text};
use tokio::net::TcpListener;
use tokio::time::Instant;

/// 3 × 2 tiles of 16 × 16 pixels, two rounds (2 and 6 samples per pixel).
const SAMPLING: &str = r#"{"spp": 8, "seed": 3}"#;
const SIZE: (u32, u32) = (48, 32);
const TASKS: usize = 12;

async fn submit(client: &mut Client, text: &str) -> String {
    let spec = v1::JobSpec { tile_size: 16, ..client.spec(text).await };
    client.submit(&request_id("traced"), &spec).await.unwrap().id
}

/// Renders through the server, and holds the picture against one that is not traced.
async fn render(client: &mut Client, text: &str) -> String {
    let job = submit(client, text).await;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    let local = hash(&render_locally(text, 1, &Overrides::default(), 64));
    assert_eq!(hash(&client.collect(&job, 1).await.unwrap()), local);
    job
}

async fn terminate(worker: Worker, server: Program) {
    let ended = tokio::task::spawn_blocking(|| (worker.terminate(), server.terminate())).await.unwrap();
    assert!(ended.0.success() && ended.1.success(), "{ended:?}");
}

fn inside(child: &Got, parent: &Got) {
    assert!(parent.begin <= child.begin && child.end <= parent.end, "{child:#?} in {parent:#?}");
    assert!(child.begin <= child.end);
}

/// The spans of one name, each the child of one of `parents` and within its time.
fn children<'a>(spans: &'a [Got], name: &str, parents: &[&Got]) -> Vec<&'a Got> {
    let found: Vec<&Got> = spans.iter().filter(|span| span.name == name).collect();
    for span in &found {
        let parent = parents.iter().find(|parent| parent.id == span.parent);
        inside(span, parent.unwrap_or_else(|| panic!("nobody's child: {span:#?}")));
    }
    found
}

/// The whole tree of a job with one frame; `render` says who rendered: service and instance.
fn check_tree(spans: &[Got], job: &str) -> (Vec<Got>, Vec<Got>) {
    let trace = Digest::of(job.as_bytes()).to_string()[..32].to_owned();
    assert!(spans.iter().all(|span| span.trace == trace), "one trace, named after the job");
    let ids: BTreeSet<&str> = spans.iter().map(|span| span.id.as_str()).collect();
    assert_eq!(ids.len(), spans.len(), "no span twice");
    let roots: Vec<&Got> = spans.iter().filter(|span| span.parent.is_empty()).collect();
    let [root] = roots[..] else { panic!("{roots:#?}") };
    assert_eq!((root.name.as_str(), root.get("karst.outcome")), ("job", "succeeded"));
    let frames = children(spans, "frame", &[root]);
    let [frame] = frames[..] else { panic!("{frames:#?}") };
    assert_eq!((frame.get("karst.frame"), frame.get("karst.outcome")), ("1", "finished"));
    assert_eq!(frame.get("karst.samples"), (SIZE.0 * SIZE.1 * 8).to_string());
    let rounds = children(spans, "round", &[frame]);
    assert_eq!(
        rounds.iter().map(|round| round.get("karst.round")).collect::<BTreeSet<_>>(),
        ["0", "1"].into()
    );
    let sum =
        |spans: &[&Got]| spans.iter().map(|s| s.get("karst.samples").parse::<u32>().unwrap()).sum::<u32>();
    assert_eq!(sum(&rounds), SIZE.0 * SIZE.1 * 8);
    let tasks = children(spans, "task", &rounds);
    assert_eq!(tasks.len(), TASKS);
    for task in &tasks {
        assert_eq!(task.get("karst.outcome"), "accepted");
        assert_eq!(task.get("karst.job.id"), job);
        let round = rounds.iter().find(|round| round.id == task.parent).unwrap();
        assert_eq!(task.get("karst.round"), round.get("karst.round"));
    }
    assert_eq!(sum(&tasks), SIZE.0 * SIZE.1 * 8);
    let renders = children(spans, "render", &tasks);
    assert_eq!(renders.len(), TASKS);
    for render in &renders {
        let task = tasks.iter().find(|task| task.id == render.parent).unwrap();
        for same in
            ["karst.job.id", "karst.frame", "karst.round", "karst.tile", "karst.worker.id", "karst.samples"]
        {
            assert_eq!(render.get(same), task.get(same), "{same}");
        }
    }
    assert_eq!(spans.len(), 4 + 2 * TASKS, "nothing else");
    let owned = |spans: Vec<&Got>| spans.into_iter().cloned().collect();
    (owned(tasks), owned(renders))
}

#[tokio::test(flavor = "multi_thread")]
async fn spans_of_server_and_worker_make_one_tree_and_are_sent_at_the_end() {
    let collector = TestCollector::start().await;
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // Nothing is sent while they run: what comes, comes because they flush when they end.
    let environment =
        [("OTEL_EXPORTER_OTLP_ENDPOINT", &*collector.url), ("OTEL_BSP_SCHEDULE_DELAY", "600000")];
    let server = Program::start_in(dir.path(), 0, "127.0.0.1:0", &environment);
    let worker = Worker::start_in(&server, &server.url, cache.path(), &environment);
    let mut client = server.client().await;
    let job = render(&mut client, &scene_text(SIZE, SAMPLING, "")).await;
    assert!(collector.spans().is_empty(), "too early");
    terminate(worker, server).await;
    let spans = collector.spans();
    let (tasks, renders) = check_tree(&spans, &job);
    let instance = &renders[0].instance;
    for render in &renders {
        assert_eq!((render.service.as_str(), &render.instance), ("karst-worker", instance));
        assert_eq!(render.get("karst.worker.id"), instance);
    }
    let others: Vec<&Got> = spans.iter().filter(|span| span.name != "render").collect();
    assert!(others.iter().all(|span| span.service == "karst-server" && span.instance == tasks[0].instance));
    assert_ne!(*instance, tasks[0].instance);
}

#[tokio::test(flavor = "multi_thread")]
async fn threads_of_the_server_tell_the_same() {
    let collector = TestCollector::start().await;
    let dir = tempfile::tempdir().unwrap();
    let to = Collector { endpoint: Some(collector.url.clone()), ca_file: None };
    let config = config::Config { collector: to, ..support::config(dir.path(), 2) };
    let server = TestServer::start_with(config).await;
    let job = render(&mut server.client().await, &scene_text(SIZE, SAMPLING, "")).await;
    server.stop().await;
    let (tasks, renders) = check_tree(&collector.spans(), &job);
    for span in tasks.iter().chain(&renders) {
        assert_eq!((span.service.as_str(), span.get("karst.worker.id")), ("karst-server", "server"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_goes_on_after_a_crash_goes_on_with_its_trace() {
    let collector = TestCollector::start().await;
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let environment = [("OTEL_EXPORTER_OTLP_ENDPOINT", &*collector.url), ("OTEL_BSP_SCHEDULE_DELAY", "20")];
    let server = Program::start_in(dir.path(), 0, "127.0.0.1:0", &environment);
    let address = server.address().to_owned();
    let mut client = server.client().await;
    let job = submit(&mut client, &scene_text((640, 480), r#"{"spp": 2, "seed": 3}"#, "")).await;
    let worker = Worker::start_in(&server, &server.url, cache.path(), &environment);
    collector.wait(|spans| spans.iter().any(|span| span.name == "task")).await;
    server.kill();
    let before = collector.spans();
    assert!(!before.iter().any(|span| span.name == "round"), "the job was over too soon for this test");
    let server = Program::start_in(dir.path(), 0, &address, &environment);
    let mut client = server.client().await;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    terminate(worker, server).await;

    let spans = collector.spans();
    assert!(spans.iter().all(|span| span.trace == spans[0].trace));
    let of = |name: &str| spans.iter().filter(|span| span.name == name).collect::<Vec<_>>();
    let ([root], [frame], [round]) = (&of("job")[..], &of("frame")[..], &of("round")[..]) else {
        panic!("{:#?}", spans.iter().filter(|s| !["task", "render"].contains(&&*s.name)).collect::<Vec<_>>());
    };
    assert_eq!((&frame.parent, &round.parent), (&root.id, &frame.id));
    assert_eq!(frame.get("karst.resumed"), "true");
    let servers: BTreeSet<&str> = of("task").iter().map(|task| task.instance.as_str()).collect();
    assert_eq!(servers.len(), 2, "tasks of both servers");
    assert!(of("task").iter().all(|task| task.parent == round.id));
    assert!(before.iter().filter(|s| s.name == "task").all(|task| task.instance != round.instance));
}

/// A job through a server and a worker that send to `url`; how long the picture and the end took.
async fn render_with(url: &str) -> Duration {
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let environment = [("OTEL_EXPORTER_OTLP_ENDPOINT", url), ("OTEL_BSP_SCHEDULE_DELAY", "50")];
    let server = Program::start_in(dir.path(), 1, "127.0.0.1:0", &environment);
    let worker = Worker::start_in(&server, &server.url, cache.path(), &environment);
    let mut client = server.client().await;
    let began = Instant::now();
    render(&mut client, &scene_text(SIZE, SAMPLING, "")).await;
    let rendered = began.elapsed();
    assert!(rendered < Duration::from_secs(5), "{rendered:?}");
    let began = Instant::now();
    terminate(worker, server).await;
    began.elapsed()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_collector_that_is_away_or_stalled_stops_nobody() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let ended = render_with(&url).await;
    // It takes connections and says nothing: whoever ends waits for it once, for a while, one after the other.
    assert!(ended < Duration::from_secs(9), "stalled: {ended:?}");
    drop(listener);
    let ended = render_with(&url).await;
    assert!(ended < Duration::from_secs(5), "away: {ended:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_garbage_traceparent_is_ignored() {
    let collector = TestCollector::start().await;
    let (dir, cache) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let environment = [("OTEL_EXPORTER_OTLP_ENDPOINT", &*collector.url), ("OTEL_BSP_SCHEDULE_DELAY", "50")];
    let server = Program::start_in(dir.path(), 0, "127.0.0.1:0", &environment);
    let mut client = server.client().await;
    let liar = Liar::start(client.clone()).await;
    let worker = Worker::start_in(&server, &liar.url, cache.path(), &environment);
    render(&mut client, &scene_text(SIZE, SAMPLING, "")).await;
    assert!(liar.told() >= TASKS, "{} tasks", liar.told());
    drop(worker);
    collector.wait(|spans| spans.iter().any(|span| span.name == "job")).await;
    let spans = collector.spans();
    assert_eq!(spans.iter().filter(|span| span.name == "task").count(), TASKS);
    assert!(!spans.iter().any(|span| span.name == "render"), "nothing hangs under garbage");
}

#[test]
fn a_malformed_address_of_a_collector_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str], path: &Path| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_karst-server"));
        let output =
            command.args(arguments).arg(path).args(["--otlp-endpoint", "nonsense"]).output().unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    for (arguments, path) in [
        (&["serve", "--listen", "127.0.0.1:0", "--data"][..], dir.path().join("data")),
        (&["work", "--server", "http://127.0.0.1:1", "--cache"][..], dir.path().join("cache")),
    ] {
        let (good, text) = run(arguments, &path);
        assert!(!good && text.contains("--otlp-endpoint") && text.contains("nonsense"), "{text}");
    }
}
