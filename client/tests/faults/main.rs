//! Lost connections: uploads, watches, collected tiles and downloads go on where they stopped.

#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod fake;

use std::collections::BTreeMap;
use std::pin::pin;

use futures::StreamExt;
use karst_client::{Bearer, Blob, Client, Download, Error, Update};
use karst_proto::errors::ErrorReason;
use karst_proto::v1::FrameFormat;
use karst_proto::v1::job_event::Event;

use fake::Fake;

fn bytes(count: usize) -> Vec<u8> {
    (0..count).map(|index| (index * 7 % 251) as u8).collect()
}

#[tokio::test]
async fn an_upload_goes_on_where_it_broke_off() {
    let fake = Fake { break_uploads: 3, ..Fake::default() };
    let (client, state) = fake.start().await;
    let content = bytes(1_500_000);
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &content).unwrap();
    let blobs = [Blob::of_file(file.path()).unwrap(), Blob::of_bytes(b"document")];
    let sent = client.upload(&blobs, |_| ()).await.unwrap();
    assert_eq!((sent.blobs, sent.bytes), (2, 1_500_008));
    let state = state.lock().unwrap();
    assert_eq!(state.uploads[blobs[0].digest()], content);
    assert_eq!(state.uploads[blobs[1].digest()], b"document");
    assert!(state.offsets.iter().any(|offset| *offset > 0), "it must not begin anew: {:?}", state.offsets);
}

#[tokio::test]
async fn what_the_server_has_is_not_sent_again() {
    let (client, state) = Fake::default().start().await;
    let blob = [Blob::of_bytes(b"once")];
    assert_eq!(client.upload(&blob, |_| ()).await.unwrap().blobs, 1);
    assert_eq!(client.upload(&blob, |_| ()).await.unwrap().blobs, 0);
    assert_eq!(state.lock().unwrap().offsets.len(), 1);
}

#[tokio::test]
async fn a_file_that_vanished_is_named() {
    let (client, _state) = Fake::default().start().await;
    let file = tempfile::NamedTempFile::new().unwrap();
    let blob = Blob::of_file(file.path()).unwrap();
    let path = file.path().to_owned();
    file.close().unwrap();
    let error = client.upload(&[blob], |_| ()).await.unwrap_err();
    assert!(matches!(&error, Error::File { path: named, .. } if *named == path), "{error}");
}

#[tokio::test]
async fn a_watch_resumes_without_gap_or_repeat() {
    let (client, _state) = Fake { break_every: 3, ..Fake::default() }.start().await;
    let mut updates = pin!(client.watch("job", None));
    let (mut rounds, mut breaks, mut final_state) = (Vec::new(), 0, None);
    while let Some(update) = updates.next().await {
        match update.unwrap() {
            Update::Reconnecting { .. } => breaks += 1,
            Update::Event(event) => match event.event {
                Some(Event::Round(round)) => rounds.push(round.round),
                Some(Event::Snapshot(job)) => final_state = Some(job.state()),
                _ => {}
            },
        }
    }
    assert_eq!(rounds, (0..10).collect::<Vec<u32>>());
    assert!(breaks >= 3, "the fake server breaks every stream after 3 events, {breaks} breaks");
    assert_eq!(final_state, Some(karst_proto::v1::JobState::Succeeded));
}

#[tokio::test]
async fn a_watch_of_an_unknown_job_ends_at_once() {
    let (client, _state) = Fake::default().start().await;
    let mut updates = pin!(client.watch("nope", None));
    let error = updates.next().await.unwrap().unwrap_err();
    assert_eq!(error.reason(), Some(ErrorReason::JobNotFound));
    assert!(updates.next().await.is_none());
}

#[tokio::test]
async fn an_expired_token_means_a_new_start() {
    let (client, _state) = Fake::default().start().await;
    let mut updates = pin!(client.watch("job", Some("expired".to_owned())));
    let first = updates.next().await.unwrap().unwrap();
    assert!(matches!(first, Update::Event(event) if matches!(event.event, Some(Event::Snapshot(_)))));
}

#[tokio::test]
async fn every_tile_comes_once() {
    let (client, _state) = Fake { break_every: 2, ..Fake::default() }.start().await;
    let mut seen: BTreeMap<u32, u32> = BTreeMap::new();
    let mut tiles = pin!(client.collect_tiles("job", 1));
    while let Some(tile) = tiles.next().await {
        *seen.entry(tile.unwrap().tile).or_default() += 1;
    }
    assert_eq!(seen, (0..7).map(|tile| (tile, 1)).collect());
}

#[tokio::test]
async fn a_download_is_whole_or_not_there() {
    let content = bytes(900_000);
    let fake = Fake { break_every: 2, file: content.clone(), ..Fake::default() };
    let (client, state) = fake.start().await;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/frame.exr");
    let download = Download { job: "job".to_owned(), frame: 1, format: FrameFormat::Exr, path: path.clone() };
    assert_eq!(client.download(&download).await.unwrap(), 900_000);
    assert_eq!(std::fs::read(&path).unwrap(), content);
    assert!(state.lock().unwrap().offsets.len() > 1, "the fake server breaks the download");

    state.lock().unwrap().lie_about_digest = true;
    let path = folder.path().join("bad.exr");
    let error = client.download(&Download { path: path.clone(), ..download }).await.unwrap_err();
    assert!(error.to_string().contains("digest"), "{error}");
    assert!(!path.exists() && !folder.path().join("bad.exr.part").exists());
}

#[tokio::test]
async fn nobody_listening_is_said_at_once() {
    let error = Client::connect("http://127.0.0.1:1", None, Bearer::default()).await.unwrap_err();
    assert!(matches!(error, Error::Connect { .. }), "{error}");
}
