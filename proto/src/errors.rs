//! Error details: every status carries a reason, bad requests carry field paths, all of it under 4 KiB.

use std::collections::HashMap;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

pub use crate::v1::ErrorReason;

/// The domain of every `google.rpc.ErrorInfo` that karst sends.
pub const DOMAIN: &str = "karst";

/// Most field violations in one status; the metadata `total` of the `ErrorInfo` counts all of them.
pub const MAX_VIOLATIONS: usize = 50;

/// Bytes that the violations of one status may take together; leaves room for the rest under 4 KiB.
const VIOLATION_BYTES: usize = 2600;
const MAX_FIELD_BYTES: usize = 200;
const MAX_DESCRIPTION_BYTES: usize = 400;
const MAX_MESSAGE_BYTES: usize = 800;

/// What is wrong with one field of a request or one place in a scene document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Path in the request (`job.settings.spp`) or place in the document (`scene.json:12:9: film.width`).
    pub field: String,
    /// What was found, what is allowed, what to do.
    pub description: String,
}

impl Violation {
    /// A violation of `field`.
    pub fn new(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self { field: field.into(), description: description.into() }
    }
}

/// A status with a reason.
pub fn status(code: Code, reason: ErrorReason, message: impl AsRef<str>) -> Status {
    status_with(code, reason, message, &[])
}

/// A status with a reason and metadata, such as `("committed_size", "4096")`.
pub fn status_with(
    code: Code,
    reason: ErrorReason,
    message: impl AsRef<str>,
    metadata: &[(&str, String)],
) -> Status {
    let details = info(reason, metadata);
    Status::with_error_details(code, clip(message.as_ref(), MAX_MESSAGE_BYTES), details)
}

/// `INVALID_ARGUMENT` for these violations: the first 50 that fit, and the count of all of them.
pub fn bad_request(reason: ErrorReason, violations: &[Violation]) -> Status {
    bad_request_of(reason, violations, violations.len())
}

/// Like [`bad_request`], when `total` counts more violations than are at hand.
pub fn bad_request_of(reason: ErrorReason, violations: &[Violation], total: usize) -> Status {
    let mut details = info(reason, &[("total", total.max(violations.len()).to_string())]);
    let mut bytes = 0;
    for violation in violations.iter().take(MAX_VIOLATIONS) {
        let field = clip(&violation.field, MAX_FIELD_BYTES);
        let description = clip(&violation.description, MAX_DESCRIPTION_BYTES);
        bytes += field.len() + description.len() + 8;
        if bytes > VIOLATION_BYTES {
            break;
        }
        details.add_bad_request_violation(field, description);
    }
    let message = match violations.first() {
        Some(first) if total > 1 => {
            format!("{}: {} (and {} more)", first.field, first.description, total - 1)
        }
        Some(first) => format!("{}: {}", first.field, first.description),
        None => "invalid request".to_owned(),
    };
    Status::with_error_details(Code::InvalidArgument, clip(&message, MAX_MESSAGE_BYTES), details)
}

/// `FAILED_PRECONDITION` / `BLOBS_MISSING` with the digests that must be uploaded first (the first that fit).
pub fn blobs_missing(digests: &[String]) -> Status {
    let mut details = info(ErrorReason::BlobsMissing, &[("total", digests.len().to_string())]);
    for digest in digests.iter().take(VIOLATION_BYTES / 110) {
        details.add_precondition_failure_violation("MISSING", format!("blobs/{digest}"), "upload it");
    }
    let message = format!("{} blobs are missing: upload them and submit again", digests.len());
    Status::with_error_details(Code::FailedPrecondition, message, details)
}

/// `UNAVAILABLE` / `SERVER_UNAVAILABLE`: the client may try again after `delay`.
pub fn unavailable(message: impl AsRef<str>, delay: Duration) -> Status {
    let mut details = info(ErrorReason::ServerUnavailable, &[]);
    details.set_retry_info(Some(delay));
    Status::with_error_details(Code::Unavailable, clip(message.as_ref(), MAX_MESSAGE_BYTES), details)
}

/// The reason of a status from karst; `None` when another party made it or when it is not known here.
pub fn reason(status: &Status) -> Option<ErrorReason> {
    let info = status.get_details_error_info()?;
    if info.domain == DOMAIN { ErrorReason::from_str_name(&info.reason) } else { None }
}

/// A value of the `ErrorInfo` metadata.
pub fn metadata(status: &Status, key: &str) -> Option<String> {
    status.get_details_error_info()?.metadata.remove(key)
}

/// The violations that a status lists, and the count of all of them.
pub fn violations(status: &Status) -> (Vec<Violation>, usize) {
    let listed: Vec<Violation> = status
        .get_details_bad_request()
        .map(|b| b.field_violations.into_iter().map(|v| Violation::new(v.field, v.description)).collect())
        .unwrap_or_default();
    let total = metadata(status, "total").and_then(|t| t.parse().ok()).unwrap_or(0).max(listed.len());
    (listed, total)
}

fn info(reason: ErrorReason, metadata: &[(&str, String)]) -> ErrorDetails {
    let metadata: HashMap<String, String> =
        metadata.iter().map(|(key, value)| ((*key).to_owned(), clip(value, 200))).collect();
    ErrorDetails::with_error_info(reason.as_str_name(), DOMAIN, metadata)
}

/// At most `max` bytes of `text`, cut between characters, with an ellipsis where something is left out.
fn clip(text: &str, max: usize) -> String {
    if text.len() <= max {
        return text.to_owned();
    }
    let end = text.floor_char_boundary(max - '…'.len_utf8());
    format!("{}…", &text[..end])
}

#[cfg(test)]
mod tests {
    use super::{
        ErrorReason, Violation, bad_request, blobs_missing, metadata, reason, status_with, violations,
    };
    use tonic::Code;

    fn many(count: usize, length: usize) -> Vec<Violation> {
        (0..count).map(|i| Violation::new(format!("job.field_{i}"), "ü".repeat(length))).collect()
    }

    #[test]
    fn a_reason_survives_the_trip() {
        let sent = status_with(
            Code::OutOfRange,
            ErrorReason::OffsetMismatch,
            "no",
            &[("committed_size", "7".into())],
        );
        assert_eq!(reason(&sent), Some(ErrorReason::OffsetMismatch));
        assert_eq!(metadata(&sent, "committed_size").as_deref(), Some("7"));
        assert_eq!(ErrorReason::OffsetMismatch.as_str_name(), "OFFSET_MISMATCH");
    }

    #[test]
    fn violations_stop_at_fifty_and_say_how_many_there_are() {
        let (listed, total) = violations(&bad_request(ErrorReason::FieldInvalid, &many(70, 1)));
        assert_eq!((listed.len(), total), (50, 70));
    }

    #[test]
    fn details_stay_under_4_kib() {
        for (count, length) in [(70, 1), (70, 20), (70, 5000), (3000, 300), (1, 100_000)] {
            let sent = bad_request(ErrorReason::SceneInvalid, &many(count, length));
            assert!(sent.details().len() < 4096, "{} bytes of details", sent.details().len());
            assert!(!violations(&sent).0.is_empty());
        }
        let digests = vec!["0".repeat(64); 5000];
        assert!(blobs_missing(&digests).details().len() < 4096);
    }
}
