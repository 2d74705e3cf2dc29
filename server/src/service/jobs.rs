//! Owns `karst.v1.Jobs`: submitting, watching, listing and stopping jobs.

use std::sync::Arc;
use std::time::Duration;

use karst_denoise::Denoiser;
use karst_proto::v1::jobs_server::Jobs;
use karst_proto::v1::{
    self, CancelJobRequest, GetJobRequest, JobEvent, ListJobsRequest, ListJobsResponse, SubmitJobRequest,
    WatchJobRequest,
};
use prost::Message;
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio::task::spawn_blocking;
use tonic::{Request, Response, Status};
use uuid::Uuid;

use crate::clock;
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::{Checked, Event, Shared, prepare};
use crate::job::JobRun;
use crate::model::{Frame, Job, JobState};
use crate::service::assets::missing;
use crate::service::convert;
use crate::service::outlet::{Outflow, stream};
use crate::service::watch::{revision_of, watch};
use crate::spec::{Denoise, JobSpec};
use crate::state::{StoredJob, Submission, Submitted};

/// Jobs on a page of a list: at most, and unless asked for.
const JOBS: (u32, u32) = (100, 50);

/// The service.
#[derive(Debug)]
pub struct JobsService {
    pub(crate) shared: Arc<Shared>,
    pub(crate) farm: mpsc::UnboundedSender<Event>,
    /// Scenes that are checked at the same time: each may take much memory.
    pub(crate) checking: Semaphore,
}

