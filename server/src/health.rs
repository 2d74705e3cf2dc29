//! Owns the question whether a server serves, for scripts, containers and clusters.

use std::path::Path;
use std::time::Duration;

use karst_proto::connect::endpoint;
use tokio::time::timeout;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

/// A server that takes longer does not serve.
const PATIENCE: Duration = Duration::from_secs(5);

/// Asks a server whether it serves.
///
/// # Errors
/// Says why not.
pub async fn health(server: &str, ca_file: Option<&Path>) -> Result<(), String> {
    let asked = timeout(PATIENCE, ask(server, ca_file)).await;
    asked.map_err(|_| format!("{server}: no answer in {} s", PATIENCE.as_secs()))?
}

async fn ask(server: &str, ca_file: Option<&Path>) -> Result<(), String> {
    let endpoint = endpoint(server, ca_file).map_err(|e| e.to_string())?;
    let channel = endpoint.connect().await.map_err(|e| {
        let cause = std::error::Error::source(&e).map_or_else(|| e.to_string(), ToString::to_string);
        format!("{server}: {cause}")
    })?;
    let answer = HealthClient::new(channel).check(HealthCheckRequest::default()).await;
    match answer.map(|a| a.into_inner().status()) {
        Ok(ServingStatus::Serving) => Ok(()),
        Ok(status) => Err(format!("{server}: {}", status.as_str_name())),
        Err(status) => Err(format!("{server}: {}", status.message())),
    }
}
