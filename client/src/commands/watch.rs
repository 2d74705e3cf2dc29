//! `karst watch`: follows a job until it is final; reconnects by itself.

use karst_client::Error;

use crate::args::WatchArgs;
use crate::commands::follow::{follow, outcome};
use crate::talk::Talk;

pub(super) async fn run(args: WatchArgs, talk: Talk) -> Result<(), Error> {
    let client = args.server.connect().await?;
    outcome(&follow(&client, &args.job, args.resume, talk).await?, talk)
}
