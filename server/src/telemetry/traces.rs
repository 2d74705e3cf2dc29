//! Owns the spans of jobs: which there are, whose children they are, what they say.
//!
//! A span is made when it has ended, from times that are known then; none is kept open. Its ids follow from its
//! place (job, frame, round, lease and tile), so a job that goes on after a restart of the server goes on with its
//! trace, and a result that comes back late joins it.

use std::fmt;
use std::io;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use opentelemetry::trace::{SpanContext, SpanId, SpanKind, Status, TraceFlags, TraceId, TraceState};
use opentelemetry::{InstrumentationScope, KeyValue};
use opentelemetry_sdk::trace::{BatchSpanProcessor, SpanData, SpanEvents, SpanLinks, SpanProcessor as _};
use uuid::Uuid;

use crate::config::Collector;
use crate::digest::Digest;
use crate::model::Time;
use crate::telemetry::export;

/// How long a program that ends waits for a collector to take its last spans.
const FAREWELL: Duration = Duration::from_secs(3);

/// Where spans go; nowhere without a collector.
#[derive(Debug, Clone, Default)]
pub(crate) struct Traces {
    sender: Option<Arc<BatchSpanProcessor>>,
}

impl Traces {
    /// Spans go to `collector`, if there is one, as those of one `instance` of a `service`. Must be called inside a
    /// runtime.
    ///
    /// # Errors
    /// The collector's address is malformed, or its certificate cannot be read.
    pub(crate) fn start(collector: &Collector, service: &'static str, instance: &str) -> io::Result<Self> {
        Ok(Self { sender: export::start(collector, service, instance)?.map(Arc::new) })
    }

    /// Whether anybody takes spans.
    pub(crate) fn is_on(&self) -> bool {
        self.sender.is_some()
    }

    /// Takes a finished span. Never waits.
    pub(crate) fn send(&self, span: impl FnOnce() -> Span) {
        if let Some(sender) = &self.sender {
            sender.on_end(span().data());
        }
    }

    /// What a worker needs to hang its spans under a task; empty when nobody takes spans.
    pub(crate) fn traceparent(&self, job: &str, taken: Taken) -> String {
        if !self.is_on() || !taken.is_known() {
            return String::new();
        }
        format!("00-{}-{}-01", trace_id(job), taken.span)
    }

    /// The parent that a server sent along with a task; `None` when it sent none or nobody here takes spans.
    pub(crate) fn parent(&self, traceparent: &str) -> Option<Parent> {
        if self.is_on() { Parent::parse(traceparent) } else { None }
    }

    /// Waits until the last spans are sent, but not long.
    pub(crate) async fn end(self) {
        let Some(sender) = self.sender else { return };
        // Whoever is away was reported already.
        let ended = tokio::task::spawn_blocking(move || drop(sender.shutdown_with_timeout(FAREWELL)));
        if let Err(e) = ended.await {
            tracing::error!("the last spans were not sent: {e}");
        }
    }
}

/// A span elsewhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Parent {
    trace: TraceId,
    span: SpanId,
}

impl Parent {
    /// Reads a `traceparent` of version 00 that asks to be recorded.
    fn parse(text: &str) -> Option<Self> {
        let hex = |part: &str, digits: usize| {
            part.len() == digits && part.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
        };
        let mut parts = text.split('-');
        let (version, trace, span, flags) = (parts.next()?, parts.next()?, parts.next()?, parts.next()?);
        let formed = version == "00" && hex(trace, 32) && hex(span, 16) && hex(flags, 2);
        if !formed || parts.next().is_some() || u8::from_str_radix(flags, 16).ok()? & 1 == 0 {
            return None;
        }
        let (trace, span) = (TraceId::from_hex(trace).ok()?, SpanId::from_hex(span).ok()?);
        (trace != TraceId::INVALID && span != SpanId::INVALID).then_some(Self { trace, span })
    }
}

/// That somebody has taken a task: when, and which span will tell how it went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Taken {
    /// When it was taken.
    pub at: Time,
    /// Its lease had expired when the result came.
    pub late: bool,
    span: SpanId,
}

impl Default for Taken {
    /// Nobody has.
    fn default() -> Self {
        Self { at: 0, late: false, span: SpanId::INVALID }
    }
}

impl Taken {
    /// By a worker, with a lease: the same after a restart of the server.
    pub(crate) fn by_lease(fence: u64, tile: u32, at: Time) -> Self {
        Self { at, late: false, span: span_id(&format!("lease {fence} tile {tile}")) }
    }

