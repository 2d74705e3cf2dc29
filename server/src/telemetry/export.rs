//! Owns the way of finished spans to a collector: OTLP over gRPC, in batches, on a thread of its own.
//!
//! The queue in front of it is bounded; what does not fit, and what a collector that is away cannot take, is dropped.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use karst_proto::connect::endpoint;
use opentelemetry::KeyValue;
use opentelemetry_otlp::{WithExportConfig as _, WithTonicConfig as _};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::error::OTelSdkResult;
use opentelemetry_sdk::trace::{BatchSpanProcessor, SpanData, SpanExporter, SpanProcessor as _};

use crate::config::Collector;

/// A collector that takes longer for a batch does not get it.
const PATIENCE: Duration = Duration::from_secs(5);

/// Starts the thread that sends spans of `service` to `collector`; `None` without one. Must be called inside a
/// runtime, on which the connection lives.
///
/// # Errors
/// The collector's address is malformed, or its certificate cannot be read.
pub(crate) fn start(
    collector: &Collector,
    service: &'static str,
    instance: &str,
) -> io::Result<Option<BatchSpanProcessor>> {
    let Some(url) = collector.endpoint.as_deref().filter(|url| !url.is_empty()) else { return Ok(None) };
    let named = |e: &dyn std::fmt::Display| io::Error::other(format!("--otlp-endpoint: {e}"));
    let endpoint = endpoint(url, collector.ca_file.as_deref()).map_err(|e| named(&e))?;
    let exporter = opentelemetry_otlp::SpanExporter::builder()
        .with_tonic()
        .with_timeout(PATIENCE)
        .with_channel(endpoint.timeout(PATIENCE).connect_lazy())
        .build()
        .map_err(|e| named(&e))?;
    let exporter = Candid { exporter, collector: url.to_owned(), away: AtomicBool::new(false) };
    let mut processor = BatchSpanProcessor::builder(exporter).build();
    let resource = Resource::builder().with_service_name(service).with_attributes([
        KeyValue::new("service.instance.id", instance.to_owned()),
        KeyValue::new("service.version", env!("CARGO_PKG_VERSION")),
    ]);
    processor.set_resource(&resource.build());
    tracing::info!("traces go to {url}");
    Ok(Some(processor))
}

/// Says once that a collector is away, and once that it is back.
#[derive(Debug)]
struct Candid {
    exporter: opentelemetry_otlp::SpanExporter,
    collector: String,
    away: AtomicBool,
}

impl SpanExporter for Candid {
    async fn export(&self, batch: Vec<SpanData>) -> OTelSdkResult {
        let spans = batch.len();
        let sent = self.exporter.export(batch).await;
        let was_away = self.away.swap(sent.is_err(), Ordering::Relaxed);
        match &sent {
            Err(e) if !was_away => {
                tracing::warn!(
                    "{}: {spans} spans are dropped, and more until it answers: {e}",
                    self.collector
                );
            }
            Ok(()) if was_away => tracing::info!("{}: takes spans again", self.collector),
            Ok(()) | Err(_) => {}
        }
        sent
    }

    fn shutdown_with_timeout(&self, timeout: Duration) -> OTelSdkResult {
        self.exporter.shutdown_with_timeout(timeout)
    }

    fn force_flush(&self) -> OTelSdkResult {
        self.exporter.force_flush()
    }

    fn set_resource(&mut self, resource: &Resource) {
        self.exporter.set_resource(resource);
    }
}
