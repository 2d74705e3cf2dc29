//! Owns the counts since the start of the server. What they mean to people is in `docs/metrics.md`.

use prometheus::core::Collector;
use prometheus::process_collector::ProcessCollector;
use prometheus::{Counter, Error, IntCounter, IntCounterVec, IntGauge, Opts, Registry};
use tonic::Code;

use crate::telemetry::calls::methods;

/// How a task came to an end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Its result counts.
    Accepted,
    /// Its result counts although its lease had expired.
    Late,
    /// The same bytes had been accepted before.
    Duplicate,
    /// Nobody needed it any more.
    Closed,
    /// Other bytes had been accepted before.
    Disputed,
    /// What came was not a result of it.
    Refused,
    /// It cannot be rendered there.
    Failed,
    /// The worker vanished.
    Lost,
    /// It was handed back.
    Interrupted,
}

impl Outcome {
    const RESULTS: [Self; 6] =
        [Self::Accepted, Self::Late, Self::Duplicate, Self::Closed, Self::Disputed, Self::Refused];
    const FAILURES: [Self; 3] = [Self::Failed, Self::Lost, Self::Interrupted];

    /// One word, as metrics and spans have it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Late => "late",
            Self::Duplicate => "duplicate",
            Self::Closed => "closed",
            Self::Disputed => "disputed",
            Self::Refused => "refused",
            Self::Failed => "failed",
            Self::Lost => "lost",
            Self::Interrupted => "interrupted",
        }
    }
}

/// The counts.
#[derive(Debug)]
pub(crate) struct Counts {
    /// All of them, to be written down.
    pub registry: Registry,
    results: IntCounterVec,
    failures: IntCounterVec,
    rays: IntCounterVec,
    calls: IntCounterVec,
    /// Tiles that were accepted.
    pub tiles: IntCounter,
    /// Tiles that are not tried again.
    pub quarantined: IntCounter,
    /// Leases whose worker was not heard of in time.
    pub expirations: IntCounter,
    /// Camera samples of accepted results.
    pub samples: IntCounter,
    /// Samples of accepted results that were dropped because they were not finite.
    pub nonfinite: IntCounter,
    /// Rays of accepted results that ran out of marching steps.
    pub exhausted: IntCounter,
    /// Time that threads were busy with results, needed or not.
    pub render_seconds: Counter,
    /// Uploads that bytes come in for.
    pub uploads: IntGauge,
    /// `WebSocket`s of live pages.
    pub page_sockets: IntGauge,
}

impl Counts {
    /// Everything at zero.
    ///
    /// # Errors
    /// A name is malformed or there twice, which a test would notice.
    pub(crate) fn new() -> Result<Self, Error> {
        let registry = Registry::new();
        let vec = |name: &str, help: &str, labels: &[&str]| {
            added(&registry, IntCounterVec::new(Opts::new(name, help), labels)?)
        };
        let count = |name: &str, help: &str| added(&registry, IntCounter::new(name, help)?);
        let gauge = |name: &str, help: &str| added(&registry, IntGauge::new(name, help)?);
        let seconds =
            Counter::new("karst_render_seconds_total", "Seconds that threads were busy with results.")?;
        let counts = Self {
            results: vec("karst_results_total", "Results that came, by what became of them.", &["outcome"])?,
            failures: vec("karst_task_failures_total", "Tasks that came back, by the reason.", &["kind"])?,
            rays: vec("karst_rays_total", "Rays of accepted results.", &["kind"])?,
            calls: vec("karst_calls_total", "gRPC calls that have ended.", &["method", "code"])?,
            tiles: count("karst_tiles_accepted_total", "Results that count, each a tile of a round.")?,
            quarantined: count("karst_tiles_quarantined_total", "Tiles that are not tried again.")?,
            expirations: count(
                "karst_lease_expirations_total",
                "Leases with open tasks whose worker was not heard of in time.",
            )?,
            samples: count("karst_samples_total", "Camera samples of accepted results.")?,
            nonfinite: count(
                "karst_nonfinite_samples_total",
                "Samples dropped because they were not finite.",
            )?,
            exhausted: count("karst_exhausted_rays_total", "Rays that ran out of marching steps.")?,
            render_seconds: added(&registry, seconds)?,
            uploads: gauge("karst_uploads", "Uploads that are coming in.")?,
            page_sockets: gauge("karst_page_sockets", "WebSockets of live pages.")?,
            registry: registry.clone(),
        };
        registry.register(Box::new(ProcessCollector::for_self()))?;
        counts.fill();
        Ok(counts)
    }

