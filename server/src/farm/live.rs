//! Owns the frames that are being rendered: their films, shared between the ledger that merges, the loop that plans
//! and the previews that look.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use karst_core::film::{Film, Round, TileGrid};
use karst_core::scene::Scene;

use crate::digest::Digest;

/// A frame that is being rendered.
#[derive(Debug)]
pub struct LiveFrame {
    /// The job's place in the queue.
    pub number: i64,
    /// The job's id.
    pub job: Arc<str>,
    /// Frame number.
    pub frame: i32,
    /// What is rendered.
    pub scene: Arc<Scene>,
    /// Its tiles.
    pub grid: TileGrid,
    /// Workers drop what they do for this frame.
    pub stop: AtomicBool,
    current: Mutex<Current>,
    /// Samples in the film.
    samples: AtomicU64,
    merged: Mutex<Merged>,
}

/// The round that is being rendered.
#[derive(Debug, Default)]
struct Current {
    round: Option<Arc<Round>>,
    /// Tiles of it that no worker has finished.
    unrendered: BTreeSet<u32>,
}

/// What is merged; everything in it is durable.
#[derive(Debug)]
pub struct Merged {
    /// The film.
    pub film: Film,
    /// For each tile how many rounds are in the film.
    pub rounds: Vec<u32>,
    /// No further round.
    pub complete: bool,
    /// The stored film after the last finished round.
    pub stored: Option<Digest>,
    /// Stored results since then.
    pub packs: Vec<Digest>,
    /// The round whose results are taken.
    pub round: u32,
    /// Rises when a result was replaced: plans made before are void.
    pub version: u32,
    /// Who brought the results of this round, and what they are, by tile.
    pub accepted: BTreeMap<u32, Vote>,
    /// Tiles of this round about which workers disagree, with the results that came after the accepted one.
    pub disputes: BTreeMap<u32, Vec<Vote>>,
}

/// A result as somebody brought it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vote {
    /// The worker's id.
    pub worker: String,
    /// The result's digest.
    pub digest: Digest,
}

impl LiveFrame {
    /// A frame with what is merged already.
    pub fn new(place: (i64, Arc<str>, i32), scene: Arc<Scene>, grid: TileGrid, merged: Merged) -> Self {
        let (number, job, frame) = place;
        let samples = AtomicU64::new(merged.film.summary().samples);
        Self {
            number,
            job,
            frame,
            scene,
            grid,
            stop: AtomicBool::new(false),
            current: Mutex::default(),
            samples,
            merged: Mutex::new(merged),
        }
    }

    /// What is merged.
    pub fn merged(&self) -> MutexGuard<'_, Merged> {
        self.merged.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A round begins in which these tiles have to be rendered.
    pub fn begin_round(&self, round: Arc<Round>, tiles: &[u32]) {
        *self.current() = Current { round: Some(round), unrendered: tiles.iter().copied().collect() };
    }

    /// The round that is being rendered.
    pub fn current_round(&self) -> Option<Arc<Round>> {
        self.current().round.clone()
    }

    /// A tile was rendered; true when it was the last one of the round.
    pub fn tile_rendered(&self, tile: u32) -> bool {
        let mut current = self.current();
        current.unrendered.remove(&tile) && current.unrendered.is_empty()
    }

    fn current(&self) -> MutexGuard<'_, Current> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether a result of this round is still wanted for a tile.
    pub fn is_open(&self, round: u32, tile: u32) -> bool {
        let merged = self.merged();
        merged.round == round
            && (merged.rounds[tile as usize] <= round || merged.disputes.contains_key(&tile))
    }

    /// Samples in the film.
    pub fn samples(&self) -> u64 {
        self.samples.load(Ordering::Relaxed)
    }

    /// Counts samples that were merged.
    pub fn add_samples(&self, samples: u64) {
        self.samples.fetch_add(samples, Ordering::Relaxed);
    }

    /// Whether its workers should drop what they do.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// By job and frame number.
type Frames = HashMap<(Arc<str>, i32), Arc<LiveFrame>>;

/// All frames that are being rendered.
#[derive(Debug, Default)]
pub struct Live {
    frames: Mutex<Frames>,
}

impl Live {
    /// The frame, if it is being rendered.
    pub fn get(&self, job: &str, frame: i32) -> Option<Arc<LiveFrame>> {
        self.lock().get(&(Arc::from(job), frame)).cloned()
    }

    /// Adds a frame.
    pub fn insert(&self, frame: Arc<LiveFrame>) {
        self.lock().insert((Arc::clone(&frame.job), frame.frame), frame);
    }

    /// Removes a frame: it is stored or given up.
    pub fn remove(&self, job: &str, frame: i32) -> Option<Arc<LiveFrame>> {
        self.lock().remove(&(Arc::from(job), frame))
    }

    fn lock(&self) -> MutexGuard<'_, Frames> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
