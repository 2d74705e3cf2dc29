//! Owns rendering a whole frame on this machine.

use super::{next_round, render_tile_observed};
use crate::film::{Film, FrameSummary, Round, TileGrid};
use crate::integrator::{StageObserver, Unobserved};
use crate::scene::Scene;
use rayon::prelude::{IndexedParallelIterator, IntoParallelIterator, ParallelIterator};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// How far a frame is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// The round that is running, from 0.
    pub round: u32,
    /// Samples taken since the frame began, over all pixels.
    pub samples_done: u64,
    /// Samples taken when the running round ends.
    pub samples_round: u64,
    /// Error after the last finished round.
    pub rel_mse: Option<f64>,
}

/// Somebody who watches a frame being rendered. Called from many threads; pixels do not depend on it.
pub trait FrameObserver: Sync {
    /// A tile has been finished.
    fn tile_done(&self, _progress: &Progress) {}

    /// Who is told, within a tile that begins, which part of the work does.
    fn stages(&self) -> Box<dyn StageObserver + '_> {
        Box::new(Unobserved)
    }

    /// What the relMSE of the denoised picture is at most, for frames that go on until it is small; `None` where it is
    /// unknown.
    fn denoised_error(&self, _film: &Film) -> Option<f64> {
        None
    }

    /// A round has been finished and another is due; false ends the frame here (a time limit).
    fn another_round(&self, _summary: &FrameSummary) -> bool {
        true
    }
}

/// Renders a frame round by round on the current rayon pool. `None` when `stop` was set.
pub fn render_frame(
    scene: &Scene,
    tile_size: u32,
    stop: &AtomicBool,
    observer: &dyn FrameObserver,
) -> Option<Film> {
    let grid = TileGrid::new(scene.window(), tile_size);
    let mut film = Film::new(scene.size(), scene.window(), scene.exposure());
    let mut done = 0;
    let mut samples = 0;
    let denoised = |film: &Film| observer.denoised_error(film);
    while let Some(round) = next_round(scene.sampling(), &grid, &film, done, &denoised) {
        let summary = film.summary();
        if done > 0 && !observer.another_round(&summary) {
            break;
        }
        film = render_round(
            &Context { scene, grid, stop, observer },
            film,
            &round,
            &mut samples,
            summary.rel_mse,
        )?;
        done += 1;
    }
    Some(film)
}

struct Context<'a> {
    scene: &'a Scene,
    grid: TileGrid,
    stop: &'a AtomicBool,
    observer: &'a dyn FrameObserver,
}

fn render_round(
    context: &Context<'_>,
    film: Film,
    round: &Round,
    samples: &mut u64,
    rel_mse: Option<f64>,
) -> Option<Film> {
    let Context { scene, grid, stop, observer } = context;
    let end = *samples + round.samples(grid);
    let taken = AtomicU64::new(*samples);
    let film = Mutex::new(film);
    // A thread takes one tile at a time, so that none waits for another's last ones: rounds are short.
    // Tiles merge as they come: within a round they touch different pixels, so the order changes nothing.
    let all_done = (0..grid.tile_count())
        .into_par_iter()
        .with_max_len(1)
        .filter(|&t| !round.tile_is_empty(grid, t))
        .all(|tile| {
            let rendered = render_tile_observed(scene, grid, tile, round, stop, &mut *observer.stages());
            let Some(result) = rendered else { return false };
            let merged = film.lock().unwrap_or_else(PoisonError::into_inner).merge(&result);
            debug_assert!(merged.is_ok(), "a round that was planned from the film fits it");
            let samples_done =
                taken.fetch_add(result.counters.samples, Ordering::Relaxed) + result.counters.samples;
            observer.tile_done(&Progress { round: round.index, samples_done, samples_round: end, rel_mse });
            merged.is_ok()
        });
    *samples = end;
    all_done.then(|| film.into_inner().unwrap_or_else(PoisonError::into_inner))
}