    /// Makes every series that can be told in advance, so that rates are right from the first event on.
    fn fill(&self) {
        for outcome in Outcome::RESULTS {
            self.results.with_label_values(&[outcome.name()]);
        }
        for kind in Outcome::FAILURES {
            self.failures.with_label_values(&[kind.name()]);
        }
        for kind in ["path", "shadow"] {
            self.rays.with_label_values(&[kind]);
        }
        for method in methods() {
            self.calls.with_label_values(&[method.as_str(), "Ok"]);
        }
    }

    /// A task has come to an end.
    pub(crate) fn ended(&self, outcome: Outcome) {
        let family = if Outcome::FAILURES.contains(&outcome) { &self.failures } else { &self.results };
        family.with_label_values(&[outcome.name()]).inc();
        if matches!(outcome, Outcome::Accepted | Outcome::Late) {
            self.tiles.inc();
        }
    }

    /// Rays of an accepted result: along paths, and towards lights.
    pub(crate) fn add_rays(&self, path: u64, shadow: u64) {
        self.rays.with_label_values(&["path"]).inc_by(path);
        self.rays.with_label_values(&["shadow"]).inc_by(shadow);
    }

    /// A thread was busy; what no clock says is left out.
    pub(crate) fn add_seconds(&self, seconds: f64) {
        if (0.0..1e6).contains(&seconds) {
            self.render_seconds.inc_by(seconds);
        }
    }

    /// A call has ended.
    pub(crate) fn add_call(&self, method: &str, code: Code) {
        self.calls.with_label_values(&[method, &format!("{code:?}")]).inc();
    }
}

fn added<C: Collector + Clone + 'static>(registry: &Registry, metric: C) -> Result<C, Error> {
    registry.register(Box::new(metric.clone()))?;
    Ok(metric)
}

/// Something that goes on: counted until it is dropped.
#[derive(Debug)]
pub(crate) struct Ongoing(IntGauge);

impl Ongoing {
    /// One more.
    pub(crate) fn new(gauge: &IntGauge) -> Self {
        gauge.inc();
        Self(gauge.clone())
    }
}

impl Drop for Ongoing {
    fn drop(&mut self) {
        self.0.dec();
    }
}

#[cfg(test)]
mod tests {
    use super::{Counts, Ongoing, Outcome};

    #[test]
    fn ends_are_counted_by_their_kind() {
        let counts = Counts::new().unwrap();
        for outcome in [Outcome::Accepted, Outcome::Late, Outcome::Refused, Outcome::Lost, Outcome::Lost] {
            counts.ended(outcome);
        }
        let result = |o: Outcome| counts.results.with_label_values(&[o.name()]).get();
        assert_eq!((result(Outcome::Accepted), result(Outcome::Late), result(Outcome::Refused)), (1, 1, 1));
        assert_eq!(counts.failures.with_label_values(&["lost"]).get(), 2);
        assert_eq!(counts.tiles.get(), 2);
        for nonsense in [f64::NAN, f64::INFINITY, -1.0] {
            counts.add_seconds(nonsense);
        }
        assert_eq!(counts.render_seconds.get(), 0.0);
    }

    #[test]
    fn what_goes_on_is_counted_until_it_ends() {
        let counts = Counts::new().unwrap();
        let (one, two) = (Ongoing::new(&counts.uploads), Ongoing::new(&counts.uploads));
        assert_eq!(counts.uploads.get(), 2);
        drop((one, two));
        assert_eq!(counts.uploads.get(), 0);
    }
}
