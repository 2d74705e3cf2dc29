//! Owns where the frames of the live jobs stand in memory: which is next, which is ready, which round it is in.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use karst_core::film::{FrameSummary, Round};
use karst_core::scene::Scene;
use tokio::time::Instant;

use crate::farm::Checked;
use crate::farm::live::LiveFrame;
use crate::farm::prepare::{Context, Opened};
use crate::farm::progress::Meter;
use crate::farm::spans::Times;
use crate::job::JobRun;
use crate::model::FrameState;
use crate::past::Past;
use crate::spec::Denoise;
use crate::state::StoredJob;

/// Where a frame stands; a frame without a stage waits for its turn or has ended.
#[derive(Debug)]
pub(crate) enum Stage {
    /// Its scene is being built.
    Opening,
    /// Workers may begin.
    Ready(Opened),
    /// In a round.
    Rendering(Arc<LiveFrame>, Rendering),
    /// Its files are being made.
    Finishing(Arc<LiveFrame>),
}

/// A frame in a round.
#[derive(Debug, Clone)]
pub(crate) struct Rendering {
    /// Index of the round.
    pub round: u32,
    /// Tiles of it that are not accepted.
    pub missing: u32,
    /// Samples in the film when the round is finished.
    pub planned_samples: u64,
    /// Estimated relMSE after the round before.
    pub rel_mse: Option<f64>,
    /// Seconds of rendering up to `since`.
    pub seconds: f64,
    /// When this server began or went on with the frame.
    pub since: Instant,
}

/// A frame that workers may begin, or go on with.
#[derive(Debug)]
pub(crate) struct Begun {
    /// The frame.
    pub frame: Arc<LiveFrame>,
    /// Where it stands.
    pub state: FrameState,
    /// The round it goes on with.
    pub round: Option<Arc<Round>>,
    /// What has gone wrong with tiles of that round.
    pub past: BTreeMap<u32, Past>,
}

/// A job that is not in a final state.
#[derive(Debug)]
pub(crate) struct LiveJob {
    /// Its place in the queue.
    pub number: i64,
    /// Its id.
    pub id: Arc<str>,
    /// The job and its frames.
    pub run: JobRun,
    /// Document and assets, once they were needed.
    pub context: Option<Arc<Context>>,
    /// The scene of a fresh job's first frame.
    first: Option<Arc<Scene>>,
    /// Frames that are under way.
    pub stages: BTreeMap<i32, Stage>,
    /// Measures how it is going.
    pub meter: Meter,
    /// When what is under way began.
    pub times: Times,
}

impl LiveJob {
    /// A job that nobody works on.
    pub(crate) fn new(stored: StoredJob, checked: Option<Checked>) -> Self {
        let (context, first) = checked.map_or((None, None), |c| (Some(c.context), Some(c.first)));
        Self {
            number: stored.number,
            id: Arc::from(stored.run.job.id.as_str()),
            run: stored.run,
            context,
            first,
            stages: BTreeMap::new(),
            meter: Meter::default(),
            times: Times::default(),
        }
    }

    /// The scene that was built when the job was checked, if it is that of `frame`.
    pub(crate) fn take_first(&mut self, frame: i32) -> Option<Arc<Scene>> {
        let first = self.first.take();
        first.filter(|_| self.run.frames.keys().next() == Some(&frame))
    }

    /// Stops the workers on a frame and forgets where it stood.
    pub(crate) fn stop(&mut self, frame: i32) -> Option<Arc<LiveFrame>> {
        let live = match self.stages.remove(&frame)? {
            Stage::Opening => return None,
            Stage::Ready(opened) => opened.frame,
            Stage::Rendering(live, _) | Stage::Finishing(live) => live,
        };
        live.stop.store(true, Ordering::Relaxed);
        Some(live)
    }
}

/// All live jobs in the order of their submission.
#[derive(Debug, Default)]
pub(crate) struct LiveJobs {
    jobs: BTreeMap<i64, LiveJob>,
}

impl LiveJobs {
    pub(crate) fn is_empty(&self) -> bool {
        self.jobs.is_empty()
    }

    pub(crate) fn insert(&mut self, job: LiveJob) {
        self.jobs.insert(job.number, job);
    }

    pub(crate) fn remove(&mut self, number: i64) {
        self.jobs.remove(&number);
    }

    /// Whether and how a job's frames are denoised.
    pub(crate) fn denoise_of(&self, number: i64) -> Option<Denoise> {
        self.jobs.get(&number).map(|job| job.run.job.spec.denoise)
    }

