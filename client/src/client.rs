//! The connection to a server and its simple calls.

use std::path::Path;

use karst_proto::MAX_MESSAGE_BYTES;
use karst_proto::connect::{Bearer, Line, endpoint};
use karst_proto::v1::assets_client::AssetsClient;
use karst_proto::v1::frames_client::FramesClient;
use karst_proto::v1::jobs_client::JobsClient;
use karst_proto::v1::previews_client::PreviewsClient;
use karst_proto::v1::{
    CancelJobRequest, Frame, GetJobRequest, Job, JobState, ListFramesRequest, ListJobsRequest,
    SubmitJobRequest,
};
use tonic::service::interceptor::InterceptedService;
use tonic::{Code, Status};

use crate::Error;
use crate::retry::unary;

/// A connection to a karst server; cheap to clone, reconnects by itself.
#[derive(Clone, Debug)]
pub struct Client {
    line: Line,
}

impl Client {
    /// Connects to `server`, such as `http://127.0.0.1:7878`; `ca_file` is for `https`, see
    /// [`karst_proto::connect::endpoint`]; every call carries the token of `bearer`, see
    /// [`karst_proto::connect::bearer`].
    ///
    /// # Errors
    /// The address is malformed or nobody answers within 5 s.
    pub async fn connect(server: &str, ca_file: Option<&Path>, bearer: Bearer) -> Result<Self, Error> {
        let endpoint = endpoint(server, ca_file).map_err(|e| Error::Usage(e.to_string()))?;
        let channel = endpoint
            .connect()
            .await
            .map_err(|error| Error::Connect { server: server.to_owned(), cause: root_cause(&error) })?;
        Ok(Self { line: InterceptedService::new(channel, bearer) })
    }

    pub(crate) fn assets(&self) -> AssetsClient<Line> {
        AssetsClient::new(self.line.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(crate) fn job_calls(&self) -> JobsClient<Line> {
        JobsClient::new(self.line.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(crate) fn frame_calls(&self) -> FramesClient<Line> {
        FramesClient::new(self.line.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    pub(crate) fn preview_calls(&self) -> PreviewsClient<Line> {
        PreviewsClient::new(self.line.clone()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// Submits a job; repeated by itself when the server is away, which the request's `request_id` makes safe.
    ///
    /// # Errors
    /// As `Jobs.SubmitJob`.
    pub async fn submit(&self, request: SubmitJobRequest) -> Result<Job, Error> {
        unary("submit", || {
            let (mut jobs, request) = (self.job_calls(), request.clone());
            async move { jobs.submit_job(request).await }
        })
        .await
    }

    /// The job as it is now.
    ///
    /// # Errors
    /// As `Jobs.GetJob`.
    pub async fn job(&self, id: &str) -> Result<Job, Error> {
        unary("job", || {
            let (mut jobs, job) = (self.job_calls(), id.to_owned());
            async move { jobs.get_job(GetJobRequest { job }).await }
        })
        .await
    }

    /// The newest `limit` jobs in any of `states` (empty: all), the newest first.
    ///
    /// # Errors
    /// As `Jobs.ListJobs`.
    pub async fn jobs(&self, states: &[JobState], limit: usize) -> Result<Vec<Job>, Error> {
        let mut found: Vec<Job> = Vec::new();
        let mut page_token = String::new();
        while found.len() < limit {
            let request = ListJobsRequest {
                page_size: (limit - found.len()).min(100) as u32,
                page_token,
                states: states.iter().map(|state| i32::from(*state)).collect(),
            };
            let page = unary("jobs", || {
                let (mut jobs, request) = (self.job_calls(), request.clone());
                async move { jobs.list_jobs(request).await }
            })
            .await?;
            found.extend(page.jobs);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                break;
            }
        }
        found.truncate(limit);
        Ok(found)
    }

    /// Stops a job.
    ///
    /// # Errors
    /// As `Jobs.CancelJob`.
    pub async fn cancel(&self, id: &str) -> Result<Job, Error> {
        unary("cancel", || {
            let (mut jobs, job) = (self.job_calls(), id.to_owned());
            async move { jobs.cancel_job(CancelJobRequest { job }).await }
        })
        .await
    }

    /// All frames of a job.
    ///
    /// # Errors
    /// As `Frames.ListFrames`.
    pub async fn frames(&self, id: &str) -> Result<Vec<Frame>, Error> {
        let mut found = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = ListFramesRequest { job: id.to_owned(), page_size: 0, page_token };
            let page = unary("frames", || {
                let (mut frames, request) = (self.frame_calls(), request.clone());
                async move { frames.list_frames(request).await }
            })
            .await?;
            found.extend(page.frames);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(found);
            }
        }
    }
}

/// A status for a stream that ended before it should have.
pub(crate) fn broken_off() -> Status {
    Status::new(Code::Unavailable, "the stream broke off")
}

fn root_cause(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string().to_lowercase()
}
