//! Owns the scenes that a worker renders: fetched and built when a lease needs them, a few kept.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use karst_core::film::TileGrid;
use karst_core::scene::{Limits, Scene};
use karst_proto::v1::workers_client::WorkersClient;
use karst_proto::v1::{self, GetJobSpecRequest};
use tokio::task::spawn_blocking;

use crate::digest::Digest;
use crate::error::Error;
use crate::farm::prepare::{self, Context};
use crate::service::convert;
use crate::work::cache::{Cache, CachedFiles};
use crate::work::connection::Link;

/// Frames and jobs that are kept: the one that is rendered, the next, and one that comes back.
const KEPT: usize = 3;

/// A frame as a worker sees it.
#[derive(Debug)]
pub(crate) struct WorkFrame {
    /// What is rendered.
    pub scene: Scene,
    /// Its tiles.
    pub grid: TileGrid,
    /// Threads drop what they do for it.
    pub stop: AtomicBool,
}

/// The scenes, the newest last.
#[derive(Debug)]
pub(crate) struct Scenes {
    cache: Cache,
    limits: Limits,
    jobs: Vec<(String, Arc<Context>)>,
    frames: Vec<((String, i32), Arc<WorkFrame>)>,
}

impl Scenes {
    /// No scenes.
    pub(crate) fn new(cache: Cache) -> Self {
        Self { cache, limits: Limits::default(), jobs: Vec::new(), frames: Vec::new() }
    }

    /// The frame of a job, fetched and built if it is not here.
    ///
    /// # Errors
    /// Says what could not be had or built.
    pub(crate) async fn frame(
        &mut self,
        job: &str,
        frame: i32,
        link: &Link,
    ) -> Result<Arc<WorkFrame>, String> {
        let key = (job.to_owned(), frame);
        if let Some((_, frame)) = self.frames.iter().find(|(k, _)| *k == key) {
            return Ok(Arc::clone(frame));
        }
        let context = self.context(job, link).await?;
        let limits = self.limits.clone();
        let tile_size = context.spec.tile_size;
        let build = move || prepare::build(&context, &limits, frame);
        let scene = spawn_blocking(build).await.map_err(|e| e.to_string())?.map_err(|e| e.to_string())?;
        let grid = TileGrid::new(scene.window(), tile_size);
        let built = Arc::new(WorkFrame { scene, grid, stop: AtomicBool::new(false) });
        keep(&mut self.frames, key, Arc::clone(&built));
        Ok(built)
    }

    async fn context(&mut self, job: &str, link: &Link) -> Result<Arc<Context>, String> {
        if let Some((_, context)) = self.jobs.iter().find(|(id, _)| id == job) {
            return Ok(Arc::clone(context));
        }
        let mut calls = WorkersClient::new(link.line.clone());
        let request = GetJobSpecRequest { job: job.to_owned() };
        let spec = calls.get_job_spec(request).await.map_err(|e| e.message().to_owned())?.into_inner();
        let context = Arc::new(self.load(&spec, link).await?);
        keep(&mut self.jobs, job.to_owned(), Arc::clone(&context));
        Ok(context)
    }

    async fn load(&self, spec: &v1::JobSpec, link: &Link) -> Result<Context, String> {
        let spec = convert::spec(Some(spec)).map_err(|e| e.to_string())?;
        let digests: Vec<Digest> = spec.files.values().copied().chain([spec.scene]).collect();
        for digest in digests {
            self.cache.fetch(digest, link).await.map_err(|e| e.to_string())?;
        }
        let files: BTreeMap<String, Digest> = spec.files.clone();
        let (source, limits) = (CachedFiles { cache: self.cache.clone(), files }, self.limits.clone());
        let load = move || {
            let text = source.blob(spec.scene)?;
            prepare::load_from(&text, &source, &limits, spec)
        };
        spawn_blocking(load).await.map_err(|e| e.to_string())?.map_err(|e: Error| e.to_string())
    }
}

fn keep<K, V>(kept: &mut Vec<(K, V)>, key: K, value: V) {
    kept.push((key, value));
    if kept.len() > KEPT {
        kept.remove(0);
    }
}
