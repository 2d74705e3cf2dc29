//! `karst cancel`: stops a job.

use karst_client::Error;

use crate::args::CancelArgs;
use crate::talk::Talk;
use crate::wire_json::job_json;

pub(super) async fn run(args: CancelArgs, talk: Talk) -> Result<(), Error> {
    let client = args.server.connect().await?;
    let job = client.cancel(&args.job).await?;
    talk.result(&format_args!("{} is cancelled", job.id), &job_json(&job));
    Ok(())
}
