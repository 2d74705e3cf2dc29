//! Owns integrals over rectangles: Gauss and Legendre's rule of 4 × 4 points, halved where it does not agree with itself.

use std::ops::Range;

/// A rectangle of the plane.
#[derive(Debug, Clone)]
pub(crate) struct Rect(pub(crate) [Range<f64>; 2]);

const NODES: [f64; 4] = [-0.861_136_311_594_052_6, -0.339_981_043_584_856_3, 0.339_981_043_584_856_3, 0.861_136_311_594_052_6];
const WEIGHTS: [f64; 4] = [0.347_854_845_137_453_85, 0.652_145_154_862_546_1, 0.652_145_154_862_546_1, 0.347_854_845_137_453_85];

impl Rect {
    /// The parts below and above `at` along an axis.
    pub(crate) fn split(&self, axis: usize, at: f64) -> [Self; 2] {
        let (mut below, mut above) = (self.clone(), self.clone());
        below.0[axis].end = at;
        above.0[axis].start = at;
        [below, above]
    }

    fn quarters(&self) -> [Self; 4] {
        let [left, right] = self.split(0, self.middle(0));
        let [a, b] = left.split(1, self.middle(1));
        let [c, d] = right.split(1, self.middle(1));
        [a, b, c, d]
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

    /// The integral of `f`, each part with an error of about `tolerance`; parts are quartered at most `depth` times.
    pub(crate) fn integral(&self, f: &dyn Fn([f64; 2]) -> f64, tolerance: f64, depth: u32) -> f64 {
        self.refined(f, self.rule(f), tolerance, depth)
    }

    fn refined(&self, f: &dyn Fn([f64; 2]) -> f64, whole: f64, tolerance: f64, depth: u32) -> f64 {
        let quarters = self.quarters();
        let parts = quarters.each_ref().map(|q| q.rule(f));
        let sum: f64 = parts.iter().sum();
        if (sum - whole).abs() <= tolerance || depth == 0 {
            return sum;
        }
        quarters.iter().zip(parts).map(|(q, part)| q.refined(f, part, 0.5 * tolerance, depth - 1)).sum()
    }
}

#[test]
fn integrals_of_smooth_and_of_cut_functions() {
    let square = Rect([0.0..2.0, 0.0..3.0]);
    let smooth = square.integral(&|[x, y]| x * x * x * y * y, 1e-9, 8);
    assert!((smooth - 36.0).abs() < 1e-9, "{smooth}");
    let peak = square.integral(&|[x, y]| 1.0 / (1e-4 + (x - 1.0).powi(2) + (y - 1.0).powi(2)), 1e-4, 12);
    assert!((peak - 29.77).abs() < 0.02, "{peak}");
    let cut = square.integral(&|[x, y]| if x + y < 1.0 { 1.0 } else { 0.0 }, 1e-6, 10);
    assert!((cut - 0.5).abs() < 1e-3, "{cut}");
}
