//! Owns `karst.v1.Workers`: what worker processes bring and take.

use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use karst_core::film::TileResult;
use karst_proto::v1::workers_server::Workers;
use karst_proto::v1::{
    self, GetJobSpecRequest, TaskEnd, TaskReport, TaskVerdict, UpdateWorkerSessionRequest,
    UpdateWorkerSessionResponse, WorkerState,
};
use tokio::sync::oneshot;
use tokio::task::spawn_blocking;
use tokio::time::{Instant, timeout};
use tonic::{Request, Response, Status};

use crate::digest::Digest;
use crate::error::Error;
use crate::farm::fleet::{Caller, Found, Lease, Refusal};
use crate::farm::ledger::{Entry, Rendered, Rows, Verdict};
use crate::farm::live::Vote;
use crate::farm::queue::Task;
use crate::farm::worker::Outlets;
use crate::farm::{Event, Shared};
use crate::past::Trouble;
use crate::service::convert;
use crate::state::Row;
use crate::telemetry::counts::Outcome;
use crate::telemetry::traces::Traces;

/// An answer is held back at most this long, and no longer than a third of the time after which a worker is lost.
const HOLD: Duration = Duration::from_secs(10);
/// How often a waiting worker looks for a slow task to copy.
const LOOK: Duration = Duration::from_secs(1);
/// Leases and reports in one request.
const MOST: usize = 256;
/// Bytes of a failure's message that are kept.
const MESSAGE: usize = 2048;

/// The service.
#[derive(Debug)]
pub struct WorkersService {
    pub(crate) shared: Arc<Shared>,
    pub(crate) outlets: Outlets,
}

#[tonic::async_trait]
impl Workers for WorkersService {
    async fn update_worker_session(
        &self,
        request: Request<UpdateWorkerSessionRequest>,
    ) -> Result<Response<UpdateWorkerSessionResponse>, Status> {
        Ok(Response::new(self.update(request.into_inner()).await?))
    }

    async fn get_job_spec(
        &self,
        request: Request<GetJobSpecRequest>,
    ) -> Result<Response<v1::JobSpec>, Status> {
        let spec = self.shared.state.spec(&request.into_inner().job).await?;
        Ok(Response::new(convert::spec_with_files(&spec)))
    }
}

impl WorkersService {
    async fn update(
        &self,
        request: UpdateWorkerSessionRequest,
    ) -> Result<UpdateWorkerSessionResponse, Error> {
        let caller = check(&request)?;
        let (fleet, live, traces) = (&self.shared.fleet, &self.shared.live, &self.shared.telemetry.traces);
        fleet.present(&caller).map_err(refused)?;
        let taken = self.take_reports(&caller.worker, request.reports).await?;
        let standing = fleet.standing(&caller, live);
        for task in standing.returned {
            let trouble = Event::Trouble(caller.worker.clone(), Box::new(task), Trouble::Interrupted);
            let _ = self.outlets.farm.send(trouble);
        }
        let mut leases = standing.missing;
        let wants = request.idle_threads > 0 && !caller.draining && leases.is_empty();
        if wants {
            // Before the results are waited for: a new lease goes into the same transaction.
            leases.extend(self.find_work(&caller.worker, request.idle_threads, false).await);
        }
        let verdicts = verdicts(taken).await?;
        // Whoever has something to hear is not kept waiting.
        if wants && request.wait && leases.is_empty() && verdicts.is_empty() && standing.revoked.is_empty() {
            leases.extend(self.find_work(&caller.worker, request.idle_threads, true).await);
        }
        Ok(UpdateWorkerSessionResponse {
            verdicts,
            leases: leases.iter().map(|lease| lease_to_wire(lease, traces)).collect(),
            revoked: standing.revoked,
            ttl_milliseconds: fleet.ttl.as_millis() as u32,
        })
    }

    async fn take_reports(
        &self,
        worker: &str,
        reports: Vec<TaskReport>,
    ) -> Result<Vec<(u64, u32, Taken)>, Error> {
        let mut taken = Vec::with_capacity(reports.len());
        for report in reports {
            let (fence, tile) = (report.fence, report.tile);
            taken.push((fence, tile, self.take_report(worker, report).await?));
        }
        Ok(taken)
    }