    /// By a thread of this process.
    pub(crate) fn here(at: Time) -> Self {
        Self { at, late: false, span: random_span() }
    }

    /// The lease has expired, which its span has told: the result that comes all the same is told by another.
    pub(crate) fn late(self) -> Self {
        Self { at: self.at, late: true, span: span_id(&format!("late {}", self.span)) }
    }

    /// Somebody has taken it, and that has not been told.
    pub(crate) fn is_known(self) -> bool {
        self.span != SpanId::INVALID
    }
}

/// Which span of a job.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Place {
    /// From its submission to its end.
    Job,
    /// A frame, from the first round to the stored files.
    Frame(i32),
    /// A round of a frame, until it is evaluated.
    Round(i32, u32),
    /// A task, from the hands of the queue to the end of it: frame, round, tile.
    Task(i32, u32, u32, Taken),
}

impl Place {
    fn parent(self) -> Option<Self> {
        match self {
            Self::Job => None,
            Self::Frame(_) => Some(Self::Job),
            Self::Round(frame, _) => Some(Self::Frame(frame)),
            Self::Task(frame, round, ..) => Some(Self::Round(frame, round)),
        }
    }

    fn span_id(self, job: &str) -> SpanId {
        match self {
            Self::Job => span_id(job),
            Self::Frame(frame) => span_id(&format!("{job} frame {frame}")),
            Self::Round(frame, round) => span_id(&format!("{job} frame {frame} round {round}")),
            Self::Task(.., taken) => taken.span,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Job => "job",
            Self::Frame(_) => "frame",
            Self::Round(..) => "round",
            Self::Task(..) => "task",
        }
    }

    fn attributes(self, attributes: &mut Vec<KeyValue>) {
        match self {
            Self::Job => {}
            Self::Frame(frame) => attributes.push(KeyValue::new("karst.frame", i64::from(frame))),
            Self::Round(frame, round) => {
                Self::Frame(frame).attributes(attributes);
                attributes.push(KeyValue::new("karst.round", i64::from(round)));
            }
            Self::Task(frame, round, tile, _) => {
                Self::Round(frame, round).attributes(attributes);
                attributes.push(KeyValue::new("karst.tile", i64::from(tile)));
            }
        }
    }
}

/// A span that has ended.
#[derive(Debug)]
pub(crate) struct Span {
    name: &'static str,
    trace: TraceId,
    id: SpanId,
    parent: SpanId,
    kind: SpanKind,
    remote: bool,
    period: (Time, Time),
    attributes: Vec<KeyValue>,
    status: Status,
}

impl Span {
    /// What happened in one place of a job between two times.
    pub(crate) fn of(job: &str, place: Place, period: (Time, Time)) -> Self {
        let mut attributes = vec![KeyValue::new("karst.job.id", job.to_owned())];
        place.attributes(&mut attributes);
        Self {
            name: place.name(),
            trace: trace_id(job),
            id: place.span_id(job),
            parent: place.parent().map_or(SpanId::INVALID, |parent| parent.span_id(job)),
            kind: SpanKind::Internal,
            remote: false,
            period,
            attributes,
            status: Status::Unset,
        }
    }

    /// A thread was busy with a task.
    pub(crate) fn render(
        job: &str,
        (frame, round, tile): (i32, u32, u32),
        parent: Parent,
        period: (Time, Time),
    ) -> Self {
        let of_task = Self::of(job, Place::Task(frame, round, tile, Taken::default()), period);
        let (trace, parent) = (parent.trace, parent.span);
        Self { name: "render", trace, id: random_span(), parent, remote: true, ..of_task }
    }

    /// A thread of the process that gave the task to it was busy with it.
    pub(crate) fn render_here(
        job: &str,
        (frame, round, tile): (i32, u32, u32),
        taken: Taken,
        period: (Time, Time),
    ) -> Self {
        let parent = Parent { trace: trace_id(job), span: taken.span };
        Self { remote: false, ..Self::render(job, (frame, round, tile), parent, period) }
    }

    /// How it ended; anything but what was hoped for with the reason.
    pub(crate) fn ended(mut self, outcome: impl fmt::Display, failure: Option<String>) -> Self {
        self.attributes.push(KeyValue::new("karst.outcome", outcome.to_string()));
        if let Some(description) = failure {
            self.status = Status::error(description);
        }
        self
    }

