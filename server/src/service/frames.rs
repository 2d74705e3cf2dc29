//! Owns `karst.v1.Frames`: listing frames, their exact tiles and their files.

use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{BLOCK, Film, TileGrid};
use karst_proto::MAX_CHUNK_BYTES;
use karst_proto::convert::{region_to_wire, rgb_f32};
use karst_proto::v1::frames_server::Frames;
use karst_proto::v1::{
    CollectTilesRequest, CollectedTile, DownloadFrameRequest, DownloadFrameResponse, DownloadStart,
    ListFramesRequest, ListFramesResponse, download_frame_response::Part,
};
use tonic::{Request, Response, Status};

use crate::blobs::Kind;
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::Shared;
use crate::model::{FrameFile, FrameState};
use crate::service::convert;
use crate::service::jobs::page_size;
use crate::service::outlet::{Closed, Outflow, Outlet, stream};

/// Frames on a page of a list: at most, and unless asked for.
const FRAMES: (u32, u32) = (200, 100);

/// The service.
#[derive(Debug)]
pub struct FramesService {
    pub(crate) shared: Arc<Shared>,
}

#[tonic::async_trait]
impl Frames for FramesService {
    async fn list_frames(
        &self,
        request: Request<ListFramesRequest>,
    ) -> Result<Response<ListFramesResponse>, Status> {
        Ok(Response::new(self.list(&request.into_inner()).await?))
    }

    type CollectTilesStream = Outflow<CollectedTile>;

    async fn collect_tiles(
        &self,
        request: Request<CollectTilesRequest>,
    ) -> Result<Response<Self::CollectTilesStream>, Status> {
        let CollectTilesRequest { job, frame, resume_token } = request.into_inner();
        self.shared.state.frame(&job, frame).await?;
        let prefix = format!("tiles-{job}-{frame}-");
        let first = match resume_token.as_str() {
            "" => 0,
            token => token.strip_prefix(&prefix).and_then(|t| t.parse().ok()).ok_or(Error::Token)?,
        };
        let shared = Arc::clone(&self.shared);
        let ending = self.shared.ending.clone();
        let collect = move |outlet| async move {
            let digest = finished_film(&shared, &job, frame, &outlet).await?;
            let spec = shared.state.job(&job).await?.spec;
            let film = shared.films.get(digest).await?;
            collect(&film, spec.tile_size, (&prefix, first), &outlet).await
        };
        Ok(Response::new(stream(&ending, collect)))
    }

    type DownloadFrameStream = Outflow<DownloadFrameResponse>;

    async fn download_frame(
        &self,
        request: Request<DownloadFrameRequest>,
    ) -> Result<Response<Self::DownloadFrameStream>, Status> {
        let request = request.into_inner();
        let file = self.file(&request).await?;
        let shared = Arc::clone(&self.shared);
        let ending = self.shared.ending.clone();
        let send = move |outlet| async move { download(&shared, &file, request.offset, &outlet).await };
        Ok(Response::new(stream(&ending, send)))
    }
}

impl FramesService {
    async fn list(&self, request: &ListFramesRequest) -> Result<ListFramesResponse, Error> {
        let size = page_size(request.page_size, FRAMES)?;
        self.shared.state.job(&request.job).await?;
        let prefix = format!("frames-{}-", request.job);
        let from = match request.page_token.as_str() {
            "" => i32::MIN,
            token => token.strip_prefix(&prefix).and_then(|t| t.parse().ok()).ok_or(Error::Token)?,
        };
        // One more than the page tells whether there is another one.
        let mut frames = self.shared.state.frames(&request.job, from, size + 1).await?;
        let next = if frames.len() > size as usize { frames.pop() } else { None };
        Ok(ListFramesResponse {
            frames: frames.iter().map(convert::frame).collect(),
            next_page_token: next.map(|f| format!("{prefix}{}", f.frame)).unwrap_or_default(),
        })
    }

