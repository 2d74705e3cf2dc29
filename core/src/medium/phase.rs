//! Owns the phase function of Henyey and Greenstein (1941).

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::math::{Frame, sin_cos_turn};

/// How light is scattered in a medium, by the mean cosine `g` between the directions before and after: −0.99 to 0.99.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phase {
    g: f32,
}

impl Phase {
    /// The phase function of a mean cosine.
    pub fn new(g: f32) -> Self {
        Self { g }
    }

    /// The mean cosine.
    pub fn g(&self) -> f32 {
        self.g
    }

    /// Share of light that travels along `before` and goes on along `after`, per solid angle; both are unit vectors.
    /// This is also the density with which [`Phase::sample`] takes the direction.
    ///
    /// 1 − cos comes from the difference of the directions, because in a narrow lobe the cosine has lost it.
    pub fn value(&self, before: Vec3, after: Vec3) -> f32 {
        let apart = if self.g >= 0.0 { before - after } else { before + after };
        self.lobe(0.5 * apart.length_squared())
    }

    /// The value by 1 − cos, or for backward scattering 1 + cos.
    fn lobe(self, off: f32) -> f32 {
        let g = self.g.abs();
        let k = (1.0 - g) * (1.0 - g) + 2.0 * g * off;
        (1.0 - g * g) / (4.0 * PI * k * k.sqrt())
    }

    /// A direction after one, by `u`, and its density per solid angle.
    pub fn sample(&self, before: Vec3, u: Vec2) -> (Vec3, f32) {
        let cos = self.cosine(u.x);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos_turn(u.y);
        let after = Frame::new(before).to_world(Vec3::new(sin * cos_phi, sin * sin_phi, cos)).normalize();
        (after, self.value(before, after))
    }

    /// The cosine that a share `u` of the light stays below.
    ///
    /// The inverse as printed divides by g; for small g it is multiplied out, in which form nothing cancels.
    fn cosine(self, u: f32) -> f32 {
        let (g, m) = (self.g, 2.0 * u - 1.0);
        let cos = if g.abs() < 0.5 {
            let above = m + 0.5 * g * (m * m + 3.0) + g * g * m + 0.5 * g * g * g * (m * m - 1.0);
            above / ((1.0 + g * m) * (1.0 + g * m))
        } else {
            let share = (1.0 - g * g) / (1.0 + g * m);
            (1.0 + g * g - share * share) / (2.0 * g)
        };
        cos.clamp(-1.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::Phase;
    use glam::{Vec2, Vec3};
    use std::f64::consts::PI;

    const ALL: [f32; 11] = [-0.99, -0.9, -0.5, -0.3, -1e-6, 0.0, 1e-6, 1e-4, 0.5, 0.85, 0.99];

    #[test]
    fn cosines_stay_in_range_and_have_the_mean_g() {
        for g in ALL {
            let phase = Phase::new(g);
            let count = 1_000_000;
            let mut sum = 0.0;
            for i in 0..count {
                let cos = phase.cosine((i as f32 + 0.5) / count as f32);
                assert!((-1.0..=1.0).contains(&cos), "g {g}: {cos}");
                sum += f64::from(cos);
            }
            let mean = sum / f64::from(count);
            assert!((mean - f64::from(g)).abs() < 1e-4, "g {g}: mean {mean}");
            for u in [0.0, 1.0 - f32::EPSILON / 2.0] {
                assert!((-1.0..=1.0).contains(&phase.cosine(u)), "g {g}, u {u}");
            }
        }
    }

    #[test]
    fn cosines_are_those_of_the_distribution() {
        for g in ALL {
            let phase = Phase::new(g);
            for i in 0..=1000 {
                let u = f64::from(i) / 1000.0;
                let cos = f64::from(phase.cosine(u as f32));
                // The share below a cosine, in f64, by its series where g is small.
                let g = f64::from(g);
                let below = if g.abs() < 1e-3 {
                    0.5 * (1.0 + cos) + 0.75 * g * (cos * cos - 1.0)
                } else {
                    let k = (1.0 + g * g - 2.0 * g * cos).max(0.0).sqrt();
                    (1.0 - g * g) / (2.0 * g) * (1.0 / k - 1.0 / (1.0 + g))
                };
                assert!((below - u).abs() < 2e-5 + 1e-3 * g.abs().powi(40), "g {g}, u {u}: {below}");
            }
        }
    }

    #[test]
    fn the_whole_is_one_and_samples_have_their_value() {
        for g in ALL {
            let phase = Phase::new(g);
            // By the cosine, with steps that narrow towards both ends.
            let count = 200_000;
            let mut sum = 0.0;
            for i in 0..count {
                let x = (f64::from(i) + 0.5) / f64::from(count) * PI;
                let off = if g >= 0.0 { 1.0 - libm::cos(x) } else { 1.0 + libm::cos(x) };
                sum += f64::from(phase.lobe(off as f32)) * libm::sin(x) * 2.0 * PI * PI / f64::from(count);
            }
            assert!((sum - 1.0).abs() < 1e-3, "g {g}: {sum}");
            let before = Vec3::new(0.3, -0.5, 0.7).normalize();
            for i in 0..100 {
                let u = Vec2::new((i as f32 + 0.5) / 100.0, (i * 37 % 100) as f32 / 100.0);
                let (after, density) = phase.sample(before, u);
                assert!((after.length() - 1.0).abs() < 1e-6 && density > 0.0, "g {g}");
                assert_eq!(density, phase.value(before, after));
                let cos = f64::from(before.dot(after));
                if g.abs() < 0.95 {
                    assert!((cos - f64::from(phase.cosine(u.x))).abs() < 1e-5, "g {g}: {cos}");
                }
            }
        }
    }
}