    async fn take_report(&self, worker: &str, report: TaskReport) -> Result<Taken, Error> {
        let task = match self.shared.fleet.find(worker, report.fence, report.tile, &self.shared.live) {
            Found::Task(task) => *task,
            Found::Later => return Ok(Taken::Later),
            Found::Closed => return Ok(Taken::Decided(v1::Verdict::Closed)),
            Found::Never => {
                self.shared.telemetry.counts.ended(Outcome::Refused);
                let text = format!(
                    "lease {} with tile {} was never given to this worker",
                    report.fence, report.tile
                );
                return Ok(Taken::Refused(text));
            }
        };
        let fence = report.fence;
        let trouble = match report.end() {
            TaskEnd::Done => {
                let seconds = report.seconds;
                match read_result(&task, report).await? {
                    Ok((result, bytes, digest)) => {
                        self.shared.fleet.done(worker, fence, &task, Some(seconds));
                        self.shared.telemetry.counts.add_seconds(seconds);
                        return self.write(worker, task, (result, bytes, digest)).await;
                    }
                    Err(text) => {
                        self.shared.telemetry.counts.ended(Outcome::Refused);
                        self.trouble(worker, fence, task, Trouble::Failed(text.clone()));
                        return Ok(Taken::Refused(text));
                    }
                }
            }
            TaskEnd::Failed => {
                let end = report.message.floor_char_boundary(MESSAGE);
                Trouble::Failed(report.message[..end].to_owned())
            }
            TaskEnd::Interrupted => Trouble::Interrupted,
            TaskEnd::Unspecified => {
                return Err(Error::field("reports.end", format!("found {}, expected a TaskEnd", report.end)));
            }
        };
        self.trouble(worker, fence, task, trouble);
        Ok(Taken::Decided(v1::Verdict::Accepted))
    }

    fn trouble(&self, worker: &str, fence: u64, task: Task, trouble: Trouble) {
        self.shared.fleet.done(worker, fence, &task, None);
        let _ = self.outlets.farm.send(Event::Trouble(worker.to_owned(), Box::new(task), trouble));
    }

    async fn write(
        &self,
        worker: &str,
        task: Task,
        (result, bytes, digest): (TileResult, Vec<u8>, Digest),
    ) -> Result<Taken, Error> {
        let (ack, acked) = oneshot::channel();
        let last = task.frame.tile_rendered(task.tile);
        let vote = Vote { worker: worker.to_owned(), digest };
        let entry = Rendered { task, result, bytes, vote, last, ack: Some(ack) };
        self.send(Entry::Rendered(Box::new(entry)))
            .await
            .ok_or(Error::Unavailable("the server is stopping"))?;
        Ok(Taken::Writing(acked))
    }

    /// New tasks for a worker, stored as its own; with `wait` it waits for them.
    async fn find_work(&self, worker: &str, idle: u32, wait: bool) -> Option<Lease> {
        let until = Instant::now() + HOLD.min(self.shared.fleet.ttl / 3);
        loop {
            let mut news = pin!(self.outlets.queue.news());
            news.as_mut().enable();
            let found = self.shared.fleet.grant(worker, idle);
            if self.outlets.queue.is_low() {
                let _ = self.outlets.farm.send(Event::QueueLow);
            }
            if let Some(lease) = found {
                return self.store(worker, lease).await;
            }
            if !wait || Instant::now() >= until || self.shared.ending.is_cancelled() {
                return None;
            }
            tokio::select! {
                _ = timeout(LOOK, news) => {}
                () = self.shared.ending.cancelled() => {}
            }
        }
    }

    /// Makes a lease durable: only then may its worker hear of it.
    async fn store(&self, worker: &str, lease: Lease) -> Option<Lease> {
        let (stored, is_stored) = oneshot::channel();
        let (shared, fence) = (Arc::clone(&self.shared), lease.fence);
        // Runs also when the worker has hung up meanwhile: then its next call brings the lease.
        let then = Box::new(move || {
            shared.fleet.stored(fence);
            let _ = stored.send(());
        });
        let changes = vec![Row::Lease(lease.row(worker)?)];
        let rows = Rows { changes, film: None, given_up: Vec::new(), then };
        self.send(Entry::Rows(Box::new(rows))).await?;
        is_stored.await.ok().map(|()| lease)
    }

    async fn send(&self, entry: Entry) -> Option<()> {
        self.outlets.ledger.upgrade()?.send(entry).await.ok()
    }
}

/// What was done with a report so far.
enum Taken {
    /// Everything.
    Decided(v1::Verdict),
    /// Its result is being stored.
    Writing(oneshot::Receiver<Verdict>),
    /// Nothing, because of this.
    Refused(String),
    /// Nothing yet.
    Later,
}

