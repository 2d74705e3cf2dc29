//! Owns every way in which a call can fail, by cause, and the one mapping to gRPC statuses.

use std::io;
use std::time::Duration;

use karst_proto::errors::{self, ErrorReason, Violation};
use tonic::{Code, Status};

use crate::digest::Digest;

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Fields of the request are wrong.
    #[error("invalid request: {0:?}")]
    Fields(Vec<Violation>),
    /// The scene document or one of its files is wrong: the first problems, and how many there are.
    #[error("invalid scene: {0:?}, {1} problems in all")]
    Scene(Vec<Violation>, usize),
    /// Well-formed, but more than this server takes.
    #[error("{}: {}", .0.field, .0.description)]
    Limit(Violation),
    /// The same request id came before with another body.
    #[error("request_id {0:?} was used before with another body: choose a new one")]
    RequestIdReused(String),
    /// The job refers to blobs that were not uploaded.
    #[error("{} blobs are missing", .0.len())]
    BlobsMissing(Vec<Digest>),
    /// The uploaded bytes have another digest.
    #[error("expected bytes with SHA-256 {expected}, found {found}: upload them again from offset 0")]
    DigestMismatch {
        /// What was announced.
        expected: Digest,
        /// What came.
        found: Digest,
    },
    /// An upload or download does not go on where it stopped.
    #[error("offset {found} does not fit: expected {expected}")]
    Offset {
        /// Where the client wants to begin.
        found: u64,
        /// Where it may (an upload), or the last place where it may (a download).
        expected: u64,
    },
    /// Another stream is uploading the same digest.
    #[error("another stream is uploading {0}: wait for it, or try again when it broke off")]
    UploadBusy(Digest),
    /// The upload stream sent nothing for too long.
    #[error("nothing came for {0} s: query the upload and go on where it stopped")]
    UploadIdle(u64),
    /// No such job.
    #[error("job {0:?} is not known here")]
    JobNotFound(String),
    /// No such frame.
    #[error("job {0} has no frame {1}")]
    FrameNotFound(String, i32),
    /// The frame is still being rendered.
    #[error("frame {0} is not finished yet: wait for it with WatchJob")]
    FrameNotFinished(i32),
    /// The frame was finished without this file.
    #[error("frame {0} has no such file: the job did not ask for denoising, or the denoiser failed")]
    FormatNotAvailable(i32),
    /// The job's state does not allow the call.
    #[error("{0}")]
    JobState(String),
    /// The job was cancelled before what was waited for.
    #[error("job {0} was cancelled")]
    JobCancelled(String),
    /// Not a token of this call.
    #[error("the token is not from this call: leave it out")]
    Token,
    /// Denoising was asked for and cannot be done here.
    #[error("{0}")]
    Denoiser(String),
    /// The reader took nothing for too long.
    #[error("nothing was read for 30 s: connect again with the last resume token")]
    SlowConsumer,
    /// Stored bytes are not what they were.
    #[error("the stored bytes of {0} no longer match their digest: upload or render them again")]
    Corrupt(Digest),
    /// A blob that must be there is not.
    #[error("blob {0} is gone from the data folder")]
    Gone(Digest),
    /// No blob with this digest.
    #[error("no blob {0} here: upload it first")]
    BlobNotFound(Digest),
    /// A worker was built from another core.
    #[error(
        "this server takes results of core {server}, found {worker}: start the worker from the same build"
    )]
    BuildMismatch {
        /// The build of this server's core.
        server: &'static str,
        /// The build of the worker's.
        worker: String,
    },
    /// A worker's newer request was answered already.
    #[error("a newer request of this worker was answered already")]
    Superseded,
    /// A worker's results were wrong.
    #[error("this worker gets no work: {0}; check its machine, then start it anew")]
    WorkerBlocked(String),
    /// A call without a token.
    #[error(
        "a token is needed: on the server's machine and account it is found by itself, elsewhere name its file \
             with --token-file or KARST_TOKEN_FILE"
    )]
    NoToken,
    /// A token that nobody was given, or that was taken back.
    #[error("this token is not known here: ask whoever runs the server for a new one")]
    TokenUnknown,
    /// A token whose role does not allow the call.
    #[error("{path}: token {name:?} has the role {role}, expected {needs}")]
    Role {
        /// Whose token.
        name: String,
        /// Its role.
        role: String,
        /// The roles that may.
        needs: String,
        /// The call.
        path: String,
    },
    /// The server is about to end, or has too much to do.
    #[error("{0}")]
    Unavailable(&'static str),
    /// The disk said no.
    #[error("storage: {0}")]
    Storage(#[from] io::Error),
    /// The database said no.
    #[error("database: {0}")]
    Database(String),
    /// A fault in karst.
    #[error("internal fault: {0}")]
    Internal(String),
}

impl Error {
    /// One field of the request is wrong.
    pub fn field(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Fields(vec![Violation::new(field, description)])
    }

    /// More than this server takes.
    pub fn limit(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Limit(Violation::new(field, description))
    }

    fn is_full(&self) -> bool {
        if let Self::Storage(e) = self {
            return matches!(e.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded);
        }
        matches!(self, Self::Database(text) if text.contains("database or disk is full"))
    }
}

impl From<sqlx::Error> for Error {
    fn from(error: sqlx::Error) -> Self {
        Self::Database(error.to_string())
    }
}

impl From<object_store::Error> for Error {
    fn from(error: object_store::Error) -> Self {
        // The causes are nested boxes; the innermost io::Error decides whether the disk is full.
        let mut source = std::error::Error::source(&error);
        while let Some(inner) = source {
            if let Some(e) = inner.downcast_ref::<io::Error>() {
                return Self::Storage(io::Error::new(e.kind(), error.to_string()));
            }
            source = inner.source();
        }
        Self::Storage(io::Error::other(error.to_string()))
    }
}

impl From<tokio::task::JoinError> for Error {
    fn from(error: tokio::task::JoinError) -> Self {
        Self::Internal(format!("a task did not end well: {error}"))
    }
}

impl From<Error> for Status {
    fn from(error: Error) -> Self {
        if error.is_full() {
            let message = format!("the disk is full: {error}");
            return errors::status(Code::ResourceExhausted, ErrorReason::StorageFull, message);
        }
        let text = error.to_string();
        let plain = |code, reason| errors::status(code, reason, &text);
        match &error {
            Error::Fields(violations) => errors::bad_request(ErrorReason::FieldInvalid, violations),
            Error::Scene(violations, total) => {
                errors::bad_request_of(ErrorReason::SceneInvalid, violations, *total)
            }
            Error::Limit(violation) => {
                errors::bad_request(ErrorReason::LimitExceeded, std::slice::from_ref(violation))
            }
            Error::RequestIdReused(_) => plain(Code::InvalidArgument, ErrorReason::RequestIdReused),
            Error::BlobsMissing(digests) => {
                errors::blobs_missing(&digests.iter().map(Digest::to_string).collect::<Vec<_>>())
            }
            Error::DigestMismatch { .. } => plain(Code::InvalidArgument, ErrorReason::DigestMismatch),
            Error::Offset { expected, .. } => errors::status_with(
                Code::OutOfRange,
                ErrorReason::OffsetMismatch,
                &text,
                &[("committed_size", expected.to_string())],
            ),
            Error::UploadBusy(_) | Error::UploadIdle(_) => plain(Code::Aborted, ErrorReason::UploadBusy),
            Error::JobNotFound(_) => plain(Code::NotFound, ErrorReason::JobNotFound),
            Error::FrameNotFound(..) => plain(Code::NotFound, ErrorReason::FrameNotFound),
            Error::FrameNotFinished(_) => plain(Code::FailedPrecondition, ErrorReason::FrameNotFinished),
            Error::FormatNotAvailable(_) => plain(Code::NotFound, ErrorReason::FormatNotAvailable),
            Error::JobState(_) => plain(Code::FailedPrecondition, ErrorReason::JobStateConflict),
            Error::JobCancelled(_) => plain(Code::Cancelled, ErrorReason::JobCancelled),
            Error::Token => plain(Code::InvalidArgument, ErrorReason::TokenInvalid),
            Error::Denoiser(_) => plain(Code::FailedPrecondition, ErrorReason::DenoiserUnavailable),
            Error::SlowConsumer => plain(Code::ResourceExhausted, ErrorReason::SlowConsumer),
            Error::Corrupt(_) | Error::Gone(_) => plain(Code::DataLoss, ErrorReason::BlobCorrupt),
            Error::BlobNotFound(_) => plain(Code::NotFound, ErrorReason::BlobNotFound),
            Error::BuildMismatch { server, worker } => errors::status_with(
                Code::FailedPrecondition,
                ErrorReason::BuildMismatch,
                &text,
                &[("server_build", (*server).to_owned()), ("worker_build", worker.clone())],
            ),
            Error::Superseded => plain(Code::Aborted, ErrorReason::SessionSuperseded),
            Error::WorkerBlocked(_) => plain(Code::PermissionDenied, ErrorReason::WorkerBlocked),
            Error::NoToken | Error::TokenUnknown => plain(Code::Unauthenticated, ErrorReason::TokenRefused),
            Error::Role { needs, .. } => errors::status_with(
                Code::PermissionDenied,
                ErrorReason::RoleInsufficient,
                &text,
                &[("needs", needs.clone())],
            ),
            Error::Unavailable(_) => errors::unavailable(&text, Duration::from_secs(2)),
            Error::Storage(_) | Error::Database(_) | Error::Internal(_) => {
                tracing::error!("{text}");
                plain(Code::Internal, ErrorReason::InternalFault)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Error;
    use karst_proto::errors::{ErrorReason, reason};
    use std::io;
    use tonic::{Code, Status};

    #[test]
    fn a_full_disk_is_the_only_storage_error_a_client_can_wait_out() {
        let full = Status::from(Error::Storage(io::Error::from(io::ErrorKind::StorageFull)));
        assert_eq!((full.code(), reason(&full)), (Code::ResourceExhausted, Some(ErrorReason::StorageFull)));
        let other = Status::from(Error::Storage(io::Error::from(io::ErrorKind::PermissionDenied)));
        assert_eq!((other.code(), reason(&other)), (Code::Internal, Some(ErrorReason::InternalFault)));
    }

    #[test]
    fn a_huge_message_stays_small() {
        let status = Status::from(Error::Internal("x".repeat(20_000)));
        assert!(status.message().len() < 1000 && status.details().len() < 4096);
    }
}
