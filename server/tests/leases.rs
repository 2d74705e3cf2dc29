//! Workers that do not keep to the rules, played by the test: what they send is refused, decided or done again, and
//! the picture has the same bits.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use karst_core::film::{Round, SampleRange, TileGrid};
use karst_core::render::render_tile;
use karst_core::scene::{Overrides, Scene};
use karst_proto::v1::{
    self, JobState, Lease, TaskEnd, TaskReport, TileTask, UpdateWorkerSessionRequest, Verdict, WorkerState,
};
use karst_server::digest::Digest;
use support::{Client, TestServer, build_locally, hash, refusal, render_locally, request_id, scene_text};
use tonic::{Code, Status};

const TILE: u32 = 16;

/// A worker that the test leads by the hand.
struct Puppet {
    client: Client,
    name: &'static str,
    sequence: u64,
    held: Vec<u64>,
    scene: Scene,
}

impl Puppet {
    fn new(client: &Client, name: &'static str, text: &str) -> Self {
        let scene = build_locally(text, 1, &Overrides::default());
        Self { client: client.clone(), name, sequence: 0, held: Vec::new(), scene }
    }

    fn request(&mut self) -> UpdateWorkerSessionRequest {
        self.sequence += 1;
        UpdateWorkerSessionRequest {
            worker: self.name.to_owned(),
            display_name: self.name.to_owned(),
            core_build: karst_core::BUILD.to_owned(),
            threads: 1,
            state: WorkerState::Active.into(),
            sequence: self.sequence,
            held: self.held.clone(),
            ..UpdateWorkerSessionRequest::default()
        }
    }

    async fn call(
        &mut self,
        request: UpdateWorkerSessionRequest,
    ) -> Result<v1::UpdateWorkerSessionResponse, Status> {
        Ok(self.client.workers.update_worker_session(request).await?.into_inner())
    }

    /// Asks until there is work.
    async fn lease(&mut self) -> Lease {
        for _ in 0..10 {
            let request = UpdateWorkerSessionRequest { idle_threads: 1, wait: true, ..self.request() };
            if let Some(lease) = self.call(request).await.unwrap().leases.pop() {
                self.held.push(lease.fence);
                return lease;
            }
        }
        panic!("no work for {}", self.name);
    }

    fn render(&self, lease: &Lease, task: &TileTask) -> TaskReport {
        let grid = TileGrid::new(self.scene.window(), TILE);
        let mut blocks = vec![SampleRange::default(); grid.block_count() as usize];
        for (block, r) in grid.tile_blocks(task.tile).zip(task.ranges.chunks_exact(4)) {
            blocks[block as usize] = SampleRange { a: r[0]..r[1], b: r[2]..r[3] };
        }
        let round = Round { index: lease.round, blocks };
        let result = render_tile(&self.scene, &grid, task.tile, &round, &AtomicBool::new(false)).unwrap();
        report(lease.fence, task.tile, result.to_bytes())
    }

    async fn send(&mut self, report: TaskReport) -> (Verdict, String) {
        let request = UpdateWorkerSessionRequest { reports: vec![report], ..self.request() };
        let verdict = self.call(request).await.unwrap().verdicts.remove(0);
        (verdict.verdict(), verdict.message)
    }

    /// Works honestly until the job has ended.
    async fn finish(&mut self, job: &str) -> v1::Job {
        for _ in 0..10_000 {
            let job = self.client.job(job).await;
            if job.finished_at.is_some() {
                return job;
            }
            let request = UpdateWorkerSessionRequest { idle_threads: 1, ..self.request() };
            let answer = self.call(request).await.unwrap();
            self.held.retain(|fence| !answer.revoked.contains(fence));
            for lease in answer.leases {
                for task in &lease.tiles {
                    let report = self.render(&lease, task);
                    self.send(report).await;
                }
            }
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        panic!("the job does not end");
    }
}

fn report(fence: u64, tile: u32, result: Vec<u8>) -> TaskReport {
    let digest = Digest::of(&result).to_string();
    TaskReport {
        fence,
        tile,
        end: TaskEnd::Done.into(),
        result: result.into(),
        digest,
        seconds: 0.01,
        message: String::new(),
    }
}

/// A result in which one bit of one pixel is wrong.
fn lie(honest: &TaskReport) -> TaskReport {
    let mut bytes = honest.result.to_vec();
    let last = bytes.len() - 30;
    bytes[last] ^= 1;
    report(honest.fence, honest.tile, bytes)
}

struct Setup {
    server: TestServer,
    client: Client,
    job: String,
    text: String,
    dir: tempfile::TempDir,
}

/// A server without threads of its own and a job of 12 tiles.
async fn setup() -> Setup {
    let text = scene_text((64, 48), r#"{"spp": 8, "seed": 3}"#, "");
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 0).await;
    let mut client = server.client().await;
    let spec = client.spec(&text).await;
    let spec = v1::JobSpec { tile_size: TILE, ..spec };
    let job = client.submit(&request_id("puppets"), &spec).await.unwrap().id;
    Setup { server, client, job, text, dir }
}

impl Setup {
    fn puppet(&self, name: &'static str) -> Puppet {
        Puppet::new(&self.client, name, &self.text)
    }

