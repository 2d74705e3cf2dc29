//! `karst submit`: uploads what the server lacks, submits the job, waits and downloads if asked.

use std::pin::pin;

use futures::StreamExt;
use karst_client::{Client, Error, SceneFiles, open_scene};
use karst_core::scene::Limits;
use karst_proto::convert::settings_to_wire;
use karst_proto::v1::{
    Denoise, FrameRange, Job, JobSpec, Scene, SceneFile, StreamTilesRequest, SubmitJobRequest,
};
use serde_json::json;

use crate::args::{DenoiseArg, FrameList, SubmitArgs};
use crate::clock::Stopwatch;
use crate::commands::convert::say_notes;
use crate::commands::fetch::{Wanted, download_frames};
use crate::commands::follow::{follow, outcome};
use crate::talk::Talk;
use crate::wire_json::job_json;

pub(super) async fn run(args: SubmitArgs, talk: Talk) -> Result<(), Error> {
    let scene = open_scene(&args.scene, &Limits::default())?;
    say_notes(&scene, talk);
    let scene = scene.hashed()?;
    let client = args.server.connect().await?;
    let uploaded = client
        .upload(&scene.blobs(), |blob| {
            talk.event(&json!({"event": "uploaded", "digest": blob.digest(), "bytes": blob.size()}));
        })
        .await?;
    talk.say(&format_args!(
        "uploaded {} of {} files, {} bytes",
        uploaded.blobs,
        scene.files.len() + 1,
        uploaded.bytes
    ));
    let job = client.submit(request(&args, &scene)).await?;
    let submitted = Stopwatch::start();
    if args.validate_only {
        talk.result(&"the server would take this job", &json!({"event": "validated", "job": job_json(&job)}));
        return Ok(());
    }
    talk.result(&job.id, &json!({"event": "submitted", "job": job_json(&job)}));
    if args.wait || args.tiles || args.output.is_some() {
        wait(&client, &job, &args, submitted, talk).await?;
    }
    Ok(())
}

async fn wait(
    client: &Client,
    job: &Job,
    args: &SubmitArgs,
    submitted: Stopwatch,
    talk: Talk,
) -> Result<(), Error> {
    let tiles = async {
        if args.tiles {
            count_tiles(client, &job.id, submitted, talk).await;
        }
        Ok(())
    };
    let (job, ()) = tokio::try_join!(follow(client, &job.id, None, talk), tiles)?;
    if let Some(folder) = &args.output {
        download_frames(client, &job, &Wanted::default(), folder, talk).await?;
    }
    outcome(&job, talk)
}

/// Receives preview tiles to the end of the job; trouble here is only worth a remark.
async fn count_tiles(client: &Client, job: &str, submitted: Stopwatch, talk: Talk) {
    let request = StreamTilesRequest { job: job.to_owned(), ..StreamTilesRequest::default() };
    let mut tiles = pin!(client.stream_tiles(request));
    let mut count = 0_u64;
    while let Some(tile) = tiles.next().await {
        match tile {
            Ok(tile) if count == 0 => {
                let seconds = submitted.seconds();
                talk.say(&format_args!("first tile after {:.0} ms", seconds * 1e3));
                let (frame, tile) = (tile.frame, tile.tile);
                talk.event(&json!({"event": "first_tile", "frame": frame, "tile": tile, "seconds": seconds}));
            }
            Ok(_) => {}
            Err(error) => return talk.say(&format_args!("the tile stream ended early: {error}")),
        }
        count += 1;
    }
    talk.say(&format_args!("received {count} tiles while they improved"));
    talk.event(&json!({"event": "tiles", "count": count}));
}

fn request(args: &SubmitArgs, scene: &SceneFiles) -> SubmitJobRequest {
    let file = |(path, blob): &(String, karst_client::Blob)| SceneFile {
        path: path.clone(),
        digest: blob.digest().to_owned(),
    };
    let spec = JobSpec {
        display_name: args.name.clone().unwrap_or_else(|| scene.name.clone()),
        scene: Some(Scene {
            digest: scene.document.digest().to_owned(),
            files: scene.files.iter().map(file).collect(),
        }),
        frames: args.frames.or(args.frame.map(FrameList::one)).map(frame_range),
        settings: Some(settings_to_wire(&args.settings.overrides())),
        tile_size: args.work.tile_size.unwrap_or(0),
        denoise: denoise(args.work.denoise).into(),
    };
    SubmitJobRequest {
        request_id: args.request_id.clone().unwrap_or_else(|| uuid::Uuid::new_v4().to_string()),
        validate_only: args.validate_only,
        job: Some(spec),
    }
}

fn frame_range(list: FrameList) -> FrameRange {
    FrameRange { first: list.first, last: list.last, step: list.step }
}

fn denoise(mode: DenoiseArg) -> Denoise {
    match mode {
        DenoiseArg::Off => Denoise::Off,
        DenoiseArg::Color => Denoise::Color,
        DenoiseArg::Full => Denoise::Full,
    }
}