    /// Who did it.
    pub(crate) fn worker(self, worker: &str) -> Self {
        self.with(KeyValue::new("karst.worker.id", worker.to_owned()))
    }

    /// The camera samples in it.
    pub(crate) fn samples(self, samples: u64) -> Self {
        self.with(KeyValue::new("karst.samples", samples as i64))
    }

    /// One more attribute.
    pub(crate) fn with(mut self, attribute: KeyValue) -> Self {
        self.attributes.push(attribute);
        self
    }

    fn data(self) -> SpanData {
        let flags = TraceFlags::SAMPLED;
        SpanData {
            span_context: SpanContext::new(self.trace, self.id, flags, false, TraceState::default()),
            parent_span_id: self.parent,
            parent_span_is_remote: self.remote,
            span_kind: self.kind,
            name: self.name.into(),
            start_time: system_time(self.period.0),
            end_time: system_time(self.period.1),
            attributes: self.attributes,
            dropped_attributes_count: 0,
            events: SpanEvents::default(),
            links: SpanLinks::default(),
            status: self.status,
            instrumentation_scope: InstrumentationScope::builder("karst").build(),
        }
    }
}

fn system_time(time: Time) -> SystemTime {
    UNIX_EPOCH + Duration::from_micros(u64::try_from(time).unwrap_or_default())
}

/// The trace of a job: the first half of the SHA-256 of its id, so that whoever knows the job finds the trace.
fn trace_id(job: &str) -> TraceId {
    let digest = Digest::of(job.as_bytes());
    let half = digest.as_bytes().first_chunk().copied().unwrap_or_default();
    TraceId::from_bytes(half)
}

fn span_id(name: &str) -> SpanId {
    let digest = Digest::of(name.as_bytes());
    SpanId::from_bytes(digest.as_bytes().last_chunk().copied().unwrap_or_default())
}

fn random_span() -> SpanId {
    SpanId::from(Uuid::new_v4().as_u64_pair().1)
}

#[cfg(test)]
mod tests {
    use super::{Parent, Place, Span, Taken, Traces, trace_id};
    use opentelemetry::trace::SpanId;

    #[test]
    fn children_find_their_parents_by_the_place_alone() {
        let span = |place| Span::of("j", place, (1, 2));
        let taken = Taken::by_lease(7, 3, 1);
        let chain = [Place::Job, Place::Frame(1), Place::Round(1, 0), Place::Task(1, 0, 3, taken)].map(span);
        assert_eq!(chain[0].parent, SpanId::INVALID);
        for pair in chain.windows(2) {
            assert_eq!((pair[0].id, pair[0].trace), (pair[1].parent, pair[1].trace));
        }
        assert_ne!(span(Place::Frame(2)).id, chain[1].id);
        assert_ne!(span(Place::Round(1, 1)).id, chain[2].id);
        let distinct = [Taken::by_lease(7, 4, 1), Taken::by_lease(8, 3, 1), taken.late(), Taken::here(1)];
        assert!(distinct.iter().all(|other| other.span != taken.span && other.is_known()));
        assert!(!Taken::default().is_known());
    }

    #[test]
    fn the_trace_of_a_job_is_the_beginning_of_the_sha256_of_its_id() {
        let digest = crate::digest::Digest::of(b"0123456789ab").to_string();
        assert_eq!(trace_id("0123456789ab").to_string(), digest[..32]);
    }

    #[test]
    fn only_a_well_formed_traceparent_is_taken() {
        let good = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        assert!(Parent::parse(good).is_some());
        let garbage = [
            "",
            "x",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-00",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01-",
            "01-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-4BF92F3577B34DA6A3CE929D0E0E4736-00f067aa0ba902b7-01",
            "00-00000000000000000000000000000000-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01",
            "00-+bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e473-00f067aa0ba902b7a-01",
            "00-4bf92f3577b34da6a3ce929d0e0e473-00f067aa0ba902b7-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b-01",
            "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-1",
        ];
        for text in garbage.into_iter().chain([&*"-".repeat(1 << 20), &*"é".repeat(27)]) {
            assert_eq!(Parent::parse(text), None, "{text:.60}");
        }
    }

    #[tokio::test]
    async fn without_a_collector_nothing_is_made() {
        let traces = Traces::default();
        traces.send(|| unreachable!("nobody takes it"));
        assert_eq!(traces.traceparent("j", Taken::here(1)), "");
        let good = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        assert_eq!(traces.parent(good), None);
        traces.end().await;
    }
}
