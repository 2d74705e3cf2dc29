//! What can go wrong in the client: the message, the hint and the exit code that belong to it.

use std::fmt::Write as _;
use std::io;
use std::path::PathBuf;

use karst_proto::errors::{ErrorReason, reason, violations};
use tonic::{Code, Status};

/// A failed command or call.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The caller asked for something that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// The scene document or one of its assets is wrong.
    #[error("{0}")]
    Scene(String),
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// No server answers at this address.
    #[error("cannot reach {server}: {cause}")]
    Connect {
        /// The address.
        server: String,
        /// Why.
        cause: String,
    },
    /// No tev answers at this address.
    #[error("cannot reach tev at {address}: {cause}")]
    Viewer {
        /// The address.
        address: String,
        /// Why.
        cause: String,
    },
    /// The server refused a call, or it broke off for good.
    #[error("{call}: {}", describe_status(status))]
    Call {
        /// Name of the call.
        call: &'static str,
        /// What the server said.
        status: Box<Status>,
    },
    /// What was asked for did not succeed.
    #[error("{0}")]
    Failed(String),
}

impl Error {
    /// A [`Error::File`].
    pub fn file(path: impl Into<PathBuf>, source: io::Error) -> Self {
        Self::File { path: path.into(), source }
    }

    /// A [`Error::Call`].
    pub fn call(call: &'static str, status: Status) -> Self {
        Self::Call { call, status: Box::new(status) }
    }

    /// The reason that the server gave, if it was the server.
    pub fn reason(&self) -> Option<ErrorReason> {
        match self {
            Self::Call { status, .. } => reason(status),
            Self::Usage(_)
            | Self::Scene(_)
            | Self::File { .. }
            | Self::Connect { .. }
            | Self::Viewer { .. }
            | Self::Failed(_) => None,
        }
    }

    /// What the user may do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Connect { .. } => {
                Some("start a server with `karst-server serve`, or name one with --server or KARST_SERVER")
            }
            Self::Viewer { .. } => Some(
                "start tev first; `tev --hostname=HOST:PORT` lets it listen at another address than its own",
            ),
            Self::Call { status, .. } => call_hint(status),
            Self::Usage(_) | Self::Scene(_) | Self::File { .. } | Self::Failed(_) => None,
        }
    }

    /// Exit code of the process: 2 for bad input, 1 for every other failure.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Scene(_) => 2,
            Self::Call { status, .. } if status.code() == Code::InvalidArgument => 2,
            Self::File { .. }
            | Self::Connect { .. }
            | Self::Viewer { .. }
            | Self::Call { .. }
            | Self::Failed(_) => 1,
        }
    }
}

/// What helps against some of the reasons.
const HINTS: [(ErrorReason, &str); 5] = [
    (ErrorReason::JobNotFound, "`karst jobs` lists the jobs of this server"),
    (ErrorReason::FrameNotFinished, "`karst watch JOB` waits for it"),
    (ErrorReason::DenoiserUnavailable, "submit with `--denoise off`"),
    (ErrorReason::DigestMismatch, "a file changed while it was uploaded: submit again"),
    (ErrorReason::StorageFull, "free space in the server's data folder"),
];

fn call_hint(status: &Status) -> Option<&'static str> {
    let why = reason(status)?;
    HINTS.iter().find(|(known, _)| *known == why).map(|(_, hint)| *hint)
}

fn describe_status(status: &Status) -> String {
    let (listed, total) = violations(status);
    if listed.len() < 2 {
        return if status.message().is_empty() {
            status.code().description().to_lowercase()
        } else {
            status.message().to_owned()
        };
    }
    let mut text = format!("{total} problems");
    for violation in &listed {
        let _ = write!(text, "\n{}: {}", violation.field, violation.description);
    }
    if total > listed.len() {
        let _ = write!(text, "\n… and {} more", total - listed.len());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::Error;
    use karst_proto::errors::{ErrorReason, Violation, bad_request, status};
    use tonic::{Code, Status};

    #[test]
    fn a_refusal_lists_every_field() {
        let violations =
            [Violation::new("job.settings.spp", "found 0"), Violation::new("job.tile_size", "found 7")];
        let error = Error::call("submit", bad_request(ErrorReason::FieldInvalid, &violations));
        assert_eq!(
            error.to_string(),
            "submit: 2 problems\njob.settings.spp: found 0\njob.tile_size: found 7"
        );
        assert_eq!(error.exit_code(), 2);
    }

    #[test]
    fn an_unknown_job_has_a_hint() {
        let error = Error::call("watch", status(Code::NotFound, ErrorReason::JobNotFound, "no job \"x\""));
        assert_eq!(error.to_string(), "watch: no job \"x\"");
        assert_eq!(error.hint(), Some("`karst jobs` lists the jobs of this server"));
        assert_eq!(error.exit_code(), 1);
    }

    #[test]
    fn a_status_without_text_still_says_something() {
        assert!(Error::call("watch", Status::new(Code::Internal, "")).to_string().len() > 10);
    }
}
