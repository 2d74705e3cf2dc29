//! Owns the connection of a worker to its server.

use std::time::Duration;

use tonic::transport::{Channel, Endpoint};

use crate::work::WorkError;

/// A connection that is made when it is needed, and again when it broke.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    /// For calls.
    pub channel: Channel,
}

impl Link {
    /// Prepares a connection to `server`; nothing is sent yet.
    ///
    /// # Errors
    /// The address is malformed.
    pub(crate) fn new(server: &str) -> Result<Self, WorkError> {
        let endpoint = Endpoint::from_shared(server.to_owned())
            .ok()
            .filter(|endpoint| matches!(endpoint.uri().scheme_str(), Some("http" | "https")))
            .ok_or_else(|| {
                WorkError::Usage(format!(
                    "--server: found {server:?}, expected http://HOST:PORT or https://HOST:PORT"
                ))
            })?
            .connect_timeout(Duration::from_secs(5))
            .http2_keep_alive_interval(Duration::from_secs(10))
            .keep_alive_timeout(Duration::from_secs(10))
            .keep_alive_while_idle(true)
            .tcp_nodelay(true);
        Ok(Self { channel: endpoint.connect_lazy() })
    }
}
