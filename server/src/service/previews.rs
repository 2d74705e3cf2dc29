//! Owns `karst.v1.Previews`: pixels while they improve.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{Film, TileGrid};
use karst_proto::convert::{region_to_wire, size_to_wire};
use karst_proto::v1::previews_server::Previews;
use karst_proto::v1::{PreviewLayer, PreviewTile, StreamTilesRequest};
use prost::Message;
use tokio::sync::Semaphore;
use tokio::time::Instant;
use tonic::{Request, Response, Status};

use crate::error::Error;
use crate::farm::Shared;
use crate::farm::prepare::read_film;
use crate::model::{Frame, FrameState, Job};
use crate::preview::{Layer, Next, Viewer, half_picture};
use crate::service::outlet::{Closed, Outflow, Outlet, stream};

/// Frames that one viewer may name.
const MAX_FRAMES: usize = 1024;
/// Coarsest level of detail.
const MAX_LEVEL: u32 = 8;

/// The service.
#[derive(Debug)]
pub struct PreviewsService {
    pub(crate) shared: Arc<Shared>,
    /// Stored films that are in memory for viewers.
    pub(crate) films: Arc<Semaphore>,
}

#[tonic::async_trait]
impl Previews for PreviewsService {
    type StreamTilesStream = Outflow<PreviewTile>;

    async fn stream_tiles(
        &self,
        request: Request<StreamTilesRequest>,
    ) -> Result<Response<Self::StreamTilesStream>, Status> {
        let request = request.into_inner();
        let layer = check(&request)?;
        let shared = Arc::clone(&self.shared);
        let wanted = (!request.frames.is_empty()).then(|| request.frames.iter().copied().collect());
        shared.state.job(&request.job).await?;
        // Attached before the look at what exists: what changes meanwhile is marked.
        let viewer = shared.hub.attach(&request.job, wanted.clone());
        let job = shared.state.job(&request.job).await?;
        let frames = wanted_frames(&shared, &job, wanted.as_ref()).await?;
        if job.state.is_final() {
            viewer.end();
        }
        let stream_view =
            View { viewer, job, layer, level: request.level, pace: Pace::new(request.max_bytes_per_second) };
        let films = Arc::clone(&self.films);
        let ending = shared.ending.clone();
        let send = move |outlet| async move { stream_view.run(&shared, &films, frames, &outlet).await };
        Ok(Response::new(stream(&ending, send)))
    }
}

fn check(request: &StreamTilesRequest) -> Result<Layer, Error> {
    if request.frames.len() > MAX_FRAMES {
        let text = format!("found {} frames, expected at most {MAX_FRAMES}", request.frames.len());
        return Err(Error::field("frames", text));
    }
    if request.level > MAX_LEVEL {
        return Err(Error::field("level", format!("found {}, expected 0 to {MAX_LEVEL}", request.level)));
    }
    match PreviewLayer::try_from(request.layer) {
        Ok(PreviewLayer::Unspecified | PreviewLayer::Color) => Ok(Layer::Color),
        Ok(PreviewLayer::Albedo) => Ok(Layer::Albedo),
        Ok(PreviewLayer::Normal) => Ok(Layer::Normal),
        Err(_) => Err(Error::field("layer", format!("found {}, expected a PreviewLayer", request.layer))),
    }
}

/// The frames that a viewer asked for and that something exists of.
async fn wanted_frames(
    shared: &Shared,
    job: &Job,
    wanted: Option<&BTreeSet<i32>>,
) -> Result<Vec<Frame>, Error> {
    let all = shared.state.frames(&job.id, i32::MIN, u32::MAX).await?;
    if let Some(unknown) = wanted.and_then(|w| w.iter().find(|n| !all.iter().any(|f| f.frame == **n))) {
        return Err(Error::FrameNotFound(job.id.clone(), *unknown));
    }
    let is_wanted = |f: &Frame| wanted.is_none_or(|w| w.contains(&f.frame));
    Ok(all.into_iter().filter(is_wanted).collect())
}

/// Keeps a stream under a number of bytes per second.
struct Pace {
    per_second: u64,
    free_at: Instant,
}

impl Pace {
    fn new(per_second: u64) -> Self {
        Self { per_second, free_at: Instant::now() }
    }

    /// Waits until the next message may be sent.
    async fn wait(&self) {
        tokio::time::sleep_until(self.free_at).await;
    }

