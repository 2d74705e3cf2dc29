//! The page of metrics over a server without its calls: what a small job moves, what the docs say of each name, and
//! whether Prometheus' own checker takes it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use karst_proto::v1::jobs_server::Jobs as _;
use karst_proto::v1::{JobSpec, Scene, SubmitJobRequest};
use prometheus::proto::{Metric, MetricFamily, MetricType};
use tokio::sync::Semaphore;
use tonic::Request;

use super::{families, metrics};
use crate::blobs::Kind;
use crate::config::{Collector, Config};
use crate::farm::Shared;
use crate::farm::queue::Queue;
use crate::service::jobs::JobsService;

/// 4 × 4 tiles of 16 × 16 pixels, one round.
const SCENE: &str = r#"{ "version": 1, "film": {"width": 64, "height": 64},
  "camera": {"type": "perspective", "vfov": 40, "transform":
    {"look_at": {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0]}}},
  "sampling": {"spp": 2}, "materials": {"clay": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}},
  "spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "clay"}},
  "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}} }"#;

async fn open(data: &Path) -> (Arc<Queue>, Arc<Shared>) {
    let config = Config {
        data: data.to_owned(),
        tls: None,
        workers: 1,
        lease: Duration::from_secs(2),
        tokens_file: None,
        collector: Collector::default(),
        state: None,
    };
    let queue = Arc::new(Queue::default());
    let shared = crate::open(&config, &queue).await.unwrap();
    (queue, shared)
}

