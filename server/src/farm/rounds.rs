//! Owns the way of a frame through the farm: made ready, begun, rendered round by round, finished.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::Arc;

use karst_core::film::{Film, FrameSummary, Round};
use karst_core::render::next_round;
use karst_core::scene::{ErrorOf, Goal, Scene};
use tokio::task::spawn_blocking;

use crate::clock;
use crate::error::Error;
use crate::farm::denoised::Replicates;
use crate::farm::finish::finish;
use crate::farm::jobs::{Begun, Rendering, Stage};
use crate::farm::ledger::NewFilm;
use crate::farm::live::LiveFrame;
use crate::farm::prepare::{self, Context, Opened};
use crate::farm::queue::Task;
use crate::farm::{Event, Farm, Plan, Shared};
use crate::job::Event as JobEvent;
use crate::model::{FrameState, RoundReport, Statistics};
use crate::past::Past;
use crate::spec::{Denoise, JobSpec};
use crate::telemetry::traces::Taken;

/// Frames that are rendered, finished or made ready at the same time: bounds the memory for films and scenes.
const MAX_LIVE_FRAMES: usize = 4;

impl Farm {
    /// Keeps the workers busy: begins frames that are ready, and makes the next one ready.
    pub(super) async fn fill(&mut self) {
        while self.queue.is_low()
            && let Some((number, frame)) = self.jobs.first_ready()
        {
            self.begin(number, frame).await;
        }
        if self.jobs.live_frames() < MAX_LIVE_FRAMES
            && let Some((job, frame)) = self.jobs.next_to_open()
        {
            let (shared, events) = (Arc::clone(&self.shared), self.events.clone());
            let (number, id) = (job.number, Arc::clone(&job.id));
            let (context, scene) = (job.context.clone(), job.take_first(frame));
            let spec = job.run.job.spec.clone();
            let is_rendered = job.run.frames.get(&frame).is_some_and(|f| f.state == FrameState::Finishing);
            tokio::spawn(async move {
                let opened = open(&shared, (number, id, frame), (context, scene), (spec, is_rendered)).await;
                let _ = events.send(Event::Opened(number, frame, Box::new(opened)));
            });
        }
    }

    /// Begins a frame that is ready, or goes on with it.
    async fn begin(&mut self, number: i64, frame: i32) {
        let Some(Begun { frame: live, state, round, past }) = self.jobs.begin(number, frame) else { return };
        self.shared.live.insert(Arc::clone(&live));
        self.frame_begins(&live, state);
        let tiles: Vec<u32> = (0..live.grid.tile_count()).collect();
        self.shared.hub.publish(&live.job, frame, &tiles);
        let mut events = Vec::new();
        if state == FrameState::Pending {
            events.push(JobEvent::FrameBegan(frame, clock::now()));
        }
        if round.is_none() && state != FrameState::Finishing {
            events.push(JobEvent::FrameRendered(frame));
        }
        self.step(number, events, None, None).await;
        match round {
            Some(round) => self.begin_round(live, &round, past),
            None => self.finish(live),
        }
    }

    /// Opens the tasks of a round that are not merged already.
    fn begin_round(&mut self, frame: Arc<LiveFrame>, round: &Arc<Round>, mut past: BTreeMap<u32, Past>) {
        let merged: Vec<u32> = frame.merged().rounds.clone();
        let open: Vec<u32> = (0..frame.grid.tile_count())
            .filter(|&tile| merged[tile as usize] <= round.index && !round.tile_is_empty(&frame.grid, tile))
            .collect();
        self.round_begins(&frame, round.index);
        frame.begin_round(Arc::clone(round), &open);
        self.jobs.begin_round(&frame, round, open.len() as u32);
        if open.is_empty() {
            self.plan(frame);
            return;
        }
        self.queue.push(open.into_iter().map(|tile| Task {
            frame: Arc::clone(&frame),
            round: Arc::clone(round),
            tile,
            past: past.remove(&tile).unwrap_or_default(),
            taken: Taken::default(),
        }));
    }

    /// All results of a round are merged: evaluates it.
    pub(super) fn plan(&self, frame: Arc<LiveFrame>) {
        let Some(done) = self.jobs.round_of(&frame).map(|round| round + 1) else { return };
        let Some(denoise) = self.jobs.denoise_of(frame.number) else { return };
        let (events, finishing) = (self.events.clone(), Arc::clone(&self.finishing));
        tokio::spawn(async move {
            // What denoises waits for its turn.
            let _turn = if is_judged_denoised(&frame.scene) { finishing.acquire().await.ok() } else { None };
            let planned = spawn_blocking(move || {
                let plan = plan(&frame, done, denoise);
                Event::Planned(frame, Box::new(plan))
            });
            if let Ok(planned) = planned.await {
                let _ = events.send(planned);
            }
        });
    }

