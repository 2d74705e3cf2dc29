//! Owns what karst tells about itself besides its answers: log lines, spans for a collector, counts for a scrape.
//!
//! Nothing in here waits: a collector that is away, slow or full costs spans, never time.

pub(crate) mod calls;
pub(crate) mod counts;
mod export;
pub mod log;
pub(crate) mod traces;

use crate::config::Collector;
use crate::error::Error;
use crate::telemetry::counts::Counts;
use crate::telemetry::traces::Traces;

/// What the parts of a server report to.
#[derive(Debug)]
pub(crate) struct Telemetry {
    /// Spans.
    pub traces: Traces,
    /// Counts since the start.
    pub counts: Counts,
}

impl Telemetry {
    /// Counts from zero; spans go to `collector`, if there is one. Must be called inside a runtime.
    ///
    /// # Errors
    /// The collector's address is malformed.
    pub(crate) fn start(collector: &Collector) -> Result<Self, Error> {
        let instance = uuid::Uuid::new_v4().to_string();
        let traces = Traces::start(collector, "karst-server", &instance)?;
        let counts = Counts::new().map_err(|e| Error::Internal(e.to_string()))?;
        Ok(Self { traces, counts })
    }

    /// Without a collector.
    #[cfg(test)]
    pub(crate) fn off() -> Self {
        Self { traces: Traces::default(), counts: Counts::new().expect("the names are right") }
    }
}
