//! `karst jobs`: lists jobs.

use karst_client::Error;
use karst_proto::v1::{Job, JobState};

use crate::args::{JobsArgs, StateArg};
use crate::talk::Talk;
use crate::wire_json::{job_json, job_state_name};

pub(super) async fn run(args: JobsArgs, talk: Talk) -> Result<(), Error> {
    let client = args.server.connect().await?;
    let states: Vec<JobState> = args.state.into_iter().map(job_state).collect();
    let jobs = client.jobs(&states, args.limit).await?;
    if jobs.is_empty() {
        talk.say(&"no jobs");
    }
    for job in &jobs {
        talk.result(&line(job), &job_json(job));
    }
    Ok(())
}

fn line(job: &Job) -> String {
    let name = job.spec.as_ref().map_or("", |spec| spec.display_name.as_str());
    let frames = format!("{}/{}", job.frames_finished, job.frames_total);
    format!("{:<36}  {:<9}  {frames:>9} frames  {name}", job.id, job_state_name(job.state()))
}

fn job_state(state: StateArg) -> JobState {
    match state {
        StateArg::Queued => JobState::Queued,
        StateArg::Running => JobState::Running,
        StateArg::Succeeded => JobState::Succeeded,
        StateArg::Failed => JobState::Failed,
        StateArg::Cancelled => JobState::Cancelled,
    }
}