    pub(crate) fn get_mut(&mut self, number: i64) -> Option<&mut LiveJob> {
        self.jobs.get_mut(&number)
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut LiveJob> {
        self.jobs.values_mut()
    }

    pub(crate) fn number_of(&self, id: &str) -> Option<i64> {
        self.jobs.values().find(|j| &*j.id == id).map(|j| j.number)
    }

    /// All frames that are in memory.
    pub(crate) fn frames(&self) -> impl Iterator<Item = &Arc<LiveFrame>> {
        self.jobs.values().flat_map(|j| j.stages.values()).filter_map(|stage| match stage {
            Stage::Opening => None,
            Stage::Ready(opened) => Some(&opened.frame),
            Stage::Rendering(live, _) | Stage::Finishing(live) => Some(live),
        })
    }

    /// Number of frames that are under way.
    pub(crate) fn live_frames(&self) -> usize {
        self.jobs.values().map(|j| j.stages.len()).sum()
    }

    /// The first frame that workers may begin.
    pub(crate) fn first_ready(&self) -> Option<(i64, i32)> {
        self.jobs.values().find_map(|job| {
            let ready = job.stages.iter().find(|(_, stage)| matches!(stage, Stage::Ready(_)))?;
            Some((job.number, *ready.0))
        })
    }

    /// Marks the next frame as being opened, unless one is being opened or ready already.
    pub(crate) fn next_to_open(&mut self) -> Option<(&mut LiveJob, i32)> {
        let waiting = |stage: &Stage| matches!(stage, Stage::Opening | Stage::Ready(_));
        if self.jobs.values().any(|j| j.stages.values().any(waiting)) {
            return None;
        }
        let next = |job: &LiveJob| {
            let open = job.run.frames.values().filter(|f| !f.state.is_final());
            open.map(|f| f.frame).find(|frame| !job.stages.contains_key(frame))
        };
        let (job, frame) = self.jobs.values_mut().find_map(|job| next(job).map(|frame| (job, frame)))?;
        job.stages.insert(frame, Stage::Opening);
        Some((job, frame))
    }

    /// A frame is ready, unless it was stopped meanwhile.
    pub(crate) fn opened(&mut self, number: i64, frame: i32, context: Arc<Context>, opened: Opened) {
        let Some(job) = self.jobs.get_mut(&number) else { return };
        job.context = Some(context);
        if let Some(stage) = job.stages.get_mut(&frame) {
            *stage = Stage::Ready(opened);
        }
    }

    /// Takes a ready frame.
    pub(crate) fn begin(&mut self, number: i64, frame: i32) -> Option<Begun> {
        let job = self.jobs.get_mut(&number)?;
        let Some(Stage::Ready(opened)) = job.stages.remove(&frame) else { return None };
        let report = job.run.frames.get(&frame)?;
        let rendering = Rendering {
            round: 0,
            missing: 0,
            planned_samples: 0,
            rel_mse: report.rel_mse,
            seconds: report.seconds,
            since: Instant::now(),
        };
        let state = report.state;
        job.stages.insert(frame, Stage::Rendering(Arc::clone(&opened.frame), rendering));
        Some(Begun { frame: opened.frame, state, round: opened.round, past: opened.past })
    }

    /// A round begins that waits for `missing` tiles.
    pub(crate) fn begin_round(&mut self, frame: &LiveFrame, round: &Round, missing: u32) {
        if let Some(rendering) = self.rendering(frame) {
            rendering.round = round.index;
            rendering.missing = missing;
            rendering.planned_samples = frame.samples() + round.samples(&frame.grid);
        }
    }

    /// Tiles were accepted; true when the round is complete.
    pub(crate) fn accepted(&mut self, frame: &LiveFrame, tiles: u32) -> bool {
        self.rendering(frame).is_some_and(|rendering| {
            rendering.missing = rendering.missing.saturating_sub(tiles);
            rendering.missing == 0
        })
    }

    /// Nothing is missing in the round that a frame is in.
    pub(crate) fn is_complete(&mut self, frame: &LiveFrame) -> bool {
        self.rendering(frame).is_some_and(|rendering| rendering.missing == 0)
    }

    /// The round that a frame is in.
    pub(crate) fn round_of(&self, frame: &LiveFrame) -> Option<u32> {
        match self.jobs.get(&frame.number)?.stages.get(&frame.frame)? {
            Stage::Rendering(_, rendering) => Some(rendering.round),
            Stage::Opening | Stage::Ready(_) | Stage::Finishing(_) => None,
        }
    }

    /// A round was evaluated: how the frame stood in it, with the seconds up to now.
    pub(crate) fn finish_round(&mut self, frame: &LiveFrame, summary: &FrameSummary) -> Option<Rendering> {
        let rendering = self.rendering(frame)?;
        let now = Instant::now();
        rendering.seconds += now.duration_since(rendering.since).as_secs_f64();
        rendering.since = now;
        rendering.rel_mse = summary.rel_mse;
        Some(rendering.clone())
    }

    fn rendering(&mut self, frame: &LiveFrame) -> Option<&mut Rendering> {
        match self.jobs.get_mut(&frame.number)?.stages.get_mut(&frame.frame)? {
            Stage::Rendering(_, rendering) => Some(rendering),
            Stage::Opening | Stage::Ready(_) | Stage::Finishing(_) => None,
        }
    }
}