async fn render(shared: &Arc<Shared>, service: &JobsService) {
    let digest = shared.blobs.put(Kind::Asset, SCENE).await.unwrap().to_string();
    let scene = Some(Scene { digest, files: Vec::new() });
    let request = SubmitJobRequest {
        request_id: "one".into(),
        validate_only: false,
        job: Some(JobSpec { scene, tile_size: 16, ..JobSpec::default() }),
    };
    let job = service.submit_job(Request::new(request)).await.unwrap().into_inner().id;
    for _ in 0..600 {
        if shared.state.job(&job).await.unwrap().state.is_final() {
            return;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("job {job} does not end");
}

/// Values by their names with labels, as a reader of the text sees them.
fn parse(text: &str) -> BTreeMap<String, f64> {
    let samples = text.lines().filter(|line| !line.starts_with('#'));
    samples
        .map(|line| {
            let (name, value) = line.rsplit_once(' ').unwrap_or_else(|| panic!("{line:?}"));
            (name.to_owned(), value.parse().unwrap_or_else(|e| panic!("{line:?}: {e}")))
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn counters_move_by_what_a_small_job_needs() {
    let dir = tempfile::tempdir().unwrap();
    let (queue, shared) = open(dir.path()).await;
    let (outlets, machinery) = crate::start(&shared, &queue, 1).await.unwrap();
    let service =
        JobsService { shared: Arc::clone(&shared), farm: outlets.farm.clone(), checking: Semaphore::new(1) };
    let before = parse(&metrics(&shared).await.unwrap());
    render(&shared, &service).await;
    let text = metrics(&shared).await.unwrap();
    let after = parse(&text);
    let moved = |name: &str| after[name] - before[name];
    for (name, expected) in [
        ("karst_jobs{state=\"succeeded\"}", 1.0),
        ("karst_frames{state=\"finished\"}", 1.0),
        ("karst_tiles_accepted_total", 16.0),
        ("karst_results_total{outcome=\"accepted\"}", 16.0),
        ("karst_samples_total", 64.0 * 64.0 * 2.0),
        ("karst_jobs{state=\"queued\"}", 0.0),
        ("karst_results_total{outcome=\"duplicate\"}", 0.0),
        ("karst_task_failures_total{kind=\"failed\"}", 0.0),
        ("karst_tasks{state=\"open\"}", 0.0),
        ("karst_nonfinite_samples_total", 0.0),
        ("karst_workers{state=\"alive\"}", 0.0),
    ] {
        assert_eq!(moved(name), expected, "{name}");
    }
    for name in
        ["karst_rays_total{kind=\"path\"}", "karst_render_seconds_total", "karst_blob_written_bytes_total"]
    {
        assert!(moved(name) > 0.0, "{name}");
    }
    assert!(moved("karst_rays_total{kind=\"path\"}") >= 8192.0, "a sample begins with a ray");
    assert_eq!(after["karst_worker_threads{place=\"server\"}"], 1.0);
    assert!(after["process_resident_memory_bytes"] > 1e6 && after["process_start_time_seconds"] > 1.5e9);
    check_with_promtool(&text);
    drop(service);
    shared.ending.cancel();
    machinery.stop().await.unwrap();
}

#[tokio::test]
async fn viewers_and_uploads_are_seen_while_they_are_there() {
    let dir = tempfile::tempdir().unwrap();
    let (_, shared) = open(dir.path()).await;
    let viewer = shared.hub.attach("j", None);
    let value = async |name: &str| parse(&metrics(&shared).await.unwrap())[name];
    assert_eq!(value("karst_viewers").await, 1.0);
    drop(viewer);
    assert_eq!(value("karst_viewers").await, 0.0);
    let upload = crate::telemetry::counts::Ongoing::new(&shared.telemetry.counts.uploads);
    assert_eq!(value("karst_uploads").await, 1.0);
    drop(upload);
    assert_eq!(value("karst_uploads").await, 0.0);
}

/// Prometheus' own checker, where it is installed.
fn check_with_promtool(text: &str) {
    let checked = Command::new("promtool")
        .args(["check", "metrics"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = match checked {
        Ok(child) => child,
        Err(e) if e.kind() == ErrorKind::NotFound => return println!("skipped: promtool is not installed"),
        Err(e) => panic!("promtool: {e}"),
    };
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let said =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.trim().is_empty(), "promtool check metrics: {said}");
}

/// A line of the page: name, kind, labels with their values, meaning.
fn line(family: &MetricFamily) -> String {
    let kind = match family.get_field_type() {
        MetricType::COUNTER => "counter",
        MetricType::GAUGE => "gauge",
        MetricType::SUMMARY | MetricType::UNTYPED | MetricType::HISTOGRAM => panic!("{}", family.name()),
    };
    let mut labels: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for pair in family.get_metric().iter().flat_map(Metric::get_label) {
        labels.entry(pair.name()).or_default().push(pair.value());
    }
    let label = |(name, values): (&&str, &Vec<&str>)| match *name {
        "method" => "`method` (SERVICE/METHOD of the proto files, else `other`)".to_owned(),
        "code" => "`code` (of gRPC, as in `Ok`)".to_owned(),
        "version" | "core" => format!("`{name}`"),
        _ => format!("`{name}` ({})", values.iter().map(|v| format!("`{v}`")).collect::<Vec<_>>().join(", ")),
    };
    let labels: Vec<String> = labels.iter().map(label).collect();
    format!("| `{}` | {kind} | {} | {} |", family.name(), labels.join(", "), family.help())
}

#[tokio::test]
async fn the_docs_name_every_metric() {
    let dir = tempfile::tempdir().unwrap();
    let (_, shared) = open(dir.path()).await;
    let mut text = String::from(
        "# Metrics\n\n\
         What `GET /metrics` of a server says, made from the sources by a test; \
         `UPDATE_DOCS=1 cargo test --release -p karst-server metrics` writes it again.\n\
         [telemetry.md](telemetry.md) says how to scrape it.\n\n\
         Counters count since the start of the server; gauges say how things stand now.\n\
         No label ever holds the name of a job, a frame or a worker, so the number of series has a bound.\n\n\
         | name | kind | labels | meaning |\n|---|---|---|---|\n",
    );
    for family in families(&shared).await.unwrap() {
        writeln!(text, "{}", line(&family)).unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/metrics.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == text,
        "docs/metrics.md is stale\nhint: UPDATE_DOCS=1 cargo test --release -p karst-server metrics"
    );
}