/// What became of reports; on return every accepted result is durable. A report about a task of a frame that is not
/// ready yet gets no verdict.
async fn verdicts(taken: Vec<(u64, u32, Taken)>) -> Result<Vec<TaskVerdict>, Error> {
    let mut verdicts = Vec::with_capacity(taken.len());
    for (fence, tile, taken) in taken {
        let (verdict, message) = match taken {
            Taken::Later => continue,
            Taken::Decided(verdict) => (verdict, String::new()),
            Taken::Refused(message) => {
                tracing::warn!(fence, tile, "a report was refused: {message}");
                (v1::Verdict::Refused, message)
            }
            // The ledger goes only when the server does: then the worker asks again after the restart.
            Taken::Writing(ack) => match ack.await {
                Ok(verdict) => (verdict_to_wire(verdict), String::new()),
                Err(_) => return Err(Error::Unavailable("the server is stopping")),
            },
        };
        verdicts.push(TaskVerdict { fence, tile, verdict: verdict.into(), message });
    }
    Ok(verdicts)
}

fn check(request: &UpdateWorkerSessionRequest) -> Result<Caller, Error> {
    let is_id = |c: char| c.is_ascii_alphanumeric() || c == '-';
    if request.worker.is_empty() || request.worker.len() > 64 || !request.worker.chars().all(is_id) {
        return Err(Error::field("worker", "expected 1 to 64 of the characters A-Z a-z 0-9 and '-'"));
    }
    if request.display_name.len() > 200 {
        return Err(Error::field("display_name", "expected at most 200 bytes"));
    }
    if !(1..=1024).contains(&request.threads) {
        return Err(Error::field("threads", format!("found {}, expected 1 to 1024", request.threads)));
    }
    for (name, count) in [("held", request.held.len()), ("reports", request.reports.len())] {
        if count > MOST {
            return Err(Error::field(name, format!("found {count}, expected at most {MOST}")));
        }
    }
    if request.core_build != karst_core::BUILD {
        let end = request.core_build.floor_char_boundary(100);
        let worker = request.core_build[..end].to_owned();
        return Err(Error::BuildMismatch { server: karst_core::BUILD, worker });
    }
    let draining = match request.state() {
        WorkerState::Active => false,
        WorkerState::Draining => true,
        WorkerState::Unspecified => {
            return Err(Error::field("state", format!("found {}, expected a WorkerState", request.state)));
        }
    };
    Ok(Caller {
        worker: request.worker.clone(),
        display_name: request.display_name.clone(),
        threads: request.threads,
        draining,
        sequence: request.sequence,
        held: request.held.iter().copied().collect(),
    })
}

fn refused(refusal: Refusal) -> Error {
    match refusal {
        Refusal::Superseded => Error::Superseded,
        Refusal::Blocked(reason) => Error::WorkerBlocked(reason),
    }
}

/// The result in a report, held against its digest and the plan; the inner error says what is wrong with it.
async fn read_result(
    task: &Task,
    report: TaskReport,
) -> Result<Result<(TileResult, Vec<u8>, Digest), String>, Error> {
    let (grid, round, tile) = (task.frame.grid, Arc::clone(&task.round), task.tile);
    let read = move || {
        let digest = Digest::of(&report.result);
        if report.digest != digest.to_string() {
            let length = report.result.len();
            return Err(format!(
                "the {length} bytes of the result do not have the digest that came with them"
            ));
        }
        let result = TileResult::from_bytes(&report.result, &grid, &round).map_err(|e| e.to_string())?;
        if result.tile != tile {
            return Err(format!("a result of tile {}, expected tile {tile}", result.tile));
        }
        Ok((result, report.result.to_vec(), digest))
    };
    Ok(spawn_blocking(read).await?)
}

fn verdict_to_wire(verdict: Verdict) -> v1::Verdict {
    match verdict {
        Verdict::Accepted => v1::Verdict::Accepted,
        Verdict::Duplicate => v1::Verdict::Duplicate,
        Verdict::Closed => v1::Verdict::Closed,
        Verdict::Disputed => v1::Verdict::Disputed,
    }
}

fn lease_to_wire(lease: &Lease, traces: &Traces) -> v1::Lease {
    let tile = |task: &Task| {
        let of = |block: u32| {
            let range = &task.round.blocks[block as usize];
            [range.a.start, range.a.end, range.b.start, range.b.end]
        };
        v1::TileTask {
            tile: task.tile,
            ranges: task.frame.grid.tile_blocks(task.tile).flat_map(of).collect(),
            traceparent: traces.traceparent(&task.frame.job, task.taken),
        }
    };
    let first = lease.tasks.first();
    v1::Lease {
        fence: lease.fence,
        job: first.map(|t| t.frame.job.to_string()).unwrap_or_default(),
        frame: first.map(|t| t.frame.frame).unwrap_or_default(),
        round: first.map(|t| t.round.index).unwrap_or_default(),
        tiles: lease.tasks.iter().map(tile).collect(),
    }
}