    async fn check(mut self, job: &v1::Job) {
        assert_eq!(job.state(), JobState::Succeeded, "{job:?}");
        let local = render_locally(&self.text, 1, &Overrides::default(), 64);
        assert_eq!(hash(&self.client.collect(&self.job, 1).await.unwrap()), hash(&local));
        self.server.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn strangers_and_other_builds_are_refused_with_the_reason() {
    let s = setup().await;
    let mut puppet = s.puppet("a");
    let other = UpdateWorkerSessionRequest { core_build: "0.0.1+old".into(), ..puppet.request() };
    let status = puppet.call(other.clone()).await.unwrap_err();
    assert!(
        status.message().contains("0.0.1+old") && status.message().contains(karst_core::BUILD),
        "{status}"
    );
    assert_eq!(refusal(Err::<(), _>(status)), (Code::FailedPrecondition, "BUILD_MISMATCH".to_owned()));
    for bad in [
        UpdateWorkerSessionRequest { worker: String::new(), ..puppet.request() },
        UpdateWorkerSessionRequest { worker: "../x".into(), ..puppet.request() },
        UpdateWorkerSessionRequest { threads: 0, ..puppet.request() },
        UpdateWorkerSessionRequest { state: 99, ..puppet.request() },
        UpdateWorkerSessionRequest { held: vec![1; 300], ..puppet.request() },
    ] {
        let refused = refusal(puppet.call(bad).await);
        assert_eq!(refused, (Code::InvalidArgument, "FIELD_INVALID".to_owned()));
    }
    let old = UpdateWorkerSessionRequest { sequence: 0, ..puppet.request() };
    assert_eq!(refusal(puppet.call(old).await), (Code::Aborted, "SESSION_SUPERSEDED".to_owned()));
    let unknown = v1::GetJobSpecRequest { job: "nothing".into() };
    let refused = refusal(puppet.client.workers.get_job_spec(unknown).await);
    assert_eq!(refused, (Code::NotFound, "JOB_NOT_FOUND".to_owned()));
    let blob = v1::DownloadRequest { digest: "0".repeat(64), offset: 0 };
    let refused = refusal(puppet.client.assets.download(blob).await.map(|_| ()));
    assert_eq!(refused, (Code::NotFound, "BLOB_NOT_FOUND".to_owned()));
    let job = puppet.finish(&s.job).await;
    s.check(&job).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn results_that_do_not_fit_are_refused_and_rendered_again() {
    let s = setup().await;
    let (mut a, mut b) = (s.puppet("a"), s.puppet("b"));
    let lease = a.lease().await;
    let honest = a.render(&lease, &lease.tiles[0]);
    let (verdict, message) = b.send(honest.clone()).await;
    assert_eq!(verdict, Verdict::Refused, "the lease is another's");
    assert!(message.contains("never given"), "{message}");
    assert_eq!(
        a.send(report(lease.fence, 11, honest.result.to_vec())).await.0,
        Verdict::Refused,
        "another tile"
    );
    assert_eq!(a.send(TaskReport { fence: u64::MAX, ..honest.clone() }).await.0, Verdict::Refused);
    let cut = honest.result.slice(..honest.result.len() / 2);
    let (verdict, message) = a.send(TaskReport { result: cut.clone(), ..honest.clone() }).await;
    assert_eq!(verdict, Verdict::Refused);
    assert!(message.contains("digest"), "{message}");
    // Cut, and honest about the cut: counts as a failure at this worker, so another one gets the task.
    let lease = b.lease().await;
    let honest = b.render(&lease, &lease.tiles[0]);
    let (verdict, message) =
        b.send(report(lease.fence, lease.tiles[0].tile, honest.result[..200].to_vec())).await;
    assert_eq!(verdict, Verdict::Refused);
    assert!(message.contains("length"), "{message}");
    let job = a.finish(&s.job).await;
    s.check(&job).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_result_counts_while_its_task_is_open_and_never_twice() {
    let s = setup().await;
    let (mut a, mut b) = (s.puppet("a"), s.puppet("b"));
    let lease = a.lease().await;
    let late = a.render(&lease, &lease.tiles[0]);
    // Longer than a lease lives: the task is open to others again.
    tokio::time::sleep(support::LEASE + Duration::from_secs(1)).await;
    assert_eq!(a.send(late.clone()).await.0, Verdict::Accepted);
    assert_eq!(a.send(late.clone()).await.0, Verdict::Duplicate, "told twice");
    let job = b.finish(&s.job).await;
    assert_eq!(a.send(late).await.0, Verdict::Closed, "the round has ended");
    s.check(&job).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn workers_that_disagree_are_judged() {
    for honest_first in [true, false] {
        let s = setup().await;
        let (mut a, mut b, mut c) = (s.puppet("a"), s.puppet("b"), s.puppet("c"));
        // Two workers hold the same task: the lease of the first has expired.
        let lease = a.lease().await;
        tokio::time::sleep(support::LEASE + Duration::from_secs(1)).await;
        let same = b.lease().await;
        let tile = lease.tiles[0].tile;
        assert_eq!(same.tiles[0].tile, tile);
        let (of_a, of_b) = (a.render(&lease, &lease.tiles[0]), b.render(&same, &same.tiles[0]));
        let (first, second) = if honest_first { (of_a, lie(&of_b)) } else { (lie(&of_a), of_b) };
        assert_eq!(a.send(first).await.0, Verdict::Accepted);
        let (verdict, _) = b.send(second).await;
        assert!(matches!(verdict, Verdict::Disputed), "{verdict:?}");
        let job = c.finish(&s.job).await;
        let liar = if honest_first { &mut b } else { &mut a };
        let request = liar.request();
        let refused = refusal(liar.call(request).await);
        assert_eq!(
            refused,
            (Code::PermissionDenied, "WORKER_BLOCKED".to_owned()),
            "honest first: {honest_first}"
        );
        let kept = std::fs::read_dir(s.dir.path().join("blobs/disputes")).unwrap().count();
        assert_eq!(kept, 2, "both results");
        s.check(&job).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_poison_tile_ends_its_frame_and_nothing_else() {
    let s = setup().await;
    let (mut a, mut b) = (s.puppet("a"), s.puppet("b"));
    let failed = |lease: &Lease| TaskReport {
        fence: lease.fence,
        tile: lease.tiles[0].tile,
        end: TaskEnd::Failed.into(),
        message: "index out of bounds".into(),
        ..TaskReport::default()
    };
    // The first tile fails wherever it is tried; it is offered to the other worker first.
    for turn in 0..3 {
        let puppet = if turn == 1 { &mut b } else { &mut a };
        let lease = puppet.lease().await;
        assert_eq!(lease.tiles[0].tile, 0);
        assert_eq!(puppet.send(failed(&lease)).await.0, Verdict::Accepted);
    }
    let mut client = s.client.clone();
    let job = client.finish(&s.job).await;
    assert_eq!(job.state(), JobState::Failed);
    let error = job.error.unwrap();
    assert_eq!(error.reason(), v1::ErrorReason::TileQuarantined);
    for part in ["tile 0", "3 times at 2 worker(s)", "index out of bounds", "--crop 0,0,16,16"] {
        assert!(error.message.contains(part), "{part}: {}", error.message);
    }
    // The fleet is alive: the next job is rendered.
    let spec = client.spec(&s.text).await;
    let next = client.submit(&request_id("next"), &v1::JobSpec { tile_size: TILE, ..spec }).await.unwrap().id;
    assert_eq!(a.finish(&next).await.state(), JobState::Succeeded);
    s.server.stop().await;
}
