//! When to try again, and how long to wait before.

use std::future::Future;
use std::time::Duration;

use karst_proto::errors::{ErrorReason, reason};
use tonic::{Code, Response, Status};

use crate::Error;

const FIRST: Duration = Duration::from_millis(100);
const LONGEST: Duration = Duration::from_secs(2);

/// Doubling waits; gives up when the waits since the last success come to more than `patience`.
#[derive(Debug)]
pub(crate) struct Backoff {
    next: Duration,
    waited: Duration,
    patience: Duration,
}

impl Backoff {
    pub(crate) fn new(patience: Duration) -> Self {
        Self { next: FIRST, waited: Duration::ZERO, patience }
    }

    /// Starts anew after a success.
    pub(crate) fn reset(&mut self) {
        *self = Self::new(self.patience);
    }

    /// The next wait, or `None` when it is time to give up.
    pub(crate) fn next(&mut self) -> Option<Duration> {
        if self.waited >= self.patience {
            return None;
        }
        let wait = self.next;
        self.waited += wait;
        self.next = (wait * 2).min(LONGEST);
        Some(wait)
    }
}

/// Whether the same call may succeed later: the server is away or said so itself, or the connection broke.
pub(crate) fn is_transient(status: &Status) -> bool {
    match reason(status) {
        Some(ErrorReason::ServerUnavailable | ErrorReason::SlowConsumer | ErrorReason::UploadBusy) => true,
        Some(_) => false,
        None => matches!(status.code(), Code::Unavailable | Code::Unknown | Code::Internal | Code::Cancelled),
    }
}

/// Repeats an idempotent call while its failures are transient, for about ten seconds.
pub(crate) async fn unary<T, F, R>(call: &'static str, mut attempt: F) -> Result<T, Error>
where
    F: FnMut() -> R,
    R: Future<Output = Result<Response<T>, Status>>,
{
    let mut backoff = Backoff::new(Duration::from_secs(10));
    loop {
        let status = match attempt().await {
            Ok(response) => return Ok(response.into_inner()),
            Err(status) => status,
        };
        match backoff.next() {
            Some(wait) if is_transient(&status) => tokio::time::sleep(wait).await,
            _ => return Err(Error::call(call, status)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Backoff, is_transient};
    use karst_proto::errors::{ErrorReason, status};
    use std::time::Duration;
    use tonic::{Code, Status};

    #[test]
    fn waits_double_up_to_a_limit_and_end() {
        let mut backoff = Backoff::new(Duration::from_secs(5));
        let waits: Vec<u128> = std::iter::from_fn(|| backoff.next()).map(|w| w.as_millis()).collect();
        assert_eq!(waits, [100, 200, 400, 800, 1600, 2000]);
        backoff.reset();
        assert_eq!(backoff.next(), Some(Duration::from_millis(100)));
    }

    #[test]
    fn only_passing_trouble_is_tried_again() {
        assert!(is_transient(&Status::unavailable("connection refused")));
        assert!(is_transient(&status(Code::ResourceExhausted, ErrorReason::SlowConsumer, "slow")));
        assert!(!is_transient(&status(Code::Internal, ErrorReason::InternalFault, "bug")));
        assert!(!is_transient(&status(Code::NotFound, ErrorReason::JobNotFound, "no")));
        assert!(!is_transient(&Status::invalid_argument("no")));
    }
}
