//! Owns the live page: its files, who is logged in, and the WebSocket over which it hears of jobs and gets pixels.
//! What page and server say to each other stands in `page/PROTOCOL.md`.

mod files;
mod jobs;
mod messages;
mod pixels;
mod session;
mod socket;

use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post};
use tokio_util::task::TaskTracker;

use crate::door::Tokens;
use crate::farm::Shared;
use crate::page::session::Sessions;

/// Longest body of a request: a token.
const MAX_BODY: usize = 1024;

/// What the page's requests share.
#[derive(Debug, Clone)]
pub(crate) struct Page {
    shared: Arc<Shared>,
    sessions: Arc<Sessions>,
    /// The open `WebSockets`.
    pub(crate) sockets: TaskTracker,
}

impl Page {
    /// The page of a server on `port`; `secure` when it is reached over TLS.
    pub(crate) fn new(shared: &Arc<Shared>, tokens: &Arc<Tokens>, port: u16, secure: bool) -> Self {
        let sessions = Arc::new(Sessions::new(Arc::clone(tokens), port, secure));
        Self { shared: Arc::clone(shared), sessions, sockets: TaskTracker::new() }
    }
}

/// Everything that the page asks for.
pub(crate) fn routes(page: Page) -> Router {
    let api = Router::new()
        .route("/api/login", post(session::login))
        .route("/api/logout", post(session::logout))
        .route("/api/session", get(session::show))
        .route("/api/socket", get(socket::open))
        .layer(from_fn_with_state(page.clone(), session::expect_own_host))
        .layer(DefaultBodyLimit::max(MAX_BODY))
        .with_state(page);
    Router::new()
        .route("/", get(files::index))
        .route("/page/{name}", get(files::file))
        .merge(api)
        .layer(from_fn(files::protect))
}
