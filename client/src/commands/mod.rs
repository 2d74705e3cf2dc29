//! One file per sub-command; here only the dispatch.

mod cancel;
mod check;
mod compare;
mod convert;
mod fetch;
mod follow;
mod jobs;
mod marched;
mod page;
mod pictures;
mod render;
mod slurm;
mod submit;
mod view;
mod watch;

use std::future::Future;

use karst_client::Error;

use crate::args::Command;
use crate::talk::Talk;

/// Runs a sub-command to its end.
pub(crate) fn run(command: Command, talk: Talk) -> Result<(), Error> {
    match command {
        Command::Render(args) => render::run(&args, talk),
        Command::Check(args) => check::run(&args, talk),
        Command::Convert(args) => convert::run(&args, talk),
        Command::Compare(args) => compare::run(&args, talk),
        Command::Submit(args) => block_on(submit::run(args, talk)),
        Command::Watch(args) => block_on(watch::run(args, talk)),
        Command::View(args) => block_on(view::run(args, talk)),
        Command::Page(args) => block_on(page::run(args, talk)),
        Command::Fetch(args) => block_on(fetch::run(args, talk)),
        Command::Jobs(args) => block_on(jobs::run(args, talk)),
        Command::Cancel(args) => block_on(cancel::run(args, talk)),
        Command::Slurm(command) => slurm::run(command, talk),
    }
}

fn block_on(command: impl Future<Output = Result<(), Error>>) -> Result<(), Error> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    match runtime {
        Ok(runtime) => runtime.block_on(command),
        Err(error) => Err(Error::Failed(format!("cannot start the network runtime: {error}"))),
    }
}
