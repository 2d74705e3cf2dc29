//! Owns who is logged in: a browser shows a token once and gets a cookie, which counts as long as its token does.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::uri::{Authority, Uri};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde_json::json;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use crate::door::{Role, Tokens, new_token};
use crate::page::Page;

/// Browsers that are logged in at the same time; the one that was quiet for longest goes first.
const MAX_SESSIONS: usize = 1000;
/// A session ends when it was not used for so long.
const MAX_QUIET: Duration = Duration::from_hours(7 * 24);
/// Wrong tokens within [`WINDOW`] after which logging in has to wait.
const MAX_WRONG: u32 = 30;
const WINDOW: Duration = Duration::from_mins(1);
/// What whoever looks must be allowed to call.
const NEEDED: &str = "/karst.v1.Previews/StreamTiles";

/// All sessions.
#[derive(Debug)]
pub(crate) struct Sessions {
    tokens: Arc<Tokens>,
    /// Browsers send a cookie to every port of a host: its name tells servers apart.
    cookie: String,
    secure: bool,
    open: Mutex<HashMap<String, Session>>,
    wrong: Mutex<(Instant, u32)>,
}

/// A browser that is logged in.
#[derive(Debug, Clone)]
pub(crate) struct Session {
    token: String,
    used: Instant,
    /// Its sockets must close.
    pub(crate) over: CancellationToken,
}

impl Sessions {
    pub(crate) fn new(tokens: Arc<Tokens>, port: u16, secure: bool) -> Self {
        Self {
            tokens,
            cookie: format!("karst-{port}"),
            secure,
            open: Mutex::default(),
            wrong: Mutex::new((Instant::now(), 0)),
        }
    }

    /// The role of a token that may look.
    pub(crate) fn role(&self, session: &Session) -> Option<Role> {
        self.tokens.find(&session.token).map(|(role, _)| role).filter(|role| role.may(NEEDED))
    }

    /// The session that a request's cookie names, and its role.
    pub(crate) fn find(&self, headers: &HeaderMap) -> Option<(Session, Role)> {
        let id = self.id(headers)?;
        let session = {
            let mut open = self.open();
            let session = open.get_mut(&id).filter(|session| session.used.elapsed() < MAX_QUIET)?;
            session.used = Instant::now();
            session.clone()
        };
        let role = self.role(&session)?;
        Some((session, role))
    }

