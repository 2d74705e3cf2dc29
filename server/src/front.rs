//! Owns the port: everything that comes in over it, calls (HTTP/2) and the page (HTTP/1.1 and `WebSockets`) alike,
//! with TLS where there is a certificate.

use std::io;
use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::service::TowerToHyperService;
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio::io::{AsyncBufReadExt as _, AsyncRead, AsyncWrite, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use crate::door::TlsFiles;
use crate::error::Error;

/// Open calls of one connection.
const MAX_STREAMS: u32 = 100;
/// Bytes of the headers of one call.
const MAX_HEADER_BYTES: u32 = 16 << 10;
/// A connection must have said what it wants after this time.
const PATIENCE: Duration = Duration::from_secs(10);

/// Serves `routes` on `listener` until `ending`; then waits until all calls have ended.
pub(crate) async fn serve(
    listener: TcpListener,
    tls: Option<TlsAcceptor>,
    routes: Router,
    ending: CancellationToken,
) {
    let connections = TaskTracker::new();
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = ending.cancelled() => break,
        };
        let stream = match accepted {
            Ok((stream, _)) => stream,
            Err(e) => {
                // Mostly too many open files: some of them are closed sooner or later.
                tracing::warn!("a connection was not accepted: {e}");
                sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        connections.spawn(greet(stream, tls.clone(), routes.clone(), ending.clone()));
    }
    // Nobody new is told to wait for calls that nobody will answer.
    drop(listener);
    connections.close();
    connections.wait().await;
}

/// Agrees on TLS if there is a certificate, then serves.
async fn greet(stream: TcpStream, tls: Option<TlsAcceptor>, routes: Router, ending: CancellationToken) {
    let _ = stream.set_nodelay(true);
    let Some(tls) = tls else { return serve_connection(stream, routes, ending).await };
    let accepted = tokio::select! {
        accepted = timeout(PATIENCE, tls.accept(stream)) => accepted,
        () = ending.cancelled() => return,
    };
    match accepted {
        Ok(Ok(stream)) => serve_connection(stream, routes, ending).await,
        Ok(Err(e)) => tracing::debug!("no TLS: {e}"),
        Err(_) => tracing::debug!("no TLS within {PATIENCE:?}"),
    }
}

async fn serve_connection<S>(stream: S, routes: Router, ending: CancellationToken)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let mut builder = Builder::new(TokioExecutor::new());
    builder
        .http2()
        .timer(TokioTimer::new())
        .keep_alive_interval(Some(Duration::from_secs(30)))
        .keep_alive_timeout(PATIENCE)
        .max_concurrent_streams(MAX_STREAMS)
        .max_header_list_size(MAX_HEADER_BYTES);
    builder
        .http1()
        .timer(TokioTimer::new())
        .header_read_timeout(PATIENCE)
        .max_buf_size(MAX_HEADER_BYTES as usize);
    // Which protocol it is shows in the first bytes, for which hyper would wait for ever.
    let mut stream = BufReader::new(stream);
    let begun = tokio::select! {
        begun = timeout(PATIENCE, stream.fill_buf()) => begun.is_ok(),
        () = ending.cancelled() => false,
    };
    if !begun {
        return;
    }
    let service = TowerToHyperService::new(routes);
    let mut connection = pin!(builder.serve_connection_with_upgrades(TokioIo::new(stream), service));
    let served = tokio::select! {
        served = &mut connection => served,
        () = ending.cancelled() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(e) = served {
        tracing::debug!("a connection has ended: {e}");
    }
}

/// What agrees on TLS with this certificate and key.
///
/// # Errors
/// When a file cannot be read, or the two do not belong together.
pub(crate) fn acceptor(files: &TlsFiles) -> Result<TlsAcceptor, Error> {
    let read = |path: &Path| {
        let named = |e: io::Error| io::Error::new(e.kind(), format!("{}: {e}", path.display()));
        std::fs::read(path).map_err(named)
    };
    let (cert, key) = (read(&files.cert)?, read(&files.key)?);
    let wrong = |cause: &dyn std::fmt::Display| {
        let (cert, key) = (files.cert.display(), files.key.display());
        Error::Storage(io::Error::other(format!(
            "{cert} and {key} are not a certificate and its key: {cause}"
        )))
    };
    let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&cert).collect();
    let chain = chain.map_err(|e| wrong(&e))?;
    let key = PrivateKeyDer::from_pem_slice(&key).map_err(|e| wrong(&e))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
        .map_err(|e| wrong(&e))?;
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}
