//! Owns the stored films, and which of them are in memory for those who look: each once, however many look at it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use karst_core::film::Film;
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;

use crate::blobs::{Blobs, Kind};
use crate::digest::Digest;
use crate::error::Error;

/// Films that are read at the same time: each may be large.
const READING: usize = 4;

/// The films.
#[derive(Debug)]
pub(crate) struct Films {
    blobs: Blobs,
    reading: Semaphore,
    known: Mutex<Known>,
}

#[derive(Debug, Default)]
struct Known {
    by_digest: HashMap<Digest, Weak<Film>>,
    /// The one that was asked for last stays: a probe asks for it pixel by pixel.
    last: Option<Arc<Film>>,
}

impl Films {
    pub(crate) fn new(blobs: Blobs) -> Self {
        Self { blobs, reading: Semaphore::new(READING), known: Mutex::default() }
    }

    /// The film with this digest.
    ///
    /// # Errors
    /// [`Error::Gone`], [`Error::Corrupt`], a failing disk.
    pub(crate) async fn get(&self, digest: Digest) -> Result<Arc<Film>, Error> {
        if let Some(film) = self.find(digest) {
            return Ok(film);
        }
        let permit = self.reading.acquire().await;
        // Somebody else may have read it meanwhile.
        if let Some(film) = self.find(digest) {
            return Ok(film);
        }
        let film = Arc::new(read_film(&self.blobs, digest).await?);
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.by_digest.retain(|_, film| film.strong_count() > 0);
        known.by_digest.insert(digest, Arc::downgrade(&film));
        known.last = Some(Arc::clone(&film));
        drop(permit);
        Ok(film)
    }

    fn find(&self, digest: Digest) -> Option<Arc<Film>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let film = known.by_digest.get(&digest)?.upgrade()?;
        known.last = Some(Arc::clone(&film));
        Some(film)
    }
}

/// A stored film.
///
/// # Errors
/// [`Error::Gone`], [`Error::Corrupt`], a failing disk.
pub(crate) async fn read_film(blobs: &Blobs, digest: Digest) -> Result<Film, Error> {
    let bytes = blobs.get(Kind::Film, digest).await?;
    spawn_blocking(move || Film::from_bytes(&bytes).map_err(|_| Error::Corrupt(digest))).await?
}
