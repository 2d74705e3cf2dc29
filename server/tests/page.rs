//! The live page's side of the port: who gets in, and what comes over the WebSocket.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::collections::BTreeMap;
use std::time::Duration;

use futures::{SinkExt as _, StreamExt as _};
use karst_core::scene::Overrides;
use karst_server::door::{Role, line, new_token};
use serde_json::{Value, json};
use support::{TestServer, fading, render_locally, request_id, scene_text};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

const SAMPLING: &str = r#"{"spp": 8}"#;
const SIZE: (u32, u32) = (70, 50);

/// Sends a request as it stands, with the usual headers; the whole answer.
async fn http(server: &TestServer, first: &str, headers: &str, body: &str) -> String {
    let address = server.url.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(address).await.unwrap();
    let host = if headers.contains("Host:") { String::new() } else { format!("Host: {address}\r\n") };
    let length = body.len();
    let request = format!(
        "{first} HTTP/1.1\r\n{host}{headers}Connection: close\r\nContent-Length: {length}\r\n\r\n{body}"
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer
}

fn code(answer: &str) -> u16 {
    answer.split(' ').nth(1).unwrap().parse().unwrap()
}

/// Logs in; the cookie.
async fn login(server: &TestServer, token: &str) -> String {
    let answer = http(server, "POST /api/login", "X-Karst: 1\r\n", token).await;
    assert_eq!(code(&answer), 204, "{answer}");
    let cookie = answer.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
    cookie.split(';').next().unwrap().to_owned()
}

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

async fn open(server: &TestServer, cookie: &str, host: &str, origin: &str) -> Result<Socket, Error> {
    let mut request = format!("{}/api/socket", server.url.replace("http", "ws")).into_client_request()?;
    let headers = request.headers_mut();
    headers.insert("Cookie", HeaderValue::from_str(cookie).unwrap());
    headers.insert("Host", HeaderValue::from_str(host).unwrap());
    headers.insert("Origin", HeaderValue::from_str(origin).unwrap());
    headers.insert("Sec-WebSocket-Protocol", HeaderValue::from_static("karst.page.v1"));
    Ok(connect_async(request).await?.0)
}

/// A page that is logged in with the local token.
async fn page(server: &TestServer) -> (Socket, String) {
    let cookie = login(server, &server.token).await;
    let host = server.url.strip_prefix("http://").unwrap().to_owned();
    (open(server, &cookie, &host, &server.url).await.unwrap(), cookie)
}

/// The next message that is not a ping.
async fn next(socket: &mut Socket) -> Message {
    loop {
        let message = tokio::time::timeout(Duration::from_mins(1), socket.next()).await;
        let message = message.expect("something comes").expect("the socket is open").unwrap();
        if !matches!(message, Message::Ping(_)) {
            return message;
        }
    }
}

/// The next text of this type; others are left out.
async fn told(socket: &mut Socket, kind: &str) -> Value {
    loop {
        if let Message::Text(text) = next(socket).await {
            let value: Value = serde_json::from_str(&text).unwrap();
            if value["type"] == kind {
                return value;
            }
        }
    }
}

async fn ask(socket: &mut Socket, question: Value) {
    socket.send(Message::text(question.to_string())).await.unwrap();
}

/// The states in a list of frames.
fn states(message: &Value) -> Vec<(i64, Value)> {
    let frames = message["frames"].as_array().unwrap().iter();
    frames.map(|frame| (frame["frame"].as_i64().unwrap(), frame["state"].clone())).collect()
}

/// The code with which the server closes.
async fn closed(socket: &mut Socket) -> u16 {
    loop {
        if let Message::Close(frame) = next(socket).await {
            return frame.unwrap().code.into();
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_files_are_there_for_everybody_and_keep_to_their_server() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 0).await;
    let index = http(&server, "GET /", "", "").await;
    assert!(index.contains("content-type: text/html") && index.contains("frame-ancestors 'none'"), "{index}");
    let module = http(&server, "GET /page/main.js", "", "").await;
    assert!(module.contains("content-type: text/javascript; charset=utf-8"), "{module}");
    for path in ["/page/nope.js", "/page/..%2fcheck.py", "/page/check.py", "/elsewhere"] {
        assert_eq!(code(&http(&server, &format!("GET {path}"), "", "").await), 404, "{path}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_who_may_look_gets_in() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 0).await;
    let own = server.url.strip_prefix("http://").unwrap().to_owned();
    let (view, work) = (new_token(), new_token());
    let lines = [line(Role::View, "eve", &view), line(Role::Work, "farm", &work)];
    std::fs::write(dir.path().join("tokens"), lines.join("\n")).unwrap();

    let refused = http(&server, "POST /api/login", "X-Karst: 1\r\n", "wrong").await;
    assert!(code(&refused) == 401 && refused.contains("not known here"), "{refused}");
    let refused = http(&server, "POST /api/login", "X-Karst: 1\r\n", &work).await;
    assert!(code(&refused) == 401 && refused.contains("has the role work"), "{refused}");
    assert_eq!(code(&http(&server, "POST /api/login", "", &view).await), 403, "without the header");
    let foreign = "Host: example.org\r\nX-Karst: 1\r\n";
    assert_eq!(code(&http(&server, "POST /api/login", foreign, &view).await), 403);
    assert_eq!(code(&http(&server, "POST /api/login", "X-Karst: 1\r\n", &"x".repeat(9999)).await), 413);
    assert_eq!(code(&http(&server, "GET /api/session", "", "").await), 401);

    let cookie = login(&server, &view).await;
    let session = http(&server, "GET /api/session", &format!("Cookie: {cookie}\r\n"), "").await;
    assert!(session.contains(r#""role":"view""#), "{session}");
    for (cookie, host, origin, expected) in [
        ("", own.as_str(), server.url.as_str(), 401),
        ("karst-0=1", &own, &server.url, 401),
        (&cookie, &own, "http://example.org", 403),
        (&cookie, &own, "http://127.0.0.1:1", 403),
        (&cookie, "example.org", "http://example.org", 403),
    ] {
        match open(&server, cookie, host, origin).await {
            Err(Error::Http(answer)) => assert_eq!(answer.status(), expected, "{host} {origin}"),
            other => panic!("{host} {origin}: {other:?}"),
        }
    }
    let mut socket = open(&server, &cookie, &own, &server.url).await.unwrap();
    assert_eq!(told(&mut socket, "jobs").await["jobs"], json!([]));
    // A token that is taken back ends what was begun with it.
    std::fs::remove_file(dir.path().join("tokens")).unwrap();
    assert_eq!(closed(&mut socket).await, 4401);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_that_says_nothing_is_closed() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 0).await;
    let address = server.url.strip_prefix("http://").unwrap();
    let mut silent = TcpStream::connect(address).await.unwrap();
    let mut half = TcpStream::connect(address).await.unwrap();
    half.write_all(b"GET / HTTP/1.1\r\nHost: local").await.unwrap();
    let mut rest = Vec::new();
    for stream in [&mut silent, &mut half] {
        let end = tokio::time::timeout(Duration::from_secs(30), stream.read_to_end(&mut rest)).await;
        end.expect("the server closes it").unwrap();
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_are_for_those_who_may_look() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 0).await;
    let work = new_token();
    std::fs::write(dir.path().join("tokens"), line(Role::Work, "farm", &work)).unwrap();
    let (socket, _) = page(&server).await;
    let ask = async |token: &str| {
        http(&server, "GET /metrics", &format!("Authorization: Bearer {token}\r\n"), "").await
    };
    let found = ask(&server.token).await;
    assert!(found.contains("content-type: text/plain; version=0.0.4"), "{found}");
    assert!(found.contains("\nkarst_page_sockets 1\n"), "{found}");
    assert_eq!(code(&ask(&work).await), 403);
    assert_eq!(code(&ask("wrong").await), 401);
    assert_eq!(code(&http(&server, "GET /metrics", "", "").await), 401);
    drop(socket);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_sees_a_job_from_its_first_tile_to_its_last() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let (mut socket, _) = page(&server).await;
    assert_eq!(told(&mut socket, "jobs").await["jobs"], json!([]));
    let mut client = server.client().await;
    let text = scene_text(SIZE, SAMPLING, &fading(2));
    let spec = client.spec(&text).await;
    let id = client.submit(&request_id("page"), &spec).await.unwrap().id;
    let listed = told(&mut socket, "jobs").await["jobs"][0].clone();
    assert_eq!((&listed["id"], &listed["frames_total"]), (&json!(id), &json!(2)));

    ask(&mut socket, json!({"type": "frames", "job": id})).await;
    ask(
        &mut socket,
        json!({"type": "watch", "watch": 3, "job": id, "frame": 2, "layer": "Color", "level": 0}),
    )
    .await;
    let (mut frames, mut info, mut tiles) = (BTreeMap::new(), None, BTreeMap::new());
    loop {
        let message = next(&mut socket).await;
        if let Message::Binary(bytes) = message {
            assert!(info.is_some(), "the frame is described before its first tile");
            let number = |i: usize| u32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap());
            assert_eq!((number(0), bytes.len() as u32), (3, 32 + 6 * number(5) * number(6)));
            tiles.insert((number(1), number(2), number(3), number(4)), bytes);
            continue;
        }
        let message: Value = serde_json::from_str(message.to_text().unwrap()).unwrap();
        match message["type"].as_str().unwrap() {
            "frame" => info = Some(message),
            "end" => break,
            "frames" => frames.extend(states(&message)),
            "jobs" | "progress" => {}
            other => panic!("{other}: {message}"),
        }
    }
    let info = info.unwrap();
    assert_eq!((&info["window"], &info["spp_goal"]), (&json!([0, 0, SIZE.0, SIZE.1]), &json!(8)));
    client.finish(&id).await;
    while frames.get(&2) != Some(&json!("Finished")) {
        frames.extend(states(&told(&mut socket, "frames").await));
    }
    assert_eq!(frames.len(), 2);

    // Every pixel once, rounded from the floats that a local render has.
    let exact = render_locally(&text, 2, &Overrides::default(), 32);
    let mut seen = 0;
    for ((x0, y0, x1, y1), bytes) in &tiles {
        for (i, (y, x)) in (*y0..*y1).flat_map(|y| (*x0..*x1).map(move |x| (y, x))).enumerate() {
            let place = ((y * SIZE.0 + x) * 3) as usize;
            let expected =
                karst_proto::convert::rgb_f16(std::iter::once(exact[place..place + 3].try_into().unwrap()));
            assert_eq!(bytes[32 + 6 * i..38 + 6 * i], expected, "pixel {x} {y}");
            seen += 1;
        }
    }
    assert_eq!(seen, SIZE.0 * SIZE.1);

    // The probe has the floats themselves.
    for (number, (x, y)) in [(1, (0, 0)), (2, (35, 25)), (3, (69, 49))] {
        let question = json!({"type": "probe", "probe": number, "job": id, "frame": 2, "x": x, "y": y});
        ask(&mut socket, question).await;
        let answer = told(&mut socket, "probe").await;
        let place = ((y * SIZE.0 + x) * 3) as usize;
        let found = [0, 1, 2].map(|c| answer["values"]["Color"][c].as_f64().unwrap() as f32);
        assert_eq!(found, exact[place..place + 3], "{answer}");
        assert_eq!((&answer["probe"], &answer["values"]["Samples"]), (&json!(number), &json!([8.0])));
    }
    ask(&mut socket, json!({"type": "probe", "probe": 4, "job": id, "frame": 2, "x": 70, "y": 0})).await;
    assert!(told(&mut socket, "probe").await["error"].is_string());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn senseless_questions_are_answered_and_the_end_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 0).await;
    let (mut socket, cookie) = page(&server).await;
    let watch = json!({"type": "watch", "watch": 9, "job": "nope", "frame": 1, "layer": "Color", "level": 0});
    for (question, number) in [
        (json!({"type": "dance"}), Value::Null),
        (json!([1, 2]), Value::Null),
        (json!({"type": "watch", "watch": 1}), Value::Null),
        (json!({"type": "frames", "job": "nope"}), Value::Null),
        (watch, json!(9)),
    ] {
        ask(&mut socket, question.clone()).await;
        let answer = told(&mut socket, "error").await;
        assert!(answer["watch"] == number && answer["error"].is_string(), "{question}: {answer}");
    }
    let answer = http(&server, "POST /api/logout", &format!("X-Karst: 1\r\nCookie: {cookie}\r\n"), "").await;
    assert_eq!(code(&answer), 204);
    assert_eq!(closed(&mut socket).await, 4401);

    // A question without end closes the socket, and nothing else.
    let (mut long, _) = page(&server).await;
    let _ = long.send(Message::text("x".repeat(100_000))).await;
    while let Some(Ok(message)) = long.next().await {
        assert!(!matches!(message, Message::Text(text) if text.contains("error")));
    }
    let (mut last, _) = page(&server).await;
    told(&mut last, "jobs").await;
    let stopped = tokio::spawn(server.stop());
    assert_eq!(closed(&mut last).await, 1001);
    drop(last);
    stopped.await.unwrap();
}
