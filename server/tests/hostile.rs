//! Bad input gets the right code, reason and path, and leaves the server unharmed.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use karst_proto::errors::violations;
use karst_proto::v1::upload_request::Part;
use karst_proto::v1::{self, JobState};
use support::{Client, TestServer, raw, refusal, request_id, scene_text};
use tokio::io::AsyncWriteExt;
use tonic::{Code, Status};

const SIZE: (u32, u32) = (64, 48);
const SPP: &str = r#"{"spp": 2}"#;

fn refused(code: Code, reason: &str) -> (Code, String) {
    (code, reason.to_owned())
}

/// The server still does its work.
async fn unharmed(server: TestServer) {
    let mut client = server.client().await;
    let spec = client.spec(&scene_text(SIZE, SPP, "")).await;
    let job = client.submit(&request_id("after"), &spec).await.unwrap().id;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    server.stop().await;
}

async fn server() -> (tempfile::TempDir, TestServer, Client) {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let client = server.client().await;
    (dir, server, client)
}

/// The paths that a refusal names.
fn fields(status: &Status) -> Vec<String> {
    violations(status).0.into_iter().map(|v| v.field).collect()
}

async fn submit_text(client: &mut Client, text: &str) -> Status {
    let spec = client.spec(text).await;
    client.submit(&request_id("bad"), &spec).await.expect_err("refused")
}