    pub(super) async fn planned(&mut self, frame: Arc<LiveFrame>, plan: Plan) {
        {
            let mut merged = frame.merged();
            // Void: the round ended by another plan, or a result is disputed or was replaced meanwhile.
            if merged.round != plan.round || merged.version != plan.version || !merged.disputes.is_empty() {
                return;
            }
            merged.round += 1;
            merged.accepted.clear();
        }
        let Some(Rendering { round, seconds, .. }) = self.jobs.finish_round(&frame, &plan.summary) else {
            return;
        };
        self.round_ended(&frame);
        let out_of_time = frame.scene.sampling().time_limit.is_some_and(|limit| seconds >= limit);
        let next = plan.next.filter(|_| !out_of_time);
        let report = report(round, seconds, &plan.summary);
        let mut events = vec![JobEvent::RoundFinished(frame.frame, report)];
        if next.is_none() {
            events.push(JobEvent::FrameRendered(frame.frame));
        }
        let film = NewFilm { frame: Arc::clone(&frame), rounds: round + 1, bytes: plan.film };
        self.step(frame.number, events, Some(film), None).await;
        match next {
            Some(next) => self.begin_round(frame, &Arc::new(next), BTreeMap::new()),
            None => self.finish(frame),
        }
    }

    fn finish(&mut self, frame: Arc<LiveFrame>) {
        frame.merged().complete = true;
        let tiles: Vec<u32> = (0..frame.grid.tile_count()).collect();
        self.shared.hub.publish(&frame.job, frame.frame, &tiles);
        let Some(job) = self.jobs.get_mut(frame.number) else { return };
        job.stages.insert(frame.frame, Stage::Finishing(Arc::clone(&frame)));
        let denoise = job.run.job.spec.denoise;
        let (blobs, events) = (self.shared.blobs.clone(), self.events.clone());
        let finishing = Arc::clone(&self.finishing);
        tokio::spawn(async move {
            let _turn = finishing.acquire().await;
            let finished = finish(Arc::clone(&frame), denoise, &blobs).await;
            let _ = events.send(Event::Finished(frame, finished));
        });
    }
}

/// The plan after `done` rounds. Blocks.
///
/// The film is not held while it is denoised, which takes seconds: if it is another one afterwards, the version says so.
fn plan(frame: &LiveFrame, done: u32, denoise: Denoise) -> Plan {
    let (scene, grid) = (&frame.scene, &frame.grid);
    let (version, replicates) = {
        let merged = frame.merged();
        let asked = Cell::new(false);
        let ask = |_: &Film| {
            asked.set(true);
            None
        };
        if is_judged_denoised(scene) && !frame.is_stopped() {
            next_round(scene.sampling(), grid, &merged.film, done, &ask);
        }
        let replicates = if asked.get() { Replicates::of(&merged.film, scene) } else { None };
        (merged.version, replicates.map(|replicates| (replicates, merged.film.picture())))
    };
    let judgement = replicates.map(|(replicates, layers)| replicates.judgement(&layers, denoise));
    let film = &frame.merged().film;
    let next = next_round(scene.sampling(), grid, film, done, &|film| judgement?.of(film));
    Plan { round: done - 1, version, summary: film.summary(), next, film: film.to_bytes().into() }
}

fn is_judged_denoised(scene: &Scene) -> bool {
    matches!(scene.sampling().goal, Goal::Error { of: ErrorOf::Denoised, .. })
}

async fn open(
    shared: &Shared,
    place: (i64, Arc<str>, i32),
    known: (Option<Arc<Context>>, Option<Arc<Scene>>),
    (spec, is_rendered): (JobSpec, bool),
) -> Result<(Arc<Context>, Opened), Error> {
    let (context, scene) = known;
    let how = prepare::How { tile_size: spec.tile_size, denoise: spec.denoise, is_rendered };
    let context = match context {
        Some(context) => context,
        None => Arc::new(prepare::load(&shared.blobs, &shared.limits, spec).await?),
    };
    let scene = if let Some(scene) = scene {
        scene
    } else {
        let (context, limits, frame) = (Arc::clone(&context), shared.limits.clone(), place.2);
        Arc::new(spawn_blocking(move || prepare::build(&context, &limits, frame)).await??)
    };
    let opened = prepare::open(place, scene, how, (&shared.state, &shared.blobs)).await?;
    Ok((context, opened))
}

fn report(round: u32, seconds: f64, summary: &FrameSummary) -> RoundReport {
    let counters = summary.counters;
    RoundReport {
        round,
        spp: summary.spp_mean,
        rel_mse: summary.rel_mse,
        rel_mse_ci95: summary.rel_mse_ci95,
        seconds,
        statistics: Statistics {
            samples: summary.samples,
            rays: counters.rays,
            shadow_rays: counters.shadow_rays,
            nonfinite: counters.nan_samples + counters.infinite_samples,
            exhausted: counters.exhausted_rays,
            sdf_evaluations: counters.sdf_evaluations,
        },
    }
}
