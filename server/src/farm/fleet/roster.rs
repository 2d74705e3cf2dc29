//! Owns the answer to the question who is there: the workers as people and metrics see them.

use super::Fleet;

/// Whether a worker renders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WorkerStanding {
    /// Takes work.
    Alive,
    /// Was told to end.
    Draining,
    /// Was not heard of for too long.
    Lost,
    /// Brought wrong results.
    Blocked,
}

impl WorkerStanding {
    /// All of them.
    pub(crate) const ALL: [Self; 4] = [Self::Alive, Self::Draining, Self::Lost, Self::Blocked];

    /// One word.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Alive => "alive",
            Self::Draining => "draining",
            Self::Lost => "lost",
            Self::Blocked => "blocked",
        }
    }
}

/// A worker process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Member {
    /// Its id.
    pub worker: String,
    /// For people.
    pub display_name: String,
    /// Threads that render.
    pub threads: u32,
    /// Whether it renders.
    pub standing: WorkerStanding,
    /// Leases with tasks that it has not reported.
    pub leases: usize,
    /// These tasks.
    pub tasks: usize,
}

impl Fleet {
    /// Every worker that is remembered, by its id; without those that said that they would leave and have left.
    pub(crate) fn roster(&self) -> Vec<Member> {
        let inner = self.lock();
        let member = |(id, worker): (&String, &super::Worker)| {
            let open = inner.held.values().filter(|h| h.worker == *id && !h.tasks.is_empty());
            let sizes: Vec<usize> = open.map(|h| h.tasks.len()).collect();
            Member {
                worker: id.clone(),
                display_name: worker.name.clone(),
                threads: worker.threads,
                standing: worker.standing(),
                leases: sizes.len(),
                tasks: sizes.iter().sum(),
            }
        };
        let is_here = |(_, worker): &(&String, &super::Worker)| !(worker.lost && worker.draining);
        inner.workers.iter().filter(is_here).map(member).collect()
    }

    /// Tasks that nobody has taken.
    pub(crate) fn open_tasks(&self) -> usize {
        self.queue.len()
    }

    /// Threads that render in this process.
    pub(crate) fn local_threads(&self) -> usize {
        self.local
    }
}

impl super::Worker {
    fn standing(&self) -> WorkerStanding {
        if self.blocked.is_some() {
            WorkerStanding::Blocked
        } else if self.lost {
            WorkerStanding::Lost
        } else if self.draining {
            WorkerStanding::Draining
        } else {
            WorkerStanding::Alive
        }
    }
}
