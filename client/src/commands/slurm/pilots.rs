//! `karst slurm up`, `status` and `down`: workers of a server as an array of pilot jobs.
//!
//! Which jobs belong to which server is written in their names and comments, so that Slurm is asked and no file of
//! ours can be wrong about it.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::Path;

use karst_client::{Bearer, Error};
use serde_json::json;

use super::queue::{Tasks, running_and_waiting, states, tasks};
use super::ranges::{chunks, compress};
use super::tools;
use crate::args::{PilotsArgs, ServerArgs, UpArgs};
use crate::talk::Talk;

/// Name of the jobs.
const NAME: &str = "karst-workers";

/// Comment of the jobs of one server.
fn comment(server: &str) -> String {
    format!("karst server={}", server.trim_end_matches('/'))
}

pub(super) fn up(args: &UpArgs, talk: Talk) -> Result<(), Error> {
    let limit = tools::array_limit()?;
    let server = args.server.server.trim_end_matches('/');
    let arguments = arguments(&args.server)?;
    if ["127.", "localhost", "[::1]"].iter().any(|here| server.contains(&format!("//{here}"))) {
        talk.say(&format_args!(
            "note: {server} means each node itself: workers on other nodes than the server's will not find it"
        ));
    }
    let indexes: Vec<i64> = (0..i64::from(args.workers)).collect();
    for chunk in chunks(&indexes, limit) {
        let array = compress(&chunk.indexes);
        let fixed = [
            format!("--job-name={NAME}"),
            format!("--comment={}", comment(server)),
            format!("--array={array}"),
        ];
        let fixed = fixed.into_iter().map(OsString::from).collect();
        let job = tools::submit(tools::WORKERS, Vec::new(), &args.sbatch.options, fixed, arguments.clone())?;
        let workers = chunk.indexes.len();
        talk.say(&format_args!("submitted job {job}: {workers} workers for {server}"));
        talk.result(&job, &json!({"event": "submitted", "job": job, "workers": workers, "server": server}));
    }
    Ok(())
}

/// What the script gets: programs, server, and the files that prove who is who.
fn arguments(server: &ServerArgs) -> Result<Vec<OsString>, Error> {
    let mut line: Vec<OsString> = vec!["--bin".into(), tools::programs()?.into()];
    line.extend(["--server".into(), server.server.trim_end_matches('/').into()]);
    if let Some(path) = &server.token_file {
        Bearer::read(path).map_err(|error| Error::Usage(error.to_string()))?;
        line.extend(["--token-file".into(), absolute(path)?]);
    }
    if let Some(path) = &server.ca_file {
        std::fs::metadata(path).map_err(|source| Error::file(path, source))?;
        line.extend(["--ca-file".into(), absolute(path)?]);
    }
    Ok(line)
}

fn absolute(path: &Path) -> Result<OsString, Error> {
    std::path::absolute(path).map(Into::into).map_err(|source| Error::file(path, source))
}

pub(super) fn status(args: &PilotsArgs, talk: Talk) -> Result<(), Error> {
    let server = args.server.trim_end_matches('/');
    let mut tasks = tasks(NAME, &comment(server))?;
    tasks.retain(|tasks| tasks.are_alive() || tasks.are_failed());
    let (workers, waiting) = running_and_waiting(&tasks);
    let mut text: Vec<String> = tasks.iter().map(line).collect();
    text.push(format!("{workers} workers run for {server}, {waiting} wait"));
    let json = json!({
        "server": server,
        "workers": workers,
        "waiting": waiting,
        "states": states(&tasks),
        "tasks": tasks,
    });
    talk.result(&text.join("\n"), &json);
    Ok(())
}

fn line(tasks: &Tasks) -> String {
    let Tasks { job, index, state, reason, node, restarts, count: _ } = tasks;
    let place = if node.is_empty() { format!("({reason})") } else { node.clone() };
    let name = format!("{job}_{index}");
    format!("{name:<16}  {state:<10}  {place:<16}  {restarts} restarts")
}

pub(super) fn down(args: &PilotsArgs, talk: Talk) -> Result<(), Error> {
    let server = args.server.trim_end_matches('/');
    let tasks = tasks(NAME, &comment(server))?;
    let (workers, waiting) = running_and_waiting(&tasks);
    let jobs: BTreeSet<u64> = tasks.iter().filter(|tasks| tasks.are_alive()).map(|tasks| tasks.job).collect();
    if !jobs.is_empty() {
        let jobs: Vec<String> = jobs.iter().map(u64::to_string).collect();
        // Those that wait first, so that none begins in the place of one that ends.
        cancel(&["--quiet", "--state=PENDING"], &jobs)?;
        cancel(&["--quiet", "--batch", "--signal=TERM"], &jobs)?;
    }
    let text = format!("{workers} workers hand back what they hold and end, {waiting} are cancelled");
    talk.result(
        &text,
        &json!({"event": "down", "server": server, "ending": workers, "cancelled": waiting, "jobs": jobs}),
    );
    Ok(())
}

fn cancel(options: &[&str], jobs: &[String]) -> Result<(), Error> {
    let jobs = jobs.iter().map(String::as_str);
    tools::call("scancel", &options.iter().copied().chain(jobs).collect::<Vec<_>>()).map(drop)
}
