//! Owns root finding in a bracket.

/// One end of a bracket: where, and the value there.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    pub(super) at: f32,
    pub(super) value: f32,
}

/// The positive end of a bracket of width `tolerance` or less (which must be at least 2 ulp) around a sign change between `low` (value > 0) and
/// `high` (value <= 0), by ITP (Oliveira and Takahashi 2020): superlinear on smooth functions and never more than
/// one evaluation worse than bisection.
pub(super) fn find(low: End, high: End, tolerance: f32, mut value: impl FnMut(f32) -> f32) -> f32 {
    let (mut low, mut high) = (low, high);
    let half = 0.5 * tolerance.max(f32::MIN_POSITIVE);
    let first = high.at - low.at;
    // Bisection would need this many steps; each step may use up as much width as bisection would have left it.
    let steps = bisections(first, 2.0 * half) + 1;
    let mut slack = half * pow2(steps);
    for _ in 0..=steps {
        let width = high.at - low.at;
        if width <= 2.0 * half {
            break;
        }
        let middle = low.at + 0.5 * width;
        let falsi = (high.value * low.at - low.value * high.at) / (high.value - low.value);
        let falsi = if falsi.is_finite() { falsi } else { middle };
        // Truncate towards the middle, then project into the range that keeps the bound of bisection.
        let nudge = 0.2 * width * width / first;
        let to_middle = middle - falsi;
        let truncated = if nudge <= to_middle.abs() { falsi + nudge.copysign(to_middle) } else { middle };
        let radius = (slack - 0.5 * width).max(0.0);
        let at = truncated.clamp(middle - radius, middle + radius).clamp(low.at + half, high.at - half);
        slack *= 0.5;
        let end = End { at, value: value(at) };
        if end.value > 0.0 {
            low = end;
        } else {
            high = end;
        }
    }
    low.at
}

/// How many halvings bring `width` to `goal` or less.
fn bisections(width: f32, goal: f32) -> u32 {
    let mut left = width;
    let mut count = 0;
    while left > goal && count < 64 {
        left *= 0.5;
        count += 1;
    }
    count
}

fn pow2(exponent: u32) -> f32 {
    (0..exponent).fold(1.0, |power, _| power * 2.0)
}

#[cfg(test)]
mod tests {
    use super::{End, find};

    fn solve(f: impl Fn(f32) -> f32, low: f32, high: f32) -> (f32, u32) {
        let mut calls = 0;
        let root = find(End { at: low, value: f(low) }, End { at: high, value: f(high) }, 2.4e-7, |t| {
            calls += 1;
            f(t)
        });
        (root, calls)
    }

    #[test]
    fn smooth_functions_take_few_evaluations() {
        let (root, calls) = solve(|t| 2.0 - t * t, 1.0, 2.0);
        assert!((root - std::f32::consts::SQRT_2).abs() < 3e-7, "{root}");
        assert!(calls <= 12, "{calls}");
    }

    #[test]
    fn a_jump_is_bisected() {
        let (root, calls) = solve(|t| if t < 0.7 { 1e3 } else { -1e-6 }, 0.0, 1.0);
        assert!((root - 0.7).abs() < 3e-7, "{root}");
        assert!(calls <= 26, "{calls}");
    }
}
