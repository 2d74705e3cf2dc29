//! Owns how it is going: samples per second and the time that is left, for people to look at.

use std::collections::VecDeque;
use std::time::Duration;

use karst_core::scene::Goal;

use crate::farm::feed::Progress;
use crate::farm::jobs::{LiveJob, LiveJobs, Rendering, Stage};
use crate::farm::live::LiveFrame;

/// Periods over which the speed is taken: results come tile by tile, which on slow scenes is every few seconds.
const PERIODS: usize = 60;

/// Measures the speed of a job.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    last: Option<(i32, u64)>,
    /// Samples of each of the last periods, from the first result on.
    recent: VecDeque<u64>,
}

impl Meter {
    /// Takes the samples of the frame after another `period`; the samples per second over the last ones, 0 while
    /// there are none.
    fn update(&mut self, frame: i32, samples: u64, period: Duration) -> f64 {
        let before = self.last.replace((frame, samples)).filter(|(last_frame, _)| *last_frame == frame);
        // Another frame says nothing about the speed.
        if let Some(new) = before.map(|(_, last)| samples.saturating_sub(last))
            && (new > 0 || !self.recent.is_empty())
        {
            self.recent.push_back(new);
        }
        if self.recent.len() > PERIODS {
            self.recent.pop_front();
        }
        let seconds = self.recent.len() as f64 * period.as_secs_f64();
        if seconds > 0.0 { self.recent.iter().sum::<u64>() as f64 / seconds } else { 0.0 }
    }
}

impl LiveJobs {
    /// How each live job is going, `period` after the last call.
    pub(crate) fn progress(&mut self, period: Duration) -> Vec<(String, Option<Progress>)> {
        self.iter_mut().map(|job| (job.id.to_string(), of_job(job, period))).collect()
    }
}

fn of_job(job: &mut LiveJob, period: Duration) -> Option<Progress> {
    let (frame, rendering) = job.stages.values().find_map(|stage| match stage {
        Stage::Rendering(frame, rendering) => Some((frame, rendering)),
        Stage::Opening | Stage::Ready(_) | Stage::Finishing(_) => None,
    })?;
    let done = frame.samples();
    let planned = planned(frame, rendering, done);
    let per_second = job.meter.update(frame.frame, done, period);
    let waiting =
        job.run.frames.values().filter(|f| !f.state.is_final() && !job.stages.contains_key(&f.frame));
    let left = planned.saturating_sub(done) as f64 + waiting.count() as f64 * planned as f64;
    Some(Progress {
        frame: frame.frame,
        samples_done: done,
        samples_planned: planned,
        samples_per_second: per_second,
        rel_mse: rendering.rel_mse,
        seconds_left: (per_second > 0.0).then(|| left / per_second),
        frames_finished: job.run.job.frames_finished,
        frames_total: job.run.job.frames_total,
    })
}

/// Samples of the whole frame. With a target the error is expected to fall as 1/n from where it is.
fn planned(frame: &LiveFrame, rendering: &Rendering, done: u64) -> u64 {
    let pixels = frame.grid.window().area() as u64;
    match frame.scene.sampling().goal {
        Goal::Fixed { spp } => pixels * u64::from(spp),
        Goal::Error { target, max_spp, .. } => {
            let expected = rendering.rel_mse.map_or(0.0, |e| done as f64 * e / (target * target));
            rendering.planned_samples.max((expected as u64).min(pixels * u64::from(max_spp)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Meter;
    use std::time::Duration;

    #[test]
    fn speed_is_a_mean_that_survives_the_change_of_frames() {
        let mut meter = Meter::default();
        let half = Duration::from_millis(500);
        assert_eq!(meter.update(1, 100, half), 0.0);
        assert_eq!(meter.update(1, 100, half), 0.0, "nothing has come yet");
        assert_eq!(meter.update(1, 200, half), 200.0);
        assert_eq!(meter.update(2, 0, half), 200.0);
        assert_eq!(meter.update(2, 50, half), 150.0);
    }

    #[test]
    fn results_that_come_in_bursts_do_not_let_the_speed_jump() {
        let mut meter = Meter::default();
        let half = Duration::from_millis(500);
        let mut found = Vec::new();
        for period in 0..200_u64 {
            // A tile of 1000 samples every ten periods.
            found.push(meter.update(1, period / 10 * 1000, half));
        }
        assert!(found[60..].iter().all(|speed| (speed - 200.0).abs() < 40.0), "{found:?}");
    }
}
