//! Owns what has gone wrong with a task so far, and when it is not tried again. Pure.
//!
//! Three counts, because they mean different things: a task that fails says something about itself, a worker that
//! vanishes says a little about what it was doing, and one that is told to end says nothing.

use serde::{Deserialize, Serialize};

/// Failures after which a task is not tried again, if they happened at two workers or there is only one.
const MAX_FAILED: usize = 3;
/// Workers that may vanish with a task in hand.
const MAX_LOST: u32 = 3;

/// What has gone wrong with a task.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Past {
    /// At which workers it failed, once for each time.
    pub failed: Vec<String>,
    /// How often a worker vanished that was rendering it.
    pub lost: u32,
    /// How often it was handed back.
    pub interrupted: u32,
}

/// What happened to a task that was not finished.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// It cannot be rendered, because of this.
    Failed(String),
    /// The worker vanished.
    Lost,
    /// The worker was told to end, or never began it.
    Interrupted,
}

impl Past {
    /// Counts what happened at `worker`.
    pub(crate) fn add(&mut self, worker: &str, trouble: &Trouble) {
        match trouble {
            Trouble::Failed(_) => self.failed.push(worker.to_owned()),
            Trouble::Lost => self.lost += 1,
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
        if self.lost >= MAX_LOST {
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
        assert!(
            after(&[("a", Trouble::Lost), ("b", Trouble::Lost), ("c", Trouble::Lost)]).given_up(9).is_some()
        );
        let often = after(&vec![("a", Trouble::Interrupted); 1000]);
        assert_eq!(often.given_up(1), None);
        assert!(!often.is_suspect());
    }
}
