//! Owns the wall clock, so that every other file takes times as values.

use crate::model::Time;

/// Microseconds since 1970.
#[expect(clippy::disallowed_methods, reason = "the one place that reads the wall clock; pixels never see it")]
pub(crate) fn now() -> Time {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |d| i64::try_from(d.as_micros()).unwrap_or(i64::MAX))
}
