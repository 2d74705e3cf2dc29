//! Owns the stored films that are in memory for those who look: each once, however many look at it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use karst_core::film::Film;
use tokio::sync::Semaphore;

use crate::blobs::Blobs;
use crate::digest::Digest;
use crate::error::Error;
use crate::farm::prepare::read_film;

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
