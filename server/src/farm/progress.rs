//! Owns how it is going: samples per second and the time that is left, for people to look at.

use std::time::Duration;

use karst_core::scene::Goal;

use crate::farm::feed::Progress;
use crate::farm::jobs::{LiveJob, LiveJobs, Rendering, Stage};
use crate::farm::live::LiveFrame;

/// Measures the speed of a job.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    last: Option<(i32, u64)>,
    per_second: f64,
}

impl Meter {
    /// Takes the samples of the frame after another `period`; the speed is a mean over some seconds.
    fn update(&mut self, frame: i32, samples: u64, period: Duration) -> f64 {
        if let Some((last_frame, last)) = self.last
            && last_frame == frame
        {
            let now = samples.saturating_sub(last) as f64 / period.as_secs_f64();
            let weight = if self.per_second > 0.0 { 0.2 } else { 1.0 };
            self.per_second += weight * (now - self.per_second);
        }
        self.last = Some((frame, samples));
        self.per_second
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
    fn speed_settles_and_survives_the_change_of_frames() {
        let mut meter = Meter::default();
        let half = Duration::from_millis(500);
        assert_eq!(meter.update(1, 100, half), 0.0);
        assert_eq!(meter.update(1, 200, half), 200.0);
        assert_eq!(meter.update(2, 0, half), 200.0, "another frame says nothing about the speed");
        assert!(meter.update(2, 50, half) < 200.0);
    }
}