#[tonic::async_trait]
impl Jobs for JobsService {
    async fn submit_job(&self, request: Request<SubmitJobRequest>) -> Result<Response<v1::Job>, Status> {
        let request = request.into_inner();
        let job = self.submit(request).await?;
        Ok(Response::new(job))
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<v1::Job>, Status> {
        let job = self.shared.state.job(&request.into_inner().job).await?;
        Ok(Response::new(convert::job(&job)))
    }

    async fn list_jobs(
        &self,
        request: Request<ListJobsRequest>,
    ) -> Result<Response<ListJobsResponse>, Status> {
        Ok(Response::new(self.list(&request.into_inner()).await?))
    }

    type WatchJobStream = Outflow<JobEvent>;

    async fn watch_job(
        &self,
        request: Request<WatchJobRequest>,
    ) -> Result<Response<Self::WatchJobStream>, Status> {
        let request = request.into_inner();
        let job = self.shared.state.job(&request.job).await?;
        let from = match request.resume_token.as_str() {
            "" => None,
            token => Some(revision_of(token, &job)?),
        };
        let shared = Arc::clone(&self.shared);
        let ending = self.shared.ending.clone();
        let watch = move |outlet| async move { watch(&shared, job, from, &outlet).await };
        Ok(Response::new(stream(&ending, watch)))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Result<Response<v1::Job>, Status> {
        let job = self.cancel(&request.into_inner().job).await?;
        Ok(Response::new(convert::job(&job)))
    }
}

impl JobsService {
    async fn submit(&self, request: SubmitJobRequest) -> Result<v1::Job, Error> {
        check_request_id(&request.request_id)?;
        let spec = convert::spec(request.job.as_ref())?;
        let body = Digest::of(&request.job.unwrap_or_default().encode_to_vec());
        if !request.validate_only
            && let Some(known) = self.shared.state.known(&request.request_id, &body).await?
        {
            return Ok(convert::job(&known));
        }
        let (spec, checked) = self.check(spec).await?;
        let frames: Vec<i32> = spec.frames.iter().flat_map(crate::spec::Frames::iter).collect();
        let id = Uuid::new_v4().simple().to_string()[..12].to_owned();
        let job = Job::submitted(id, spec, frames.len() as u32, clock::now());
        if request.validate_only {
            let unspecified = v1::JobState::Unspecified.into();
            let checked = v1::Job { id: String::new(), state: unspecified, ..convert::job(&job) };
            return Ok(v1::Job { submitted_at: None, ..checked });
        }
        // In a task of its own: a caller that hangs up between the two steps must not leave a job that is stored
        // and never begun.
        let (shared, farm) = (Arc::clone(&self.shared), self.farm.clone());
        let stored = tokio::spawn(store(shared, farm, (request.request_id, body), (job, frames), checked));
        Ok(convert::job(&stored.await??))
    }

    /// Checks everything that can be wrong with a job, without storing anything.
    async fn check(&self, spec: JobSpec) -> Result<(JobSpec, Checked), Error> {
        let digests: Vec<Digest> = std::iter::once(spec.scene).chain(spec.files.values().copied()).collect();
        let missing = missing(&self.shared.blobs, &digests).await?;
        if !missing.is_empty() {
            return Err(Error::BlobsMissing(missing));
        }
        if spec.denoise != Denoise::Off {
            Denoiser::find().map_err(|e| Error::Denoiser(e.to_string()))?;
        }
        let busy = "too many scenes are being checked: try again";
        let _permit = tokio::time::timeout(Duration::from_mins(1), self.checking.acquire())
            .await
            .map_err(|_| Error::Unavailable(busy))?;
        let limits = self.shared.limits.clone();
        let mut context = prepare::load(&self.shared.blobs, &limits, spec).await?;
        let frames = prepare::frames_of(&context, &limits)?;
        context.spec.frames = Some(frames);
        let context = Arc::new(context);
        let building = Arc::clone(&context);
        let scene = spawn_blocking(move || prepare::build(&building, &limits, frames.first)).await??;
        Ok((context.spec.clone(), Checked { context, first: Arc::new(scene) }))
    }

    async fn list(&self, request: &ListJobsRequest) -> Result<ListJobsResponse, Error> {
        let size = page_size(request.page_size, JOBS)?;
        let before = match request.page_token.as_str() {
            "" => i64::MAX,
            token => token.strip_prefix("jobs-").and_then(|t| t.parse().ok()).ok_or(Error::Token)?,
        };
        let states: Result<Vec<JobState>, Error> = request
            .states()
            .map(|state| {
                convert::job_state_from_wire(state).ok_or_else(|| Error::field("states", "unknown state"))
            })
            .collect();
        let jobs = self.shared.state.jobs(&states?, before, size).await?;
        let next = if jobs.len() == size as usize { jobs.last() } else { None };
        Ok(ListJobsResponse {
            next_page_token: next.map(|(number, _)| format!("jobs-{number}")).unwrap_or_default(),
            jobs: jobs.iter().map(|(_, job)| convert::job(job)).collect(),
        })
    }

    async fn cancel(&self, id: &str) -> Result<Job, Error> {
        let job = self.shared.state.job(id).await?;
        match job.state {
            JobState::Cancelled => return Ok(job),
            JobState::Succeeded | JobState::Failed => {
                return Err(Error::JobState(format!("job {id} has ended: it is {:?}", job.state)));
            }
            JobState::Queued | JobState::Running => {}
        }
        let (answer, answered) = oneshot::channel();
        let ending = Error::Unavailable("the server is ending: try again");
        if self.farm.send(Event::Cancel(id.to_owned(), answer)).is_err() {
            return Err(ending);
        }
        match answered.await {
            Ok(Err(Error::JobState(text))) => {
                // It ended between the two looks; perhaps somebody else's cancel came first.
                let job = self.shared.state.job(id).await?;
                if job.state == JobState::Cancelled { Ok(job) } else { Err(Error::JobState(text)) }
            }
            Ok(answer) => answer,
            Err(_) => Err(ending),
        }
    }
}

/// Stores a checked job and hands it to the farm.
async fn store(
    shared: Arc<Shared>,
    farm: mpsc::UnboundedSender<Event>,
    (request_id, body): (String, Digest),
    (job, frames): (Job, Vec<i32>),
    checked: Checked,
) -> Result<Job, Error> {
    let submission = Submission { request_id: &request_id, body, job: &job, frames: &frames };
    let number = match shared.state.submit(submission).await? {
        // The same request came a second time while the first one was being checked.
        Submitted::Known(job) => return Ok(*job),
        Submitted::New(number) => number,
    };
    shared.feeds.open(&job.id, job.revision);
    let run = JobRun::new(job.clone(), frames.into_iter().map(Frame::pending));
    let stored = Box::new(StoredJob { number, run });
    if farm.send(Event::Submitted(stored, Some(Box::new(checked)))).is_err() {
        tracing::info!(job = %job.id, "stored while the server is ending: it begins after the next start");
    }
    Ok(job)
}

fn check_request_id(id: &str) -> Result<(), Error> {
    let allowed = |c: u8| c.is_ascii_alphanumeric() || c == b'-';
    if (1..=64).contains(&id.len()) && id.bytes().all(allowed) {
        return Ok(());
    }
    let found: String = id.chars().take(80).collect();
    Err(Error::field("request_id", format!("found {found:?}, expected 1 to 64 of A-Z a-z 0-9 and '-'")))
}

/// Entries on a page: 0 means the default.
pub(crate) fn page_size(asked: u32, (most, default): (u32, u32)) -> Result<u32, Error> {
    match asked {
        0 => Ok(default),
        n if n <= most => Ok(n),
        n => Err(Error::field("page_size", format!("found {n}, expected at most {most}"))),
    }
}
