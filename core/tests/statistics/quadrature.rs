//! Owns integrals over rectangles: Lobatto's rule of 5 × 5 points, halved where it does not agree with itself.

use std::ops::Range;

/// A rectangle of the plane.
#[derive(Debug, Clone)]
pub(crate) struct Rect(pub(crate) [Range<f64>; 2]);

/// Nodes at both ends: a peak at a corner of a rectangle, however narrow, is seen.
const NODES: [f64; 5] = [-1.0, -0.654_653_670_707_977_1, 0.0, 0.654_653_670_707_977_1, 1.0];
const WEIGHTS: [f64; 5] = [0.1, 49.0 / 90.0, 32.0 / 45.0, 49.0 / 90.0, 0.1];

impl Rect {
    /// The parts below and above `at` along an axis.
    pub(crate) fn split(&self, axis: usize, at: f64) -> [Self; 2] {
        let (mut below, mut above) = (self.clone(), self.clone());
        below.0[axis].end = at;
        above.0[axis].start = at;
        [below, above]
    }

    fn middle(&self, axis: usize) -> f64 {
        0.5 * (self.0[axis].start + self.0[axis].end)
    }

    fn rule(&self, f: &dyn Fn([f64; 2]) -> f64) -> f64 {
        let half = [0, 1].map(|axis| 0.5 * (self.0[axis].end - self.0[axis].start));
        let mut sum = 0.0;
        for (x, wx) in NODES.iter().zip(WEIGHTS) {
            for (y, wy) in NODES.iter().zip(WEIGHTS) {
                sum += wx * wy * f([self.middle(0) + half[0] * x, self.middle(1) + half[1] * y]);
            }
        }
        sum * half[0] * half[1]
    }

    /// The integral of `f`, each part of it with an error below `tolerance`; parts are halved at most `depth` times, each
    /// time along the axis along which the rule agrees less with itself.
    pub(crate) fn integral(&self, f: &dyn Fn([f64; 2]) -> f64, tolerance: f64, depth: u32) -> f64 {
        self.refined(f, self.rule(f), tolerance, depth)
    }

    fn refined(&self, f: &dyn Fn([f64; 2]) -> f64, whole: f64, tolerance: f64, depth: u32) -> f64 {
        let halves = [0, 1].map(|axis| self.split(axis, self.middle(axis)));
        let parts = halves.each_ref().map(|pair| pair.each_ref().map(|half| half.rule(f)));
        let sums = parts.map(|[a, b]| a + b);
        assert!((sums[0] + sums[1]).is_finite(), "the function is not finite somewhere in {self:?}");
        let axis = usize::from((sums[1] - whole).abs() > (sums[0] - whole).abs());
        if (sums[axis] - whole).abs() <= tolerance || depth == 0 {
            return sums[axis];
        }
        halves[axis]
            .iter()
            .zip(parts[axis])
            .map(|(half, part)| half.refined(f, part, tolerance, depth - 1))
            .sum()
    }
}

#[test]
fn integrals_of_smooth_and_of_cut_functions() {
    let square = Rect([0.0..2.0, 0.0..3.0]);
    let smooth = square.integral(&|[x, y]| x * x * x * y * y, 1e-9, 16);
    assert!((smooth - 36.0).abs() < 1e-9, "{smooth}");
    let ridge = |x: f64| 1.0 / (1e-4 + (x - 1.0).powi(2));
    let peak = square.integral(&|[x, y]| ridge(x) * ridge(y), 1e-3, 24);
    let want = 1e4 * 2.0 * libm::atan(100.0) * (libm::atan(100.0) + libm::atan(200.0));
    assert!((peak / want - 1.0).abs() < 1e-6, "{peak} {want}");
    let cut = square.integral(&|[x, y]| if x + y < 1.0 { 1.0 } else { 0.0 }, 1e-6, 20);
    assert!((cut - 0.5).abs() < 1e-3, "{cut}");
}