    fn id(&self, headers: &HeaderMap) -> Option<String> {
        let texts = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut pairs = texts.flat_map(|text| text.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.find(|(name, _)| *name == self.cookie).map(|(_, id)| id.to_owned())
    }

    /// The cookie of a new session.
    fn begin(&self, token: &str) -> String {
        let id = new_token();
        let session =
            Session { token: token.to_owned(), used: Instant::now(), over: CancellationToken::new() };
        let mut open = self.open();
        open.retain(|_, session| session.used.elapsed() < MAX_QUIET);
        if open.len() >= MAX_SESSIONS {
            let oldest = open.iter().min_by_key(|(_, session)| session.used).map(|(id, _)| id.clone());
            oldest.and_then(|id| open.remove(&id)).inspect(|session| session.over.cancel());
        }
        open.insert(id.clone(), session);
        self.cookie(&id, MAX_QUIET)
    }

    fn end(&self, headers: &HeaderMap) {
        if let Some(session) = self.id(headers).and_then(|id| self.open().remove(&id)) {
            session.over.cancel();
        }
    }

    fn cookie(&self, id: &str, age: Duration) -> String {
        let secure = if self.secure { "; Secure" } else { "" };
        let (name, age) = (&self.cookie, age.as_secs());
        format!("{name}={id}; HttpOnly; SameSite=Strict; Path=/; Max-Age={age}{secure}")
    }

    /// Whether so many wrong tokens came that somebody seems to guess.
    fn must_wait(&self) -> bool {
        let (since, count) = *self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        since.elapsed() < WINDOW && count >= MAX_WRONG
    }

    fn count_wrong(&self) {
        let mut wrong = self.wrong.lock().unwrap_or_else(PoisonError::into_inner);
        *wrong = if wrong.0.elapsed() < WINDOW { (wrong.0, wrong.1 + 1) } else { (Instant::now(), 1) };
    }

    fn open(&self) -> MutexGuard<'_, HashMap<String, Session>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What is wrong, and what to do.
pub(super) fn problem(status: StatusCode, error: &str, hint: &str) -> Response {
    (status, Json(json!({"error": error, "hint": hint}))).into_response()
}

/// The answer to a request without a session.
pub(super) fn not_logged_in() -> Response {
    problem(StatusCode::UNAUTHORIZED, "not logged in", "log in with a token")
}

pub(super) async fn login(State(page): State<Page>, headers: HeaderMap, body: String) -> Response {
    if let Some(refusal) = foreign(&headers) {
        return refusal;
    }
    let sessions = &page.sessions;
    if sessions.must_wait() {
        let error = "too many wrong tokens came in the last minute";
        return problem(StatusCode::TOO_MANY_REQUESTS, error, "wait a minute, then try again");
    }
    let token = body.trim();
    let Some((role, name)) = sessions.tokens.find(token) else {
        sessions.count_wrong();
        let hint = "the local one is in the file `token` of the server's data folder; others come from whoever \
                    runs the server";
        return problem(StatusCode::UNAUTHORIZED, "this token is not known here", hint);
    };
    if !role.may(NEEDED) {
        let error = format!("token {name:?} has the role {role}, which may not look at jobs");
        let hint = format!("take one with the role {}", Role::that_may(NEEDED));
        return problem(StatusCode::UNAUTHORIZED, &error, &hint);
    }
    (StatusCode::NO_CONTENT, [(header::SET_COOKIE, sessions.begin(token))]).into_response()
}

pub(super) async fn logout(State(page): State<Page>, headers: HeaderMap) -> Response {
    if let Some(refusal) = foreign(&headers) {
        return refusal;
    }
    page.sessions.end(&headers);
    (StatusCode::NO_CONTENT, [(header::SET_COOKIE, page.sessions.cookie("", Duration::ZERO))]).into_response()
}

pub(super) async fn show(State(page): State<Page>, headers: HeaderMap) -> Response {
    match page.sessions.find(&headers) {
        Some((_, role)) => {
            let server = concat!("karst ", env!("CARGO_PKG_VERSION"));
            Json(json!({"server": server, "role": role.to_string()})).into_response()
        }
        None => not_logged_in(),
    }
}

/// Refuses what a form or a page of somebody else could send: only scripts of this page can set the header.
fn foreign(headers: &HeaderMap) -> Option<Response> {
    if headers.get("x-karst").is_some_and(|value| value == "1") {
        return None;
    }
    Some(problem(StatusCode::FORBIDDEN, "this request does not come from the page", "send X-Karst: 1"))
}

/// Without TLS the server is reached over loopback only; a request for another host was led here by a name that
/// somebody else made point to loopback.
pub(super) async fn expect_own_host(State(page): State<Page>, request: Request, next: Next) -> Response {
    if page.sessions.secure || host(&request).is_some_and(|host| is_loopback(&host)) {
        return next.run(request).await;
    }
    let hint = "open the page as http://127.0.0.1:PORT or http://localhost:PORT; for other names the server needs \
                a certificate";
    problem(StatusCode::FORBIDDEN, "this server has another name", hint)
}

/// Name and port by which the server was reached.
fn host(request: &Request) -> Option<Authority> {
    let header = request.headers().get(header::HOST).and_then(|value| value.to_str().ok());
    // HTTP/2 has it in the address.
    header.and_then(|text| text.parse().ok()).or_else(|| request.uri().authority().cloned())
}

fn is_loopback(host: &Authority) -> bool {
    let name = host.host().trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

/// Whether the browser says that a page of this very server asks.
pub(super) fn is_own_page(request: &Request) -> bool {
    let origin = request.headers().get(header::ORIGIN).and_then(|value| value.to_str().ok());
    let origin = origin.and_then(|text| text.parse::<Uri>().ok());
    match (origin.as_ref().and_then(Uri::authority), host(request)) {
        (Some(origin), Some(host)) => *origin == host,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::{MAX_SESSIONS, MAX_WRONG, Sessions, is_loopback, is_own_page};
    use crate::door::Tokens;
    use axum::body::Body;
    use axum::extract::Request;
    use axum::http::{HeaderMap, header};
    use std::sync::Arc;

    fn sessions(data: &std::path::Path) -> (Sessions, String) {
        let tokens = Arc::new(Tokens::open(data, None).unwrap());
        let token = std::fs::read_to_string(data.join("token")).unwrap();
        (Sessions::new(tokens, 7878, false), token)
    }

    fn with(cookie: &str) -> HeaderMap {
        let pair = cookie.split(';').next().unwrap();
        let value = format!("other=1; {pair}");
        HeaderMap::from_iter([(header::COOKIE, value.parse().unwrap())])
    }

    #[test]
    fn a_session_counts_until_it_is_ended_or_its_token_is() {
        let dir = tempfile::tempdir().unwrap();
        let (sessions, token) = sessions(dir.path());
        let cookie = sessions.begin(&token);
        assert!(cookie.starts_with("karst-7878=") && cookie.contains("HttpOnly; SameSite=Strict"));
        assert!(!cookie.contains(&token) && !cookie.contains("Secure"));
        let (session, _) = sessions.find(&with(&cookie)).unwrap();
        sessions.end(&with(&cookie));
        assert!(session.over.is_cancelled() && sessions.find(&with(&cookie)).is_none());
        let unknown = sessions.begin("a token that was taken back");
        assert!(sessions.find(&with(&unknown)).is_none());
        assert!(sessions.find(&HeaderMap::new()).is_none());
    }

    #[test]
    fn sessions_are_limited() {
        let dir = tempfile::tempdir().unwrap();
        let (sessions, token) = sessions(dir.path());
        let first = sessions.begin(&token);
        for _ in 0..MAX_SESSIONS {
            sessions.begin(&token);
        }
        assert_eq!(sessions.open().len(), MAX_SESSIONS);
        assert!(sessions.find(&with(&first)).is_none());
    }

    #[test]
    fn guessing_has_to_wait() {
        let dir = tempfile::tempdir().unwrap();
        let (sessions, _) = sessions(dir.path());
        for _ in 0..MAX_WRONG {
            assert!(!sessions.must_wait());
            sessions.count_wrong();
        }
        assert!(sessions.must_wait());
    }

    #[test]
    fn hosts_and_origins() {
        for (name, own) in [("localhost:1", true), ("127.0.0.1:7878", true), ("[::1]:9", true)]
            .into_iter()
            .chain([("example.org", false), ("127.0.0.1.example.org:7878", false), ("192.168.0.2:1", false)])
        {
            assert_eq!(is_loopback(&name.parse().unwrap()), own, "{name}");
        }
        let ask = |host: &str, origin: Option<&str>| {
            let mut request = Request::builder().uri("/api/socket").header(header::HOST, host);
            if let Some(origin) = origin {
                request = request.header(header::ORIGIN, origin);
            }
            is_own_page(&request.body(Body::empty()).unwrap())
        };
        assert!(ask("localhost:7878", Some("http://localhost:7878")));
        assert!(!ask("localhost:7878", Some("http://localhost:7879")));
        assert!(!ask("localhost:7878", Some("null")) && !ask("localhost:7878", None));
    }
}
