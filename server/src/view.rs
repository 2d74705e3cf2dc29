//! Owns how somebody who watches gets pixels: the newest state of each tile that changed, from the films in memory
//! or from disk.

use std::collections::BTreeSet;
use std::sync::Arc;

use karst_core::film::{Film, Picture, TileGrid};

use crate::error::Error;
use crate::farm::Shared;
use crate::model::{Frame, FrameState, Job};
use crate::preview::{Next, Viewer};

/// Somebody's look at some frames of a job.
#[derive(Debug)]
pub(crate) struct View {
    viewer: Arc<Viewer>,
    job: Job,
    stored: Option<Stored>,
}

/// The newest state of a tile.
#[derive(Debug)]
pub(crate) struct TileState {
    /// Frame number.
    pub frame: i32,
    /// Its number in the frame.
    pub tile: u32,
    /// Rounds in it.
    pub rounds: u32,
    /// It will not change any more.
    pub is_final: bool,
    /// Its pixels.
    pub picture: Picture,
}

impl TileState {
    /// Mean samples per pixel.
    pub(crate) fn spp(&self) -> f32 {
        let pixels = self.picture.samples.len().max(1) as f32;
        self.picture.samples.iter().sum::<f32>() / pixels
    }
}

/// A frame that is not in memory any more, taken back from disk.
#[derive(Debug)]
struct Stored {
    frame: i32,
    grid: TileGrid,
    film: Arc<Film>,
    rounds: u32,
    is_final: bool,
}

impl View {
    /// Begins to look at `wanted` frames of a job (`None`: at all of them): everything that is there counts as news.
    ///
    /// # Errors
    /// No such job or frame; a failing database.
    pub(crate) async fn open(
        shared: &Shared,
        job: &str,
        wanted: Option<BTreeSet<i32>>,
    ) -> Result<Self, Error> {
        shared.state.job(job).await?;
        // Attached before the look at what exists: what changes meanwhile is marked.
        let viewer = shared.hub.attach(job, wanted.clone());
        let job = shared.state.job(job).await?;
        let frames = wanted_frames(shared, &job, wanted.as_ref()).await?;
        for frame in &frames {
            // A frame on disk is marked by one tile, the rest when it is read: only then their number is known.
            match shared.live.get(&job.id, frame.frame) {
                Some(live) => viewer.mark(frame.frame, 0..live.grid.tile_count()),
                None if frame.rounds > 0 => viewer.mark(frame.frame, [0]),
                None => {}
            }
        }
        if job.state.is_final() || (wanted.is_some() && frames.iter().all(|f| f.state.is_final())) {
            viewer.end();
        }
        Ok(Self { viewer, job, stored: None })
    }

    /// Waits for a tile that has changed; `None` when nothing will change any more.
    ///
    /// # Errors
    /// A failing disk or database.
    pub(crate) async fn next(&mut self, shared: &Shared) -> Result<Option<TileState>, Error> {
        loop {
            let Next::Tile(frame, tile) = self.viewer.next().await else { return Ok(None) };
            let state = match live_tile(shared, &self.job.id, frame, tile) {
                Looked::Live(state) => state.map(|state| *state),
                Looked::Gone => {
                    if self.stored.as_ref().is_none_or(|s| s.frame != frame) {
                        self.stored = self.read(shared, frame).await?;
                    }
                    self.stored.as_ref().map(|stored| stored.tile(tile))
                }
            };
            if state.is_some() {
                return Ok(state);
            }
        }
    }

    async fn read(&self, shared: &Shared, frame: i32) -> Result<Option<Stored>, Error> {
        let found = shared.state.frame(&self.job.id, frame).await?;
        let round = shared.state.round(&self.job.id, frame).await?;
        let Some(digest) = round.film else { return Ok(None) };
        let film = shared.films.get(digest).await?;
        let grid = TileGrid::new(film.window(), self.job.spec.tile_size);
        self.viewer.mark(frame, 1..grid.tile_count());
        let is_final = matches!(found.state, FrameState::Finishing | FrameState::Finished);
        Ok(Some(Stored { frame, grid, film, rounds: round.rounds, is_final }))
    }
}

impl Stored {
    fn tile(&self, tile: u32) -> TileState {
        TileState {
            frame: self.frame,
            tile,
            rounds: self.rounds,
            is_final: self.is_final,
            picture: self.film.region(self.grid.tile_region(tile)),
        }
    }
}

/// The frames that a viewer asked for.
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

/// What was found of a tile in memory.
enum Looked {
    /// The frame is being rendered; the tile may have no round yet.
    Live(Option<Box<TileState>>),
    /// The frame is not in memory.
    Gone,
}

/// The newest state of a tile of a frame that is being rendered; nothing when no round of it is there.
fn live_tile(shared: &Shared, job: &str, frame: i32, tile: u32) -> Looked {
    let Some(live) = shared.live.get(job, frame) else { return Looked::Gone };
    let merged = live.merged();
    let rounds = merged.rounds[tile as usize];
    let state = || TileState {
        frame,
        tile,
        rounds,
        is_final: merged.complete,
        picture: merged.film.region(live.grid.tile_region(tile)),
    };
    Looked::Live((rounds > 0).then(|| Box::new(state())))
}
