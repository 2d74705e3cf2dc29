//! Owns how much work a worker gets at once: some seconds of it, less near the end of a round. Pure.

use crate::farm::queue::Task;

/// Seconds of work in one lease: long enough that asking costs nothing, short enough that a lost one does not hurt.
const SECONDS: f64 = 8.0;
/// Tasks in one lease.
const MOST: usize = 128;

/// How fast a worker is.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pace {
    /// The job that was measured.
    job: String,
    /// Samples that one thread takes in a second; 0 while unknown.
    per_second: f64,
}

impl Pace {
    /// A thread took so many samples of a job in so many seconds.
    pub(crate) fn add(&mut self, job: &str, samples: u64, seconds: f64) {
        if !(seconds.is_finite() && seconds > 0.0) {
            return;
        }
        let now = samples as f64 / seconds.clamp(1e-6, 1e6);
        if self.job != job {
            *self = Self { job: job.to_owned(), per_second: 0.0 };
        }
        let weight = if self.per_second > 0.0 { 0.3 } else { 1.0 };
        self.per_second += weight * (now - self.per_second);
    }

    /// How long a thread will be busy with a task; `None` while nothing is known of its job.
    pub(crate) fn seconds(&self, task: &Task) -> Option<f64> {
        self.seconds_for(&task.frame.job, task.round.tile_samples(&task.frame.grid, task.tile))
    }

    fn seconds_for(&self, job: &str, samples: u64) -> Option<f64> {
        (self.job == job && self.per_second > 0.0).then(|| samples as f64 / self.per_second)
    }
}

/// Says of each further task whether it belongs in a lease for `idle` threads, where `open` tasks wait for
/// `everybody`'s threads.
///
/// Guided self-scheduling (Polychronopoulos and Kuck 1987): nobody takes more than half of his share of what is
/// open, so leases shrink towards the end of a round and all end at about the same time.
pub(crate) fn batch(
    pace: Pace,
    idle: u32,
    open: usize,
    everybody: usize,
) -> impl FnMut(&Task) -> bool + use<> {
    let idle = idle.max(1) as usize;
    let share = (open * idle).div_ceil(2 * everybody.max(1));
    let most = share.clamp(idle, MOST);
    let mut taken = 0;
    let mut left = SECONDS * idle as f64;
    move |task| {
        // Without experience one task for each thread tells enough.
        let seconds = pace.seconds(task);
        let fits = taken < idle || (seconds.is_some_and(|s| s <= left) && taken < most);
        taken += 1;
        left -= seconds.unwrap_or(SECONDS);
        fits
    }
}

#[cfg(test)]
mod tests {
    use super::Pace;

    #[test]
    fn pace_is_of_one_job_and_ignores_nonsense() {
        let mut pace = Pace::default();
        assert_eq!(pace.seconds_for("j", 100), None);
        for nonsense in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            pace.add("j", 100, nonsense);
        }
        assert_eq!(pace.seconds_for("j", 100), None);
        pace.add("j", 1000, 2.0);
        assert_eq!(pace.seconds_for("j", 100), Some(0.2));
        pace.add("j", 2000, 2.0);
        assert!(pace.seconds_for("j", 650).unwrap() - 1.0 < 1e-9);
        assert_eq!(pace.seconds_for("k", 100), None);
    }
}
