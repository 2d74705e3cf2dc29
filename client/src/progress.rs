//! The progress bar on stderr: samples, estimated error, time left. Nothing where stderr is not a terminal.

use std::fmt::Write as _;
use std::time::Duration;

use indicatif::{HumanCount, HumanDuration, ProgressBar, ProgressStyle};

/// The state to show.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Shown {
    /// Frame number, and how many of how many are finished.
    pub(crate) frame: i32,
    pub(crate) frames_finished: u32,
    pub(crate) frames_total: u32,
    pub(crate) samples_done: u64,
    pub(crate) samples_planned: u64,
    /// Root of relMSE.
    pub(crate) error: Option<f64>,
    pub(crate) seconds_left: Option<f64>,
}

/// A bar over the samples of the current frame.
#[derive(Debug)]
pub(crate) struct Bar(ProgressBar);

impl Bar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{prefix}{wide_bar} {percent:>3}%  {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        Self(bar)
    }

    pub(crate) fn show(&self, shown: &Shown) {
        self.0.set_length(shown.samples_planned);
        self.0.set_position(shown.samples_done);
        if shown.frames_total > 1 {
            let number = (shown.frames_finished + 1).min(shown.frames_total);
            self.0.set_prefix(format!("frame {} ({number}/{}) ", shown.frame, shown.frames_total));
        }
        self.0.set_message(describe(shown));
    }

    /// Prints a line above the bar.
    pub(crate) fn note(&self, text: &str) {
        self.0.suspend(|| crate::talk::Talk::default().say(&text));
    }

    pub(crate) fn clear(&self) {
        self.0.finish_and_clear();
    }
}

fn describe(shown: &Shown) -> String {
    let mut text = format!("{} samples", HumanCount(shown.samples_done));
    if let Some(error) = shown.error {
        let _ = write!(text, ", error {}", percent(error));
    }
    if let Some(left) = shown.seconds_left.filter(|left| left.is_finite() && *left >= 0.0) {
        let _ = write!(text, ", {} left", HumanDuration(Duration::from_secs_f64(left.min(1e9))));
    }
    text
}

/// An error as a percentage with two significant digits at least.
pub(crate) fn percent(error: f64) -> String {
    if error < 0.001 { format!("{:.3} %", error * 100.0) } else { format!("{:.2} %", error * 100.0) }
}

#[cfg(test)]
mod tests {
    use super::{Shown, describe};

    #[test]
    fn unknown_figures_are_left_out() {
        let shown = Shown { samples_done: 1_234_567, ..Shown::default() };
        assert_eq!(describe(&shown), "1,234,567 samples");
        let shown = Shown { error: Some(0.0431), seconds_left: Some(42.0), ..shown };
        assert_eq!(describe(&shown), "1,234,567 samples, error 4.31 %, 42 seconds left");
        let shown = Shown { error: None, seconds_left: Some(f64::NAN), ..shown };
        assert_eq!(describe(&shown), "1,234,567 samples");
    }
}