    async fn file(&self, request: &DownloadFrameRequest) -> Result<FrameFile, Error> {
        let format = convert::format(request.format())?;
        let frame = self.shared.state.frame(&request.job, request.frame).await?;
        if frame.state != FrameState::Finished {
            return Err(Error::FrameNotFinished(frame.frame));
        }
        let file = frame.files.into_iter().find(|f| f.format == format);
        let file = file.ok_or(Error::FormatNotAvailable(frame.frame))?;
        if request.offset > file.size {
            return Err(Error::Offset { found: request.offset, expected: file.size });
        }
        Ok(file)
    }
}

/// Waits until no later round can change the frame; the digest of its film then.
async fn finished_film<T>(
    shared: &Shared,
    job: &str,
    frame: i32,
    outlet: &Outlet<T>,
) -> Result<Digest, Closed> {
    loop {
        let mut news = shared.feeds.get(job).map(|feed| feed.revision.subscribe());
        let found = shared.state.frame(job, frame).await?;
        match found.state {
            FrameState::Finishing | FrameState::Finished => {
                let film = shared.state.round(job, frame).await?.film;
                let lost = || Error::Internal(format!("job {job}, frame {frame}: finished without a film"));
                return Ok(film.ok_or_else(lost)?);
            }
            FrameState::Failed => {
                let why = found.failure.map(|f| f.message).unwrap_or_default();
                return Err(Error::JobState(format!("frame {frame} failed: {why}")).into());
            }
            FrameState::Cancelled => return Err(Error::JobCancelled(job.to_owned()).into()),
            FrameState::Pending | FrameState::Rendering => {}
        }
        let changed = async {
            match &mut news {
                Some(news) => drop(news.changed().await),
                None => tokio::time::sleep(Duration::from_millis(100)).await,
            }
        };
        tokio::select! {
            () = changed => {}
            () = outlet.gone() => return Err(Closed::Gone),
        }
    }
}

/// Sends tiles from `first` on.
async fn collect(
    film: &Film,
    tile_size: u32,
    (prefix, first): (&str, u32),
    outlet: &Outlet<CollectedTile>,
) -> Result<(), Closed> {
    let grid = TileGrid::new(film.window(), tile_size);
    for tile in first..grid.tile_count() {
        let picture = film.region(grid.tile_region(tile));
        let blocks = grid.tile_blocks(tile).map(|block| {
            let corner = grid.block_region(block);
            let (x, y) = (corner.x0 - picture.window.x0, corner.y0 - picture.window.y0);
            debug_assert!(corner.width() <= BLOCK, "a block is at most {BLOCK} pixels wide");
            picture.samples[(y * picture.window.width() + x) as usize] as u32
        });
        let message = CollectedTile {
            resume_token: format!("{prefix}{}", tile + 1),
            tile,
            tile_count: grid.tile_count(),
            region: Some(region_to_wire(&picture.window)),
            block_spp: blocks.collect(),
            rgb_f32: rgb_f32(picture.color.iter().map(glam::Vec3::to_array)).into(),
        };
        outlet.send(message).await?;
    }
    Ok(())
}

async fn download(
    shared: &Shared,
    file: &FrameFile,
    offset: u64,
    outlet: &Outlet<DownloadFrameResponse>,
) -> Result<(), Closed> {
    let part = |part| DownloadFrameResponse { part: Some(part) };
    let start = DownloadStart { total_size: file.size, digest: file.digest.to_string() };
    outlet.send(part(Part::Start(start))).await?;
    // A whole download is checked on the way; a resumed one by its reader, who has the first part.
    let mut hasher = (offset == 0).then(Digest::hasher);
    let mut at = offset;
    while at < file.size {
        let end = file.size.min(at + MAX_CHUNK_BYTES as u64);
        let chunk = shared.blobs.part(Kind::Frame, file.digest, at..end).await?;
        if let Some(hasher) = &mut hasher {
            hasher.update(&chunk);
        }
        at = end;
        outlet.send(part(Part::Chunk(chunk.into()))).await?;
    }
    match hasher.map(crate::digest::Hasher::finish) {
        Some(found) if found != file.digest => Err(Error::Corrupt(file.digest).into()),
        _ => Ok(()),
    }
}
