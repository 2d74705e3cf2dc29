//! Slurm's own programs: how they are called, and what is said when they are not there or say no.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;
use std::process::{Command, Stdio};

use karst_client::Error;
use tempfile::NamedTempFile;

/// One frame per array task.
pub(super) const FRAMES: &str = include_str!("../../../../slurm/frames.sbatch");
/// A worker per array task.
pub(super) const WORKERS: &str = include_str!("../../../../slurm/workers.sbatch");

/// Slurm's default of `MaxArraySize`: one more than the largest index.
const USUAL_ARRAY: i64 = 1001;

/// Runs a program to its end; returns what it printed.
///
/// # Errors
/// It is not there, or it failed: what it said.
pub(super) fn call<S: AsRef<OsStr>>(program: &str, line: &[S]) -> Result<String, Error> {
    let mut command = Command::new(program);
    // Else squeue abbreviates long arrays.
    command.args(line).env("SLURM_BITSTR_LEN", "0").stdin(Stdio::null());
    let output = command.output().map_err(|error| {
        let remedy = if error.kind() == ErrorKind::NotFound {
            ": run this where Slurm's commands are, usually a login node of the cluster (perhaps after `module load \
             slurm`)"
        } else {
            ""
        };
        Error::Failed(format!("{program}: {error}{remedy}"))
    })?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    if output.status.success() {
        return Ok(text(&output.stdout));
    }
    Err(Error::Failed(format!("{program} ended with {}: {}", output.status, text(&output.stderr))))
}

/// Submits a script; returns the job's id. Options of the caller come first, so that those of the users count, and
/// `fixed` last, so that they always count.
///
/// # Errors
/// Those of [`call`]; the script cannot be written to a file for sbatch.
pub(super) fn submit(
    script: &str,
    defaults: Vec<OsString>,
    users: &[OsString],
    fixed: Vec<OsString>,
    arguments: Vec<OsString>,
) -> Result<String, Error> {
    let failed = |source| Error::file(std::env::temp_dir(), source);
    // sbatch copies it before it returns.
    let mut file = NamedTempFile::with_prefix("karst-").map_err(failed)?;
    file.write_all(script.as_bytes()).map_err(failed)?;
    let mut line: Vec<OsString> = vec!["--parsable".into()];
    line.extend(defaults);
    line.extend_from_slice(users);
    line.extend(fixed);
    line.push(file.path().into());
    line.extend(arguments);
    let said = call("sbatch", &line)?;
    // `id` or `id;cluster`
    let id = said.split(';').next().unwrap_or_default().trim();
    if id.is_empty() || !id.chars().all(|digit| digit.is_ascii_digit()) {
        return Err(Error::Failed(format!("sbatch --parsable: expected the id of a job, found {said:?}")));
    }
    Ok(id.to_owned())
}

/// One more than the largest index that an array of this cluster may have.
pub(super) fn array_limit() -> Result<i64, Error> {
    let said = call("scontrol", &["show", "config"])?;
    let found = said.lines().find_map(|line| line.trim().strip_prefix("MaxArraySize"));
    let number = found.and_then(|rest| rest.trim().strip_prefix('=')?.trim().parse().ok());
    Ok(number.filter(|limit| *limit > 0).unwrap_or(USUAL_ARRAY))
}

/// The folder of this program, where the nodes find the others too.
///
/// # Errors
/// The system does not tell.
pub(super) fn programs() -> Result<PathBuf, Error> {
    let own = std::env::current_exe();
    let own =
        own.map_err(|error| Error::Failed(format!("cannot find the folder of this program: {error}")))?;
    Ok(own.parent().map_or_else(|| PathBuf::from("."), PathBuf::from))
}
