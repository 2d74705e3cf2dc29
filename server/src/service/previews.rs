//! Owns `karst.v1.Previews`: pixels while they improve.

use std::sync::Arc;
use std::time::Duration;

use karst_proto::convert::{region_to_wire, size_to_wire};
use karst_proto::v1::previews_server::Previews;
use karst_proto::v1::{PreviewLayer, PreviewTile, StreamTilesRequest};
use prost::Message;
use tokio::time::Instant;
use tonic::{Request, Response, Status};

use crate::error::Error;
use crate::farm::Shared;
use crate::preview::{Layer, half_picture};
use crate::service::outlet::{Closed, Outflow, Outlet, stream};
use crate::view::{TileState, View};

/// Frames that one viewer may name.
const MAX_FRAMES: usize = 1024;
/// Coarsest level of detail.
const MAX_LEVEL: u32 = 8;

/// The service.
#[derive(Debug)]
pub struct PreviewsService {
    pub(crate) shared: Arc<Shared>,
}

#[tonic::async_trait]
impl Previews for PreviewsService {
    type StreamTilesStream = Outflow<PreviewTile>;

    async fn stream_tiles(
        &self,
        request: Request<StreamTilesRequest>,
    ) -> Result<Response<Self::StreamTilesStream>, Status> {
        let request = request.into_inner();
        let look = Look { layer: check(&request)?, level: request.level };
        let shared = Arc::clone(&self.shared);
        let wanted = (!request.frames.is_empty()).then(|| request.frames.iter().copied().collect());
        let view = View::open(&shared, &request.job, wanted).await?;
        let pace = Pace::new(request.max_bytes_per_second);
        let ending = shared.ending.clone();
        let send = move |outlet| async move { send(&shared, view, &look, pace, &outlet).await };
        Ok(Response::new(stream(&ending, send)))
    }
}

/// Sends tiles until nothing changes any more.
async fn send(
    shared: &Shared,
    mut view: View,
    look: &Look,
    mut pace: Pace,
    outlet: &Outlet<PreviewTile>,
) -> Result<(), Closed> {
    let mut revision = 0;
    loop {
        pace.wait().await;
        let next = tokio::select! {
            next = view.next(shared) => next?,
            () = outlet.gone() => return Err(Closed::Gone),
        };
        let Some(tile) = next else { return Ok(()) };
        revision += 1;
        let message = look.message(&tile, revision);
        pace.sent(message.encoded_len());
        outlet.send(message).await?;
    }
}

/// How tiles are shown.
struct Look {
    layer: Layer,
    level: u32,
}

impl Look {
    fn message(&self, tile: &TileState, revision: u64) -> PreviewTile {
        let half = half_picture(&tile.picture, self.layer, self.level);
        PreviewTile {
            revision,
            frame: tile.frame,
            tile: tile.tile,
            round: tile.rounds.saturating_sub(1),
            spp: tile.spp(),
            region: Some(region_to_wire(&tile.picture.window)),
            width: half.width,
            height: half.height,
            rgb_f16: half.rgb.into(),
            r#final: tile.is_final,
            size: Some(size_to_wire(tile.picture.size)),
        }
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
