//! Owns the page's WebSocket: what is asked for, what is sent, and why it closes.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use futures::stream::{SplitSink, SplitStream};
use futures::{SinkExt as _, StreamExt as _};
use tokio::sync::{mpsc, watch};
use tokio::time::{MissedTickBehavior, interval, timeout};
use tokio_util::task::AbortOnDropHandle;

use crate::error::Error;
use crate::farm::Shared;
use crate::page::Page;
use crate::page::jobs::{tell_frames, tell_jobs};
use crate::page::messages::{Ask, Probe, Tell};
use crate::page::pixels::{answer_probes, send_tiles};
use crate::page::session::{Session, Sessions, is_own_page, not_logged_in, problem};
use crate::telemetry::counts::Ongoing;

/// What both sides speak.
const PROTOCOL: &str = "karst.page.v1";
/// Longest question.
const MAX_QUESTION: usize = 4096;
/// A page that takes nothing for so long is closed.
const PATIENCE: Duration = Duration::from_secs(30);
/// How often the server looks whether page and token are still there. A page answers by itself.
const HEARTBEAT: Duration = Duration::from_secs(10);
/// Messages in flight.
const IN_FLIGHT: usize = 4;

/// Why a socket closes, with what the page is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Farewell {
    /// The page has left.
    Gone,
    /// The server is ending.
    Ending,
    /// The session has ended.
    LoginAgain,
    /// The page takes nothing.
    Slow,
}

impl Farewell {
    fn frame(self) -> Option<CloseFrame> {
        let (code, reason) = match self {
            Self::Gone => return None,
            Self::Ending => (1001, "the server is ending"),
            Self::LoginAgain => (4401, "the session has ended"),
            Self::Slow => (4408, "nothing was taken for 30 s"),
        };
        Some(CloseFrame { code, reason: reason.into() })
    }
}

/// Where messages go.
#[derive(Debug, Clone)]
pub(super) struct Outlet {
    sender: mpsc::Sender<Message>,
}

/// Why nothing more is told.
#[derive(Debug)]
pub(super) enum Ended {
    /// The socket has closed.
    Closed,
    /// It cannot be told.
    Error(Error),
}

impl From<Error> for Ended {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl Outlet {
    /// Sends a message when the page has room for it.
    pub(super) async fn send(&self, message: Message) -> Result<(), Ended> {
        self.sender.send(message).await.map_err(|_| Ended::Closed)
    }
}

pub(super) async fn open(State(page): State<Page>, upgrade: WebSocketUpgrade, request: Request) -> Response {
    if !is_own_page(&request) {
        let hint = "open the page of this server itself";
        return problem(StatusCode::FORBIDDEN, "another page asked for the socket", hint);
    }
    let Some((session, _)) = page.sessions.find(request.headers()) else { return not_logged_in() };
    let sockets = page.sockets.clone();
    upgrade
        .protocols([PROTOCOL])
        .max_message_size(MAX_QUESTION)
        .max_frame_size(MAX_QUESTION)
        .on_upgrade(move |socket| sockets.track_future(serve(socket, page, session)))
}

async fn serve(socket: WebSocket, page: Page, session: Session) {
    let _counted = Ongoing::new(&page.shared.telemetry.counts.page_sockets);
    let (mut sink, stream) = socket.split();
    let (sender, mut messages) = mpsc::channel(IN_FLIGHT);
    let outlet = Outlet { sender };
    let farewell = tokio::select! {
        farewell = write(&mut sink, &mut messages) => farewell,
        () = read(stream, Desk::new(&page.shared, &outlet)) => Farewell::Gone,
        () = watch_over(&page.sessions, &session, &outlet) => Farewell::LoginAgain,
        () = page.shared.ending.cancelled() => Farewell::Ending,
    };
    let goodbye = Message::Close(farewell.frame());
    // A page that takes nothing does not take this either.
    let _ = timeout(Duration::from_secs(1), sink.send(goodbye)).await;
}

async fn write(sink: &mut SplitSink<WebSocket, Message>, messages: &mut mpsc::Receiver<Message>) -> Farewell {
    while let Some(message) = messages.recv().await {
        match timeout(PATIENCE, sink.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) => return Farewell::Gone,
            Err(_) => return Farewell::Slow,
        }
    }
    Farewell::Gone
}

