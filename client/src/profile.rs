//! Where the time of a render goes: seconds of each stage, over all threads.

use std::sync::atomic::{AtomicU64, Ordering};

use karst_core::integrator::{Stage, StageObserver};
use serde_json::{Map, Value};

use crate::clock::Stopwatch;

/// Nanoseconds by stage, added up by many threads.
#[derive(Debug, Default)]
pub(crate) struct Profile([AtomicU64; Stage::ALL.len()]);

impl Profile {
    /// Somebody to watch one tile.
    pub(crate) fn watch(&self) -> Watch<'_> {
        Watch { profile: self, running: None }
    }

    /// Seconds by stage, those that took any.
    pub(crate) fn seconds(&self) -> Vec<(Stage, f64)> {
        let seconds = self.0.iter().map(|nanos| nanos.load(Ordering::Relaxed) as f64 * 1e-9);
        Stage::ALL.into_iter().zip(seconds).filter(|(_, seconds)| *seconds > 0.0).collect()
    }

    /// The same for a report.
    pub(crate) fn to_json(&self) -> Map<String, Value> {
        self.seconds().into_iter().map(|(stage, seconds)| (stage.name().to_owned(), seconds.into())).collect()
    }
}

/// A table of them for people: the longest first, each with its share.
pub(crate) fn table(profile: &Map<String, Value>) -> String {
    let mut rows: Vec<(&str, f64)> =
        profile.iter().map(|(name, seconds)| (name.as_str(), seconds.as_f64().unwrap_or(0.0))).collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let total: f64 = rows.iter().map(|row| row.1).sum();
    let line = |name: &str, seconds: f64| {
        format!("  {name:<12}{seconds:>10.3} s {:>5.1} %", 100.0 * seconds / total.max(f64::MIN_POSITIVE))
    };
    let lines: Vec<String> = rows.into_iter().map(|(name, seconds)| line(name, seconds)).collect();
    format!("time by stage, all threads together:\n{}", lines.join("\n"))
}

/// Times the stages of a tile on one thread.
#[derive(Debug)]
pub(crate) struct Watch<'a> {
    profile: &'a Profile,
    running: Option<(Stage, Stopwatch)>,
}

impl Watch<'_> {
    fn end(&mut self) {
        if let Some((stage, clock)) = self.running.take() {
            self.profile.0[stage as usize].fetch_add((clock.seconds() * 1e9) as u64, Ordering::Relaxed);
        }
    }
}

impl StageObserver for Watch<'_> {
    fn begin(&mut self, stage: Stage) {
        self.end();
        self.running = Some((stage, Stopwatch::start()));
    }
}

impl Drop for Watch<'_> {
    fn drop(&mut self) {
        self.end();
    }
}

#[cfg(test)]
mod tests {
    use super::{Profile, table};
    use karst_core::integrator::{Stage, StageObserver as _};
    use std::time::Duration;

    #[test]
    fn a_stage_lasts_until_the_next_begins_or_the_tile_ends() {
        let profile = Profile::default();
        let mut watch = profile.watch();
        watch.begin(Stage::Camera);
        watch.begin(Stage::Shadow);
        std::thread::sleep(Duration::from_millis(20));
        drop(watch);
        let seconds = profile.seconds();
        let of = |stage| seconds.iter().find(|(s, _)| *s == stage).map_or(0.0, |(_, seconds)| *seconds);
        assert!(of(Stage::Shadow) >= 0.02 && of(Stage::Camera) < of(Stage::Shadow), "{seconds:?}");
        let table = table(&profile.to_json());
        assert!(table.lines().nth(1).is_some_and(|line| line.trim().starts_with("shadow")), "{table}");
    }
}
