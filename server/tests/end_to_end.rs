//! A real server on port 0, real calls: pictures have the bits of a local render, and calls keep their promises.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::collections::BTreeMap;

use karst_core::encode::read_exr;
use karst_core::scene::Overrides;
use karst_proto::v1::{self, FrameFormat, FrameState, JobState, job_event};
use support::{TestServer, fading, hash, refusal, render_locally, request_id, scene_text};
use tonic::Code;

const SIZE: (u32, u32) = (100, 60);

#[tokio::test(flavor = "multi_thread")]
async fn pixels_have_the_same_bits_over_tile_sizes_workers_and_ways() {
    let text = scene_text(SIZE, r#"{"spp": 10, "seed": 3}"#, "");
    let local: Vec<_> = [16, 32, 64, 96]
        .iter()
        .map(|&tile_size| hash(&render_locally(&text, 1, &Overrides::default(), tile_size)))
        .collect();
    assert!(local.iter().all(|h| *h == local[0]), "local: {local:?}");
    for workers in [1, 2, 3] {
        let dir = tempfile::tempdir().unwrap();
        let server = TestServer::start(dir.path(), workers).await;
        let mut client = server.client().await;
        let spec = client.spec(&text).await;
        for tile_size in [16, 32, 64, 96] {
            let spec = v1::JobSpec { tile_size, ..spec.clone() };
            let job = client.submit(&request_id("bits"), &spec).await.unwrap().id;
            assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
            let pixels = client.collect(&job, 1).await.unwrap();
            assert_eq!(hash(&pixels), local[0], "{workers} workers, tiles of {tile_size}");
            let (_, exr) = client.download(&job, 1, FrameFormat::Exr, 0).await.unwrap();
            let image = read_exr(&exr).unwrap();
            let planes = ["R", "G", "B"].map(|name| image.channel(name).unwrap());
            let stored: Vec<f32> = (0..planes[0].len()).flat_map(|i| planes.map(|p| p[i])).collect();
            assert_eq!(hash(&stored), local[0], "the EXR of {workers} workers, tiles of {tile_size}");
        }
        server.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn adaptive_frames_crops_and_settings_have_the_same_bits() {
    let text = scene_text(SIZE, r#"{"target_error": 0.08, "min_spp": 8, "max_spp": 64}"#, "");
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&text).await;
    let crop = v1::Region { x0: 17, y0: 5, x1: 90, y1: 55 };
    let size = v1::Size { width: 128, height: 64 };
    let settings =
        v1::RenderSettings { seed: Some(9), size: Some(size), crop: Some(crop), ..Default::default() };
    let spec = v1::JobSpec { settings: Some(settings), tile_size: 32, ..spec };
    let job = client.submit(&request_id("adaptive"), &spec).await.unwrap().id;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    let overrides = karst_proto::convert::settings_from_wire(&settings).unwrap();
    let local = render_locally(&text, 1, &overrides, 64);
    assert_eq!(hash(&client.collect(&job, 1).await.unwrap()), hash(&local));
    let frame = client.frame_list(&job).await.remove(0);
    assert!(frame.rel_mse.is_some() && frame.rounds_finished > 1, "{frame:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_animation_renders_every_frame_and_tells_everything_once() {
    let text = scene_text(SIZE, r#"{"spp": 4}"#, &fading(5));
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&text).await;
    let frames = Some(v1::FrameRange { first: 1, last: 5, step: 2 });
    let job = client.submit(&request_id("film"), &v1::JobSpec { frames, ..spec }).await.unwrap();
    assert_eq!((job.state(), job.frames_total), (JobState::Queued, 3));
    let (events, last) = client.watch(&job.id, "").await.unwrap();
    assert_eq!((last.state(), last.frames_finished), (JobState::Succeeded, 3));
    let first = events[0].revision;
    let revisions: Vec<u64> = events.iter().map(|e| e.revision).collect();
    assert_eq!(revisions, (first..first + events.len() as u64).collect::<Vec<_>>());

    let mut rounds: BTreeMap<i32, Vec<u32>> = BTreeMap::new();
    for event in &events {
        if let Some(job_event::Event::Round(round)) = &event.event {
            rounds.entry(round.frame).or_default().push(round.round);
        }
    }
    for frame in client.frame_list(&job.id).await {
        assert_eq!((frame.state(), frame.spp), (FrameState::Finished, 4.0));
        assert_eq!(rounds[&frame.frame], (0..frame.rounds_finished).collect::<Vec<_>>());
        let local = render_locally(&text, frame.frame, &Overrides::default(), 64);
        assert_eq!(hash(&client.collect(&job.id, frame.frame).await.unwrap()), hash(&local));
        let samples = u64::from(SIZE.0 * SIZE.1 * 4);
        assert_eq!(frame.statistics.unwrap().samples, samples);
    }
    // From any token the rest comes without gap.
    let middle = events.len() / 2;
    let (rest, _) = client.watch(&job.id, &events[middle].resume_token).await.unwrap();
    assert_eq!(rest, events[middle + 1..]);
    let other = client.watch(&job.id, "watch-elsewhere-3").await;
    assert_eq!(refusal(other), (Code::InvalidArgument, "TOKEN_INVALID".to_owned()));
    server.stop().await;
}

/// The second job passes through the film that is the first one's last; throwing its own away must not take the
/// other's along.
#[tokio::test(flavor = "multi_thread")]
async fn jobs_with_the_same_bytes_do_not_disturb_each_other() {
    let text = scene_text(SIZE, r#"{"spp": 8}"#, "");
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&text).await;
    let first = client.submit(&request_id("first"), &spec).await.unwrap().id;
    client.finish(&first).await;
    let pixels = client.collect(&first, 1).await.unwrap();
    let settings = Some(v1::RenderSettings { spp: Some(64), ..Default::default() });
    let more = client.submit(&request_id("more"), &v1::JobSpec { settings, ..spec }).await.unwrap().id;
    client.finish(&more).await;
    assert_eq!(hash(&client.collect(&first, 1).await.unwrap()), hash(&pixels));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_makes_one_job_even_over_a_restart() {
    let text = scene_text(SIZE, r#"{"spp": 2}"#, "");
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let mut client = server.client().await;
    let spec = client.spec(&text).await;
    let (mut twin, twin_spec) = (client.clone(), spec.clone());
    let (one, two) = tokio::join!(client.submit("same", &spec), twin.submit("same", &twin_spec));
    let id = one.unwrap().id;
    assert_eq!(two.unwrap().id, id, "at the same time");
    let other = v1::JobSpec { display_name: "other".to_owned(), ..spec.clone() };
    let reused = (Code::InvalidArgument, "REQUEST_ID_REUSED".to_owned());
    assert_eq!(refusal(client.submit("same", &other).await), reused);
    client.finish(&id).await;
    server.stop().await;

    let server = TestServer::start(dir.path(), 1).await;
    let mut client = server.client().await;
    assert_eq!(client.submit("same", &spec).await.unwrap().id, id);
    assert_eq!(refusal(client.submit("same", &other).await), reused);
    assert_eq!(client.collect(&id, 1).await.unwrap().len(), (SIZE.0 * SIZE.1 * 3) as usize);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn validate_only_stores_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let mut client = server.client().await;
    let spec = client.spec(&scene_text(SIZE, r#"{"spp": 2}"#, &fading(7))).await;
    let request = v1::SubmitJobRequest { request_id: "dry".to_owned(), validate_only: true, job: Some(spec) };
    let job = client.jobs.submit_job(request).await.unwrap().into_inner();
    assert_eq!((job.id.as_str(), job.state(), job.frames_total), ("", JobState::Unspecified, 7));
    let jobs = client.jobs.list_jobs(v1::ListJobsRequest::default()).await.unwrap().into_inner().jobs;
    assert_eq!(jobs, []);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_are_listed_in_pages_and_cancelled() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let mut client = server.client().await;
    let long = client.spec(&scene_text((400, 300), r#"{"spp": 100000}"#, &fading(3))).await;
    let mut ids = Vec::new();
    for _ in 0..3 {
        ids.push(client.submit(&request_id("long"), &long).await.unwrap().id);
    }
    let page =
        |page_token: String, states: Vec<i32>| v1::ListJobsRequest { page_size: 2, page_token, states };
    let first = client.jobs.list_jobs(page(String::new(), vec![])).await.unwrap().into_inner();
    let second = client.jobs.list_jobs(page(first.next_page_token, vec![])).await.unwrap().into_inner();
    let listed: Vec<_> = first.jobs.iter().chain(&second.jobs).map(|j| j.id.clone()).collect();
    assert_eq!(listed, ids.iter().rev().cloned().collect::<Vec<_>>(), "the newest first");
    let wrong = client.jobs.list_jobs(page("7".to_owned(), vec![])).await;
    assert_eq!(refusal(wrong), (Code::InvalidArgument, "TOKEN_INVALID".to_owned()));

    let cancel = |job: &str| v1::CancelJobRequest { job: job.to_owned() };
    for id in &ids {
        let job = client.jobs.cancel_job(cancel(id)).await.unwrap().into_inner();
        assert_eq!(job.state(), JobState::Cancelled);
        let again = client.jobs.cancel_job(cancel(id)).await.unwrap().into_inner();
        assert_eq!(again.finished_at, job.finished_at, "a second call changes nothing");
        assert!(client.frame_list(id).await.iter().all(|f| f.state() == FrameState::Cancelled));
        assert_eq!(refusal(client.collect(id, 1).await), (Code::Cancelled, "JOB_CANCELLED".to_owned()));
    }
    let cancelled = vec![JobState::Cancelled.into()];
    let only = client.jobs.list_jobs(page(String::new(), cancelled)).await.unwrap().into_inner();
    assert_eq!(only.jobs.len(), 2);
    let queued = vec![JobState::Queued.into(), JobState::Running.into()];
    let none = client.jobs.list_jobs(page(String::new(), queued)).await.unwrap().into_inner();
    assert_eq!(none.jobs, []);

    let short = client.spec(&scene_text(SIZE, r#"{"spp": 2}"#, "")).await;
    let id = client.submit(&request_id("short"), &short).await.unwrap().id;
    client.finish(&id).await;
    let late = client.jobs.cancel_job(cancel(&id)).await;
    assert_eq!(refusal(late), (Code::FailedPrecondition, "JOB_STATE_CONFLICT".to_owned()));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn downloads_go_on_where_they_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&scene_text((400, 300), r#"{"spp": 2}"#, "")).await;
    let id = client.submit(&request_id("files"), &spec).await.unwrap().id;
    let early = client.download(&id, 1, FrameFormat::Exr, 0).await;
    assert_eq!(refusal(early), (Code::FailedPrecondition, "FRAME_NOT_FINISHED".to_owned()));
    client.finish(&id).await;
    let (start, whole) = client.download(&id, 1, FrameFormat::Exr, 0).await.unwrap();
    assert_eq!(start.total_size, whole.len() as u64);
    assert_eq!(start.digest, karst_server::digest::Digest::of(&whole).to_string());
    let offset = whole.len() / 2 + 1;
    let (again, rest) = client.download(&id, 1, FrameFormat::Exr, offset as u64).await.unwrap();
    assert_eq!((again, rest.as_slice()), (start, &whole[offset..]));
    let (_, nothing) = client.download(&id, 1, FrameFormat::Exr, whole.len() as u64).await.unwrap();
    assert!(nothing.is_empty());
    let past = client.download(&id, 1, FrameFormat::Exr, whole.len() as u64 + 1).await;
    assert_eq!(refusal(past), (Code::OutOfRange, "OFFSET_MISMATCH".to_owned()));
    let (_, png) = client.download(&id, 1, FrameFormat::Png, 0).await.unwrap();
    assert_eq!(&png[1..4], b"PNG");
    let denoised = client.download(&id, 1, FrameFormat::PngDenoised, 0).await;
    assert_eq!(refusal(denoised), (Code::NotFound, "FORMAT_NOT_AVAILABLE".to_owned()));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_denoised_picture_may_have_to_be_good() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let sampling = r#"{"target_error": 0.04, "min_spp": 2, "max_spp": 256, "error_of": "denoised"}"#;
    let judged = client.spec(&scene_text(SIZE, sampling, "")).await;
    let refused = client.submit(&request_id("not denoised"), &judged).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
    if karst_denoise::Denoiser::find().is_err() {
        server.stop().await;
        return;
    }
    // The settings of a job go before the document.
    let noisy = v1::RenderSettings { error_of: v1::ErrorOf::Noisy.into(), ..v1::RenderSettings::default() };
    let denoise = v1::Denoise::Full.into();
    let mut frames = Vec::new();
    for (name, settings) in [("denoised", None), ("noisy", Some(noisy))] {
        let spec = v1::JobSpec { denoise, settings, ..judged.clone() };
        let id = client.submit(&request_id(name), &spec).await.unwrap().id;
        assert_eq!(client.finish(&id).await.state(), JobState::Succeeded);
        frames.push((client.frame_list(&id).await.remove(0), id));
    }
    let [(denoised, id), (noisy, _)] = &frames[..] else { panic!("{frames:?}") };
    assert!(noisy.rel_mse.unwrap().sqrt() <= 0.04 && denoised.spp < noisy.spp, "{frames:?}");
    if denoised.error.is_none() {
        let (error, ends) = (denoised.denoised_rel_mse.unwrap(), &denoised.denoised_rel_mse_ci95);
        assert!(ends[0] <= error && error <= ends[1] && ends[1].sqrt() <= 0.04, "{denoised:?}");
        assert!(denoised.rel_mse.unwrap().sqrt() > 0.04, "{denoised:?}");
        let (_, exr) = client.download(id, 1, FrameFormat::Exr, 0).await.unwrap();
        assert_eq!(read_exr(&exr).unwrap().statistics.unwrap()["denoised_rel_mse"], error);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn denoising_is_refused_early_or_done() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&scene_text(SIZE, r#"{"spp": 2}"#, "")).await;
    let spec = v1::JobSpec { denoise: v1::Denoise::Full.into(), ..spec };
    let submitted = client.submit(&request_id("denoise"), &spec).await;
    if karst_denoise::Denoiser::find().is_err() {
        assert_eq!(refusal(submitted), (Code::FailedPrecondition, "DENOISER_UNAVAILABLE".to_owned()));
        server.stop().await;
        return;
    }
    let id = submitted.unwrap().id;
    assert_eq!(client.finish(&id).await.state(), JobState::Succeeded);
    let frame = client.frame_list(&id).await.remove(0);
    match frame.error {
        None => {
            let (_, exr) = client.download(&id, 1, FrameFormat::Exr, 0).await.unwrap();
            assert!(read_exr(&exr).unwrap().channel("Denoised.R").is_some());
            assert!(client.download(&id, 1, FrameFormat::PngDenoised, 0).await.is_ok());
        }
        // Its libraries are missing: the noisy frame is there, and the reason too.
        Some(error) => assert!(error.message.starts_with("not denoised: "), "{error:?}"),
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn health_and_reflection_answer() {
    use tonic_health::pb::health_check_response::ServingStatus;
    use tonic_health::pb::{HealthCheckRequest, health_client::HealthClient};
    use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
    use tonic_reflection::pb::v1::{ServerReflectionRequest, server_reflection_request::MessageRequest};

    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let client = server.client().await;
    let mut health = HealthClient::new(client.channel.clone());
    for service in ["", "karst.v1.Jobs", "karst.v1.Assets", "karst.v1.Frames", "karst.v1.Previews"] {
        let request = HealthCheckRequest { service: service.to_owned() };
        assert_eq!(health.check(request).await.unwrap().into_inner().status(), ServingStatus::Serving);
    }
    let mut reflection = ServerReflectionClient::new(client.channel.clone());
    let request = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::FileContainingSymbol("karst.v1.Jobs".to_owned())),
    };
    let mut answers =
        reflection.server_reflection_info(tokio_stream::iter([request])).await.unwrap().into_inner();
    let answer = format!("{:?}", answers.message().await.unwrap().unwrap().message_response);
    assert!(answer.contains("FileDescriptorResponse"), "{answer}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_data_folder_has_one_server() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let config = support::config(dir.path(), 1);
    let second = karst_server::serve(listener, config, || panic!("ready"), std::future::pending()).await;
    assert!(second.unwrap_err().to_string().contains("in use by another"));
    server.stop().await;
}