    fn sent(&mut self, bytes: usize) {
        if self.per_second > 0 {
            let seconds = bytes as f64 / self.per_second as f64;
            self.free_at = Instant::now() + Duration::from_secs_f64(seconds.min(3600.0));
        }
    }
}

/// A frame that is not in memory any more, taken back from disk for one viewer.
struct Stored {
    frame: i32,
    grid: TileGrid,
    film: Film,
    rounds: u32,
    is_final: bool,
}

struct View {
    viewer: Arc<Viewer>,
    job: Job,
    layer: Layer,
    level: u32,
    pace: Pace,
}

impl View {
    async fn run(
        mut self,
        shared: &Shared,
        films: &Semaphore,
        frames: Vec<Frame>,
        outlet: &Outlet<PreviewTile>,
    ) -> Result<(), Closed> {
        for frame in frames {
            // A frame on disk is marked by one tile, the rest when it is read: only then their number is known.
            match shared.live.get(&self.job.id, frame.frame) {
                Some(live) => self.viewer.mark(frame.frame, 0..live.grid.tile_count()),
                None if frame.rounds > 0 => self.viewer.mark(frame.frame, [0]),
                None => {}
            }
        }
        let mut stored: Option<Stored> = None;
        let mut revision = 0;
        loop {
            self.pace.wait().await;
            let next = tokio::select! {
                next = self.viewer.next() => next,
                () = outlet.gone() => return Err(Closed::Gone),
            };
            let Next::Tile(frame, tile) = next else { return Ok(()) };
            let mut message = match self.live_tile(shared, frame, tile) {
                Looked::Live(message) => message,
                Looked::Gone => {
                    if stored.as_ref().is_none_or(|s| s.frame != frame) {
                        let _permit = films.acquire().await;
                        stored = self.read(shared, frame).await?;
                    }
                    stored.as_ref().map(|s| self.stored_tile(s, tile))
                }
            };
            if let Some(message) = &mut message {
                revision += 1;
                message.revision = revision;
            }
            if let Some(message) = message {
                self.pace.sent(message.encoded_len());
                outlet.send(message).await?;
            }
        }
    }

    /// The newest state of a tile of a frame that is being rendered; nothing when no round of it is there.
    fn live_tile(&self, shared: &Shared, frame: i32, tile: u32) -> Looked {
        let Some(live) = shared.live.get(&self.job.id, frame) else { return Looked::Gone };
        let merged = live.merged();
        let rounds = merged.rounds[tile as usize];
        let facts = (frame, tile, rounds, merged.complete);
        Looked::Live((rounds > 0).then(|| self.message(&merged.film, live.grid, facts)))
    }

    fn stored_tile(&self, stored: &Stored, tile: u32) -> PreviewTile {
        self.message(&stored.film, stored.grid, (stored.frame, tile, stored.rounds, stored.is_final))
    }

    async fn read(&self, shared: &Shared, frame: i32) -> Result<Option<Stored>, Error> {
        let found = shared.state.frame(&self.job.id, frame).await?;
        let round = shared.state.round(&self.job.id, frame).await?;
        let Some(digest) = round.film else { return Ok(None) };
        let film = read_film(&shared.blobs, digest).await?;
        let grid = TileGrid::new(film.window(), self.job.spec.tile_size);
        self.viewer.mark(frame, 1..grid.tile_count());
        let is_final = matches!(found.state, FrameState::Finishing | FrameState::Finished);
        Ok(Some(Stored { frame, grid, film, rounds: round.rounds, is_final }))
    }

    fn message(&self, film: &Film, grid: TileGrid, facts: (i32, u32, u32, bool)) -> PreviewTile {
        let (frame, tile, rounds, is_final) = facts;
        let picture = film.region(grid.tile_region(tile));
        let half = half_picture(&picture, self.layer, self.level);
        let pixels = picture.samples.len().max(1) as f32;
        PreviewTile {
            revision: 0,
            frame,
            tile,
            round: rounds.saturating_sub(1),
            spp: picture.samples.iter().sum::<f32>() / pixels,
            region: Some(region_to_wire(&picture.window)),
            width: half.width,
            height: half.height,
            rgb_f16: half.rgb.into(),
            r#final: is_final,
            size: Some(size_to_wire(picture.size)),
        }
    }
}

/// What was found of a tile in memory.
enum Looked {
    /// The frame is being rendered; the tile may have no round yet.
    Live(Option<PreviewTile>),
    /// The frame is not in memory.
    Gone,
}
