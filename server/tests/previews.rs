//! Previews: early, complete, ended by the job, and harmless when nobody reads them.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::collections::BTreeMap;
use std::time::Duration;

use karst_proto::v1::{self, JobState, PreviewLayer};
use support::{Client, TestServer, fading, request_id, scene_text};
use tokio::time::Instant;
use tonic::Streaming;
use tonic::transport::Channel;

async fn stream(client: &mut Client, request: v1::StreamTilesRequest) -> Streaming<v1::PreviewTile> {
    client.previews.stream_tiles(request).await.unwrap().into_inner()
}

fn all_of(job: &str) -> v1::StreamTilesRequest {
    v1::StreamTilesRequest { job: job.to_owned(), ..Default::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_tile_comes_soon_and_the_first_round_covers_the_frame() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&scene_text((640, 360), r#"{"spp": 32}"#, "")).await;
    let job = client.submit(&request_id("soon"), &spec).await.unwrap().id;
    let returned = Instant::now();
    let mut tiles = stream(&mut client, all_of(&job)).await;
    let first = tiles.message().await.unwrap().unwrap();
    let waited = returned.elapsed();
    println!("first preview tile {} ms after SubmitJob returned", waited.as_millis());
    // On an idle machine it is some 50 ms; the bound leaves room for a busy one.
    assert!(waited < Duration::from_secs(3), "{waited:?}");

    let count = 10 * 6;
    let mut newest = BTreeMap::from([(first.tile, first)]);
    let mut last_revision = 1;
    while let Some(tile) = tiles.message().await.unwrap() {
        assert!(tile.revision > last_revision, "revisions rise");
        last_revision = tile.revision;
        assert_eq!((tile.width * tile.height * 6) as usize, tile.rgb_f16.len());
        let (seen, too_early) = (newest.len(), tile.round > 0 && newest.len() < count);
        assert!(!too_early, "tile {} is in round {}, only {seen} have a first one", tile.tile, tile.round);
        newest.insert(tile.tile, tile);
    }
    assert_eq!(client.job(&job).await.state(), JobState::Succeeded, "the stream ends with the job");
    assert!(newest.values().all(|t| t.r#final && (t.spp - 32.0).abs() < 1e-3), "the end is the final state");
    let exact = client.collect(&job, 1).await.unwrap();
    for tile in newest.values() {
        compare(tile, &exact, 640);
    }
    server.stop().await;
}

/// The preview is the exact picture, rounded to half floats.
fn compare(tile: &v1::PreviewTile, exact: &[f32], width: u32) {
    let r = tile.region.unwrap();
    let halves = tile.rgb_f16.chunks_exact(2).map(|b| half(u16::from_le_bytes([b[0], b[1]])));
    let places = (r.y0..r.y1).flat_map(|y| (r.x0..r.x1).flat_map(move |x| (0..3).map(move |c| (y, x, c))));
    for ((y, x, c), half) in places.zip(halves) {
        let exact = exact[((y * width + x) * 3 + c) as usize];
        assert!((half - exact).abs() <= exact.abs() / 1024.0 + 1e-6, "{half} at {x},{y} is not {exact}");
    }
}

/// The value of positive half-float bits.
fn half(bits: u16) -> f32 {
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f32::from(bits & 1023) / 1024.0);
    if exponent == 0 { mantissa * 2.0_f32.powi(-14) } else { (1.0 + mantissa) * 2.0_f32.powi(exponent - 15) }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_viewer_gets_what_is_stored_in_its_layer_and_level() {
    let dir = tempfile::tempdir().unwrap();
    let text = scene_text((100, 60), r#"{"spp": 4}"#, &fading(3));
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&text).await;
    let job = client.submit(&request_id("late"), &spec).await.unwrap().id;
    client.finish(&job).await;
    server.stop().await;

    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let request = v1::StreamTilesRequest {
        frames: vec![1, 3],
        layer: PreviewLayer::Normal.into(),
        level: 4,
        ..all_of(&job)
    };
    let mut tiles = stream(&mut client, request).await;
    let mut seen = Vec::new();
    while let Some(tile) = tiles.message().await.unwrap() {
        assert!(tile.r#final && tile.width <= 4 && tile.height <= 4, "{tile:?}");
        assert_eq!(tile.size, Some(v1::Size { width: 100, height: 60 }));
        seen.push((tile.frame, tile.tile));
    }
    assert_eq!(seen, [(1, 0), (1, 1), (3, 0), (3, 1)]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn viewers_that_do_not_read_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&scene_text((320, 240), r#"{"spp": 64}"#, &fading(2))).await;
    let job = client.submit(&request_id("slow"), &spec).await.unwrap().id;
    let mut silent = Vec::new();
    for _ in 0..20 {
        // A small window: what the transport has taken is old by the time it is read.
        let endpoint = Channel::from_shared(server.url.clone()).unwrap();
        let endpoint = endpoint.initial_stream_window_size(65_535).initial_connection_window_size(65_535);
        let mut viewer = Client::over(endpoint.connect().await.unwrap(), &server.token);
        silent.push(viewer.previews.stream_tiles(all_of(&job)).await.unwrap().into_inner());
    }
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    // Whoever begins to read now gets some old tiles from the pipe, and then the newest of each, once.
    let mut messages = 0;
    let mut newest = BTreeMap::new();
    while let Some(tile) = silent[0].message().await.unwrap() {
        messages += 1;
        newest.insert((tile.frame, tile.tile), tile);
    }
    let tiles = 2 * 5 * 4;
    assert_eq!(newest.len(), tiles);
    assert!(newest.values().all(|t| t.r#final));
    assert!(messages <= 2 * tiles, "{messages} messages are a backlog");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rate_limit_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 2).await;
    let mut client = server.client().await;
    let spec = client.spec(&scene_text((128, 128), r#"{"spp": 2}"#, "")).await;
    let job = client.submit(&request_id("rate"), &spec).await.unwrap().id;
    client.finish(&job).await;
    // Four tiles of 24 KiB at 100 kB/s: the fourth may leave when the third has been paid for.
    let request = v1::StreamTilesRequest { max_bytes_per_second: 100_000, ..all_of(&job) };
    let began = Instant::now();
    let mut tiles = stream(&mut client, request).await;
    let mut count = 0;
    while tiles.message().await.unwrap().is_some() {
        count += 1;
    }
    let took = began.elapsed().as_secs_f64();
    assert!(count == 4 && (0.7..5.0).contains(&took), "{count} tiles in {took} s");
    server.stop().await;
}
