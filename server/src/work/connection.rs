//! Owns the connection of a worker to its server.

use std::time::Duration;

use karst_proto::connect::{Line, bearer, endpoint};
use tonic::service::interceptor::InterceptedService;

use crate::config::WorkConfig;
use crate::work::WorkError;

/// A connection that is made when it is needed, and again when it broke.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    /// For calls.
    pub line: Line,
}

impl Link {
    /// Prepares a connection; nothing is sent yet.
    ///
    /// # Errors
    /// The address is malformed, or the token cannot be read.
    pub(crate) fn new(config: &WorkConfig) -> Result<Self, WorkError> {
        let usage = |e: karst_proto::connect::ConnectError| WorkError::Usage(e.to_string());
        let endpoint = endpoint(&config.server, config.ca_file.as_deref()).map_err(usage)?;
        let bearer =
            bearer(&config.server, config.token_file.as_deref(), config.state.as_deref()).map_err(usage)?;
        // A worker notices soon that its server's machine is gone: there may be another way to it.
        let channel = endpoint
            .http2_keep_alive_interval(Duration::from_secs(10))
            .keep_alive_while_idle(true)
            .connect_lazy();
        Ok(Self { line: InterceptedService::new(channel, bearer) })
    }
}