/// Does what the page asks for until it leaves, or until nothing, not even the answer to a ping, comes from it.
async fn read(mut stream: SplitStream<WebSocket>, mut desk: Desk) {
    while let Ok(Some(Ok(message))) = timeout(PATIENCE + HEARTBEAT, stream.next()).await {
        match message {
            Message::Text(text) => desk.ask(&text).await,
            Message::Binary(_) => desk.complain("expected a JSON text, found bytes").await,
            Message::Ping(_) | Message::Pong(_) => {}
            Message::Close(_) => return,
        }
    }
}

/// Resolves when the session has ended; until then pings the page.
async fn watch_over(sessions: &Sessions, session: &Session, outlet: &Outlet) {
    let mut beat = interval(HEARTBEAT);
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            () = session.over.cancelled() => return,
            _ = beat.tick() => {}
        }
        if sessions.role(session).is_none() {
            return;
        }
        // A page with a full queue is alive, or found out by who writes to it.
        let _ = outlet.sender.try_send(Message::Ping(Bytes::new()));
    }
}

type Task = AbortOnDropHandle<()>;

/// What is being done for one page.
struct Desk {
    shared: Arc<Shared>,
    outlet: Outlet,
    questions: watch::Sender<Option<Probe>>,
    tiles: Option<Task>,
    frames: Option<Task>,
    /// The list of jobs, and the probe.
    _always: [Task; 2],
}

impl Desk {
    fn new(shared: &Arc<Shared>, outlet: &Outlet) -> Self {
        let (questions, asked) = watch::channel(None);
        let jobs =
            spawn(
                shared,
                outlet,
                None,
                move |shared, outlet| async move { tell_jobs(&shared, &outlet).await },
            );
        let probe = spawn(shared, outlet, None, move |shared, outlet| async move {
            answer_probes(&shared, asked, &outlet).await
        });
        Self {
            shared: Arc::clone(shared),
            outlet: outlet.clone(),
            questions,
            tiles: None,
            frames: None,
            _always: [jobs, probe],
        }
    }

    async fn ask(&mut self, text: &str) {
        let (shared, outlet) = (&self.shared, &self.outlet);
        match serde_json::from_str(text) {
            Ok(Ask::Watch(watch)) => {
                // The old one ends before the new one begins, so that their tiles do not mix.
                self.tiles = None;
                let number = Some(watch.number);
                let send = move |shared: Arc<Shared>, outlet: Outlet| async move {
                    send_tiles(&shared, &watch, &outlet).await
                };
                self.tiles = Some(spawn(shared, outlet, number, send));
            }
            Ok(Ask::Unwatch) => self.tiles = None,
            Ok(Ask::Frames { job }) => {
                self.frames = None;
                let tell = move |shared: Arc<Shared>, outlet: Outlet| async move {
                    tell_frames(&shared, &job, &outlet).await
                };
                self.frames = Some(spawn(shared, outlet, None, tell));
            }
            Ok(Ask::Probe(probe)) => drop(self.questions.send_replace(Some(probe))),
            Err(e) => self.complain(&format!("not a question of {PROTOCOL}: {e}")).await,
        }
    }

    async fn complain(&self, error: &str) {
        let hint = "load the page again".to_owned();
        let _ = self.outlet.send(Tell::Error { watch: None, error: error.to_owned(), hint }.into()).await;
    }
}

/// Does something for the page beside the rest; when it cannot be done the page is told.
fn spawn<F>(
    shared: &Arc<Shared>,
    outlet: &Outlet,
    watch: Option<u32>,
    work: impl FnOnce(Arc<Shared>, Outlet) -> F,
) -> Task
where
    F: Future<Output = Result<(), Ended>> + Send + 'static,
{
    let done = work(Arc::clone(shared), outlet.clone());
    let outlet = outlet.clone();
    AbortOnDropHandle::new(tokio::spawn(async move {
        if let Err(Ended::Error(e)) = done.await {
            let hint = String::new();
            let _ = outlet.send(Tell::Error { watch, error: e.to_string(), hint }.into()).await;
        }
    }))
}