#[tokio::test(flavor = "multi_thread")]
async fn malformed_bytes() {
    let (_dir, server, client) = server().await;
    // Not HTTP at all, a torn HTTP/2 preface, and a preface followed by noise.
    let address = server.url.trim_start_matches("http://").to_owned();
    let noise: Vec<u8> = (0..4096_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for bytes in [&noise[..], b"GET / HTTP/1.1\r\n\r\n", b"PRI * HTTP/2.0\r\n\r", &[0; 100]] {
        let mut socket = tokio::net::TcpStream::connect(&address).await.unwrap();
        socket.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").await.unwrap();
        let _ = socket.write_all(bytes).await;
    }
    // Well-framed gRPC whose payload is not the message.
    for payload in [vec![0xff; 64], vec![0x0a, 0xff, 0xff, 0xff, 0xff, 0x7f], vec![0x12, 0x03, 0x01]] {
        let path = "/karst.v1.Jobs/SubmitJob";
        let status = raw::call(client.channel.clone(), path, payload).await.expect_err("not a message");
        assert!(matches!(status.code(), Code::Internal | Code::InvalidArgument), "{status:?}");
    }
    let status = raw::call(client.channel.clone(), "/karst.v1.Jobs/Nothing", vec![]).await.unwrap_err();
    assert_eq!(status.code(), Code::Unimplemented);
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn oversize_messages() {
    let (_dir, server, mut client) = server().await;
    let path = "/karst.v1.Jobs/SubmitJob";
    let status = raw::call(client.channel.clone(), path, vec![0; (1 << 20) + 1]).await.unwrap_err();
    assert_eq!(status.code(), Code::OutOfRange, "{status:?}");
    let digest = karst_server::digest::Digest::of(b"x").to_string();
    let start = Part::Start(v1::UploadStart { digest, total_size: 1 << 20, offset: 0 });
    let chunk = Part::Chunk(vec![0; 300_000].into());
    assert_eq!(
        refusal(client.send(vec![start, chunk]).await),
        refused(Code::InvalidArgument, "FIELD_INVALID")
    );
    let digests = vec!["0".repeat(64); 5000];
    let too_many = client.assets.find_missing(v1::FindMissingRequest { digests }).await;
    assert_eq!(refusal(too_many), refused(Code::InvalidArgument, "FIELD_INVALID"));
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn unknown_jobs_and_frames() {
    let (_dir, server, mut client) = server().await;
    let missing = refused(Code::NotFound, "JOB_NOT_FOUND");
    for job in ["nope", "", "../../etc/passwd", "'; DROP TABLE jobs; --", "\u{0}"] {
        let job = job.to_owned();
        let get = client.jobs.get_job(v1::GetJobRequest { job: job.clone() }).await;
        assert_eq!(refusal(get), missing);
        let cancel = client.jobs.cancel_job(v1::CancelJobRequest { job: job.clone() }).await;
        assert_eq!(refusal(cancel), missing);
        assert_eq!(refusal(client.watch(&job, "").await), missing);
        assert_eq!(refusal(client.collect(&job, 1).await), missing);
        assert_eq!(refusal(client.download(&job, 1, v1::FrameFormat::Exr, 0).await), missing);
        let list = v1::ListFramesRequest { job: job.clone(), ..Default::default() };
        assert_eq!(refusal(client.frames.list_frames(list).await), missing);
        let tiles = v1::StreamTilesRequest { job, ..Default::default() };
        assert_eq!(refusal(client.previews.stream_tiles(tiles).await.map(drop)), missing);
    }
    let spec = client.spec(&scene_text(SIZE, SPP, "")).await;
    let job = client.submit(&request_id("known"), &spec).await.unwrap().id;
    let missing = refused(Code::NotFound, "FRAME_NOT_FOUND");
    assert_eq!(refusal(client.collect(&job, 2).await), missing);
    assert_eq!(refusal(client.download(&job, -1, v1::FrameFormat::Exr, 0).await), missing);
    let tiles = |frames, level, layer| v1::StreamTilesRequest {
        job: job.clone(),
        frames,
        level,
        layer,
        ..Default::default()
    };
    let stream = |request| {
        let mut previews = client.previews.clone();
        async move { refusal(previews.stream_tiles(request).await.map(drop)) }
    };
    assert_eq!(stream(tiles(vec![1, 9], 0, 0)).await, missing);
    let wrong = refused(Code::InvalidArgument, "FIELD_INVALID");
    assert_eq!(stream(tiles(vec![], 9, 0)).await, wrong);
    assert_eq!(stream(tiles(vec![], 0, 77)).await, wrong);
    assert_eq!(stream(tiles((0..2000).collect(), 0, 0)).await, wrong);
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_digests_and_broken_uploads() {
    let (_dir, server, mut client) = server().await;
    let wrong = refused(Code::InvalidArgument, "FIELD_INVALID");
    let start = |digest: &str, total_size, offset| {
        Part::Start(v1::UploadStart { digest: digest.to_owned(), total_size, offset })
    };
    let chunk = |bytes: &[u8]| Part::Chunk(bytes.to_vec().into());
    for digest in ["", "abc", &"G".repeat(64), "../../../../etc/passwd", &"é".repeat(32)] {
        assert_eq!(refusal(client.send(vec![start(digest, 1, 0)]).await), wrong);
        let query = v1::QueryUploadRequest { digest: digest.to_owned() };
        assert_eq!(refusal(client.assets.query_upload(query).await), wrong);
        let find = v1::FindMissingRequest { digests: vec![digest.to_owned()] };
        assert_eq!(refusal(client.assets.find_missing(find).await), wrong);
    }
    let bytes = b"some bytes that are uploaded in two parts";
    let size = bytes.len() as u64;
    let digest = karst_server::digest::Digest::of(bytes).to_string();
    assert_eq!(refusal(client.send(vec![]).await), wrong, "no start");
    assert_eq!(refusal(client.send(vec![chunk(b"x")]).await), wrong, "chunk first");
    assert_eq!(refusal(client.send(vec![start(&digest, size, 0), chunk(b"")]).await), wrong, "empty chunk");
    let giant = client.send(vec![start(&digest, 100 << 40, 0)]).await;
    assert_eq!(refusal(giant), refused(Code::InvalidArgument, "LIMIT_EXCEEDED"));
    let late = client.send(vec![start(&digest, size, 7)]).await;
    assert_eq!(refusal(late), refused(Code::OutOfRange, "OFFSET_MISMATCH"));

    let half = client.send(vec![start(&digest, size, 0), chunk(&bytes[..20])]).await.unwrap();
    assert_eq!((half.committed_size, half.complete), (20, false));
    let long = client.send(vec![start(&digest, size, 20), chunk(&[0; 100])]).await;
    assert_eq!(refusal(long), wrong, "more than announced");
    let rest = client.send(vec![start(&digest, size, 20), chunk(&bytes[20..])]).await.unwrap();
    assert_eq!((rest.committed_size, rest.complete), (size, true));

    let lie = karst_server::digest::Digest::of(b"other").to_string();
    let poisoned = client.send(vec![start(&lie, size, 0), chunk(bytes)]).await;
    assert_eq!(refusal(poisoned), refused(Code::InvalidArgument, "DIGEST_MISMATCH"));
    let query = v1::QueryUploadRequest { digest: lie };
    let kept = client.assets.query_upload(query).await.unwrap().into_inner();
    assert_eq!((kept.committed_size, kept.complete), (0, false), "nothing is kept");
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_breaks_off_goes_on() {
    let (_dir, server, mut client) = server().await;
    let bytes: Vec<u8> = (0..600_000_u32).map(|i| (i % 251) as u8).collect();
    let digest = karst_server::digest::Digest::of(&bytes).to_string();
    let start = v1::UploadStart { digest: digest.clone(), total_size: bytes.len() as u64, offset: 0 };
    let (sender, receiver) = tokio::sync::mpsc::channel(4);
    let message = |part| v1::UploadRequest { part: Some(part) };
    sender.send(message(Part::Start(start))).await.unwrap();
    sender.send(message(Part::Chunk(bytes[..200_000].to_vec().into()))).await.unwrap();
    let mut assets = client.assets.clone();
    let call = tokio::spawn(async move {
        let _ = assets.upload(tokio_stream::wrappers::ReceiverStream::new(receiver)).await;
    });
    // Wait until it has come, then hang up without an end.
    let query = v1::QueryUploadRequest { digest: digest.clone() };
    let committed = loop {
        let answer = client.assets.query_upload(query.clone()).await.unwrap().into_inner();
        if answer.committed_size == 200_000 {
            break answer.committed_size;
        }
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    };
    let busy = client
        .send(vec![Part::Start(v1::UploadStart {
            digest: digest.clone(),
            total_size: 600_000,
            offset: committed,
        })])
        .await;
    assert_eq!(refusal(busy), refused(Code::Aborted, "UPLOAD_BUSY"));
    call.abort();
    drop(sender);
    let rest = loop {
        let start = v1::UploadStart { digest: digest.clone(), total_size: 600_000, offset: committed };
        let chunks = bytes[200_000..].chunks(250_000).map(|c| Part::Chunk(c.to_vec().into()));
        match client.send(std::iter::once(Part::Start(start)).chain(chunks).collect()).await {
            Err(status) if status.code() == Code::Aborted => tokio::task::yield_now().await,
            answer => break answer.unwrap(),
        }
    };
    assert!(rest.complete);
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_requests_name_their_fields() {
    let (_dir, server, mut client) = server().await;
    let good = client.spec(&scene_text(SIZE, SPP, "")).await;
    let settings = v1::RenderSettings {
        spp: Some(0),
        target_error: Some(f64::NAN),
        time_limit_seconds: Some(f64::INFINITY),
        size: Some(v1::Size { width: 0, height: 7 }),
        crop: Some(v1::Region { x0: 5, y0: 0, x1: 5, y1: 1 }),
        ..Default::default()
    };
    let bad = v1::JobSpec {
        display_name: "x".repeat(201),
        settings: Some(settings),
        tile_size: 100,
        frames: Some(v1::FrameRange { first: 2, last: 1, step: 1 }),
        ..good.clone()
    };
    let status = client.submit("id", &bad).await.unwrap_err();
    let named = fields(&status);
    let expected = ["display_name", "tile_size", "frames.last", "settings.spp", "settings.target_error"];
    for field in expected {
        assert!(named.contains(&format!("job.{field}")), "{field} in {named:?}");
    }
    assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "FIELD_INVALID"));
    for id in ["", "no spaces", "ü", &"x".repeat(65)] {
        assert_eq!(fields(&client.submit(id, &good).await.unwrap_err()), ["request_id"]);
    }
    let outside = v1::JobSpec { frames: Some(v1::FrameRange { first: 1, last: 2, step: 1 }), ..good.clone() };
    assert_eq!(fields(&client.submit("a", &outside).await.unwrap_err()), ["job.frames"]);
    let empty = v1::SubmitJobRequest { request_id: "b".to_owned(), validate_only: false, job: None };
    assert_eq!(fields(&client.jobs.submit_job(empty).await.unwrap_err()), ["job"]);
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn missing_blobs_and_paths_that_lead_out() {
    let (_dir, server, mut client) = server().await;
    let good = client.spec(&scene_text(SIZE, SPP, "")).await;
    let absent = karst_server::digest::Digest::of(b"never uploaded").to_string();
    let mut spec = good.clone();
    spec.scene.as_mut().unwrap().files[0].digest = absent.clone();
    let status = client.submit("a", &spec).await.unwrap_err();
    let details = tonic_types::StatusExt::get_details_precondition_failure(&status).unwrap();
    assert_eq!(details.violations[0].r#type, "MISSING");
    assert_eq!(details.violations[0].subject, format!("blobs/{absent}"));
    assert_eq!(refusal(Err::<(), _>(status)), refused(Code::FailedPrecondition, "BLOBS_MISSING"));

    let mut spec = good.clone();
    spec.scene.as_mut().unwrap().files.clear();
    let status = client.submit("b", &spec).await.unwrap_err();
    assert!(status.message().contains("meshes/floor.obj"), "{status:?}");
    assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "SCENE_INVALID"));

    for path in ["../floor.obj", "/etc/passwd", "a/../../b", "C:\\x", "a\\..\\b", "", "x\u{0}y"] {
        let mut spec = good.clone();
        spec.scene.as_mut().unwrap().files[0].path = path.to_owned();
        let status = client.submit("c", &spec).await.unwrap_err();
        assert_eq!(fields(&status), ["job.scene.files[0].path"], "{path}");
        let text = scene_text(SIZE, SPP, "").replace(support::FLOOR_PATH, &path.escape_default().to_string());
        let spec = client.spec(&text).await;
        let status = client.submit("d", &spec).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument, "{path}: {status:?}");
    }
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_scenes_name_their_places() {
    let (_dir, server, mut client) = server().await;
    let good = scene_text(SIZE, SPP, "");
    let cases = [
        (r#""vfov": 40"#, r#""vfov": 1e999"#, "camera.vfov"),
        (r#""vfov": 40"#, r#""vfov": -3"#, "camera.vfov"),
        (r#""width": 64"#, r#""width": 0"#, "film.width"),
        (r#""radius": 0.7"#, r#""radius": "big""#, "spheres.ball.radius"),
        (r#""spp": 2"#, r#""ssp": 2"#, "sampling"),
    ];
    for (from, to, path) in cases {
        assert!(good.contains(from), "{from}");
        let status = submit_text(&mut client, &good.replacen(from, to, 1)).await;
        let named = fields(&status);
        assert!(named.iter().any(|f| f.contains(path)), "{to}: {named:?}");
        assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "SCENE_INVALID"));
    }
    for text in ["", "{", "NaN", "[]", "{\"version\": 7}", &"[".repeat(100_000), "\u{feff}{}"] {
        let status = submit_text(&mut client, text).await;
        assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "SCENE_INVALID"));
    }
    let spec = client.spec("not a scene").await;
    let binary = client.upload(&[0xff, 0xfe, 0x00]).await;
    let scene = Some(v1::Scene { digest: binary, files: vec![] });
    let status = client.submit("e", &v1::JobSpec { scene, ..spec }).await.unwrap_err();
    assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "SCENE_INVALID"));
    let mesh = client.upload(b"v 1 2 nan\nf 1 2 3\n").await;
    let mut spec = client.spec(&good).await;
    spec.scene.as_mut().unwrap().files[0].digest = mesh;
    let status = client.submit("f", &spec).await.unwrap_err();
    assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "SCENE_INVALID"));
    unharmed(server).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_giant_film_is_refused_before_memory_is_taken() {
    let (_dir, server, mut client) = server().await;
    let before = peak_kib();
    let status = submit_text(&mut client, &scene_text((65536, 32768), SPP, "")).await;
    assert_eq!(status.code(), Code::InvalidArgument, "{status:?}");
    let good = client.spec(&scene_text(SIZE, SPP, "")).await;
    for (width, height) in [(65536, 32768), (u32::MAX, u32::MAX), (1 << 31, 1)] {
        let size = Some(v1::Size { width, height });
        let settings = Some(v1::RenderSettings { size, ..Default::default() });
        let status = client.submit("g", &v1::JobSpec { settings, ..good.clone() }).await.unwrap_err();
        assert_eq!(fields(&status)[0], "job.settings.size");
        assert_eq!(refusal(Err::<(), _>(status)), refused(Code::InvalidArgument, "FIELD_INVALID"));
    }
    let crop = Some(v1::Region { x0: 0, y0: 0, x1: 9999, y1: 1 });
    let settings = Some(v1::RenderSettings { crop, ..Default::default() });
    let status = client.submit("h", &v1::JobSpec { settings, ..good.clone() }).await.unwrap_err();
    assert_eq!(fields(&status), ["job.settings.crop"]);
    let taken = peak_kib().saturating_sub(before);
    assert!(taken < 256 << 10, "{taken} KiB more at the peak");
    unharmed(server).await;
}

/// Most memory that this process has had, in KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|l| l.starts_with("VmHWM")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}
