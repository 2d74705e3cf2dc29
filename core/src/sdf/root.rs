//! Owns root finding in a bracket.

use std::ops::ControlFlow;

/// One end of a bracket: where, and the value there.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub(super) at: f32,
    pub(super) value: f32,
}

/// The search for the positive end of a bracket of width `tolerance` or less (which must be at least 2 ulp) around a
/// sign change, by ITP (Oliveira and Takahashi 2020): superlinear on smooth functions and never more than one evaluation
/// worse than bisection.
#[derive(Debug, Clone)]
pub(super) struct Search {
    low: End,
    high: End,
    /// Where the value is asked for.
    at: f32,
    /// Half the tolerance.
    half: f32,
    /// Width of the bracket at the start.
    first: f32,
    slack: f32,
    /// Evaluations left.
    left: u32,
}

impl Search {
    /// A search between `low` (value > 0) and `high` (value <= 0).
    pub(super) fn new(low: End, high: End, tolerance: f32) -> Self {
        let half = 0.5 * tolerance.max(f32::MIN_POSITIVE);
        let first = high.at - low.at;
        // Bisection would need this many steps; each step may use up as much width as bisection would have left it.
        let steps = bisections(first, 2.0 * half) + 1;
        Self { low, high, at: low.at, half, first, slack: half * pow2(steps), left: steps + 1 }
    }

    /// Where to evaluate next; at the end, the root.
    pub(super) fn next(&mut self) -> ControlFlow<f32, f32> {
        let (low, high, half) = (self.low, self.high, self.half);
        let width = high.at - low.at;
        if width <= 2.0 * half || self.left == 0 {
            return ControlFlow::Break(low.at);
        }
        self.left -= 1;
        let middle = low.at + 0.5 * width;
        let falsi = (high.value * low.at - low.value * high.at) / (high.value - low.value);
        let falsi = if falsi.is_finite() { falsi } else { middle };
        // Truncate towards the middle, then project into the range that keeps the bound of bisection.
        let nudge = 0.2 * width * width / self.first;
        let to_middle = middle - falsi;
        let truncated = if nudge <= to_middle.abs() { falsi + nudge.copysign(to_middle) } else { middle };
        let radius = (self.slack - 0.5 * width).max(0.0);
        self.slack *= 0.5;
        self.at = truncated.clamp(middle - radius, middle + radius).clamp(low.at + half, high.at - half);
        ControlFlow::Continue(self.at)
    }

    /// Takes the value where it was asked for.
    pub(super) fn tell(&mut self, value: f32) {
        let end = End { at: self.at, value };
        if value > 0.0 {
            self.low = end;
        } else {
            self.high = end;
        }
    }
}

/// How many halvings bring `width` to `goal` or less, 64 at most.
fn bisections(width: f32, goal: f32) -> u32 {
    let ratio = width / goal;
    if ratio <= 1.0 || ratio.is_nan() {
        return 0;
    }
    // The exponent of the ratio, rounded up.
    let bits = ratio.to_bits();
    (bits >> 23).saturating_sub(127).saturating_add(u32::from(bits & 0x7f_ffff != 0)).min(64)
}

/// 2 to the power of a small number.
fn pow2(exponent: u32) -> f32 {
    f32::from_bits((exponent.min(127) + 127) << 23)
}

#[cfg(test)]
mod tests {
    use super::{End, Search};
    use std::ops::ControlFlow;

    fn solve(f: impl Fn(f32) -> f32, low: f32, high: f32) -> (f32, u32) {
        let mut search =
            Search::new(End { at: low, value: f(low) }, End { at: high, value: f(high) }, 2.4e-7);
        let mut calls = 0;
        loop {
            match search.next() {
                ControlFlow::Break(root) => return (root, calls),
                ControlFlow::Continue(at) => search.tell(f(at)),
            }
            calls += 1;
        }
    }

    #[test]
    fn smooth_functions_take_few_evaluations() {
        let (root, calls) = solve(|t| 2.0 - t * t, 1.0, 2.0);
        assert!((root - std::f32::consts::SQRT_2).abs() < 3e-7, "{root}");
        assert!(calls <= 12, "{calls}");
    }

    #[test]
    fn halvings_are_counted() {
        for (width, goal, count) in
            [(1.0, 1.0, 0), (1.0, 0.5, 1), (1.0, 0.49, 2), (1.0, 1e-30, 64), (0.0, 0.0, 0)]
        {
            assert_eq!(super::bisections(width, goal), count, "{width} to {goal}");
        }
        assert_eq!([0, 1, 24].map(super::pow2), [1.0, 2.0, 16_777_216.0]);
    }

    #[test]
    fn a_jump_is_bisected() {
        let (root, calls) = solve(|t| if t < 0.7 { 1e3 } else { -1e-6 }, 0.0, 1.0);
        assert!((root - 0.7).abs() < 3e-7, "{root}");
        assert!(calls <= 26, "{calls}");
    }
}
