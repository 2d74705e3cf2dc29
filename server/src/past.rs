//! Owns what has gone wrong with a task so far, and when it is not tried again. Pure.
//!
//! Three counts, because they mean different things: a task that fails says something about itself, a worker that
//! vanishes says a little about what it was doing, and one that is told to end says nothing.

use serde::{Deserialize, Serialize};

/// Failures after which a task is not tried again, if they happened at two workers or there is only one.
const MAX_FAILED: usize = 3;
/// Workers that may vanish with a task in hand, where they seldom vanish.
const MAX_LOST: u32 = 3;
/// Where they vanish all the time: so many more than expected, in standard deviations of the number that chance
/// brings (a Poisson number).
const BEYOND_CHANCE: f64 = 4.0;
/// More is too much in any case.
const MOST_LOST: u32 = 30;

/// What has gone wrong with a task.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Past {
    /// At which workers it failed, once for each time.
    pub failed: Vec<String>,
    /// How often a worker vanished that was rendering it.
    pub lost: u32,
    /// How often that was to be expected, as often as workers vanish anyway.
    #[serde(default)]
    pub expected_losses: f64,
    /// How often it was handed back.
    pub interrupted: u32,
}

/// What happened to a task that was not finished.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Trouble {
    /// It cannot be rendered, because of this.
    Failed(String),
    /// The worker vanished.
    Lost {
        /// How many losses chance alone would have brought meanwhile.
        expected: f64,
    },
    /// The worker was told to end, or never began it.
    Interrupted,
}

impl Past {
    /// Counts what happened at `worker`.
    pub(crate) fn add(&mut self, worker: &str, trouble: &Trouble) {
        match trouble {
            Trouble::Failed(_) => self.failed.push(worker.to_owned()),
            Trouble::Lost { expected } => {
                self.lost += 1;
                self.expected_losses += expected;
            }
            Trouble::Interrupted => self.interrupted += 1,
        }
    }

    /// Whether it must be tried alone: it may be what makes workers fail.
    pub(crate) fn is_suspect(&self) -> bool {
        self.lost > 0 || !self.failed.is_empty()
    }

    /// Whether somebody other than `worker` should try it, where `workers` can.
    pub(crate) fn avoids(&self, worker: &str, workers: usize) -> bool {
        self.failed.iter().any(|w| w == worker) && self.places() < workers
    }

    /// Why it is not tried again, where `workers` could try it; `None` while it is.
    pub(crate) fn given_up(&self, workers: usize) -> Option<String> {
        let by_chance = self.expected_losses + BEYOND_CHANCE * self.expected_losses.sqrt();
        if self.lost >= MOST_LOST || (self.lost >= MAX_LOST && f64::from(self.lost) > by_chance) {
            return Some(format!("{} workers vanished while they rendered it", self.lost));
        }
        let enough = self.failed.len() >= MAX_FAILED && (self.places() >= 2 || workers <= 1);
        enough.then(|| format!("it failed {} times at {} worker(s)", self.failed.len(), self.places()))
    }

    fn places(&self) -> usize {
        self.failed.iter().collect::<std::collections::BTreeSet<_>>().len()
    }
}

#[cfg(test)]
mod tests {
    use super::{Past, Trouble};

    fn after(troubles: &[(&str, Trouble)]) -> Past {
        let mut past = Past::default();
        for (worker, trouble) in troubles {
            past.add(worker, trouble);
        }
        past
    }

    fn failed() -> Trouble {
        Trouble::Failed("why".into())
    }

    fn lost(expected: f64) -> Trouble {
        Trouble::Lost { expected }
    }

    #[test]
    fn losses_say_little_where_workers_vanish_all_the_time() {
        // Workers that live as long as a tile takes.
        assert_eq!(after(&vec![("a", lost(0.8)); 20]).given_up(9), None);
        assert!(after(&vec![("a", lost(0.8)); 30]).given_up(9).is_some(), "there is an end to everything");
        // A tile that kills within a second, where one worker in a hundred seconds vanishes anyway.
        assert!(after(&vec![("a", lost(0.01)); 3]).given_up(9).is_some());
        // It kills while everybody is being killed, and goes on when that is over.
        let mut past = after(&vec![("a", lost(0.5)); 4]);
        assert_eq!(past.given_up(9), None);
        (0..5).for_each(|_| past.add("a", &lost(0.0)));
        assert!(past.given_up(9).is_some());
    }

    #[test]
    fn three_failures_at_two_workers_are_enough() {
        assert_eq!(after(&[("a", failed()), ("b", failed())]).given_up(5), None);
        let at_one = after(&[("a", failed()), ("a", failed()), ("a", failed())]);
        assert_eq!(at_one.given_up(2), None, "one broken worker must not condemn a task");
        assert!(at_one.given_up(1).is_some(), "nobody else can try it");
        let at_two = after(&[("a", failed()), ("a", failed()), ("b", failed())]);
        assert!(at_two.given_up(2).unwrap().contains("3 times at 2 worker(s)"));
    }

    #[test]
    fn a_failed_task_goes_to_somebody_else_while_there_is_one() {
        let past = after(&[("a", failed())]);
        assert!(past.avoids("a", 2) && !past.avoids("b", 2));
        assert!(!past.avoids("a", 1));
        let everywhere = after(&[("a", failed()), ("b", failed())]);
        assert!(!everywhere.avoids("a", 2));
        assert!(past.is_suspect());
    }

    #[test]
    fn losses_count_and_interruptions_do_not() {
        assert!(after(&vec![("a", lost(0.0)); 3]).given_up(9).is_some());
        assert!(after(&vec![("a", lost(0.0)); 2]).given_up(9).is_none());
        let often = after(&vec![("a", Trouble::Interrupted); 1000]);
        assert_eq!(often.given_up(1), None);
        assert!(!often.is_suspect());
    }
}
