//! Owns what fills space evenly: how it takes light on its way, where it scatters it, and whereto.
//!
//! Everything is solved, nothing is tracked: transmittance is exp(−σt), also on shadow rays.

mod phase;

pub use phase::Phase;

use glam::Vec3;

use crate::color::luminance;
use crate::math::ln;
use wide::f32x4;

/// A homogeneous medium, coefficients per unit of length by channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    sigma_t: Vec3,
    sigma_s: Vec3,
    phase: Phase,
}

/// What a path may do on its way through a length of a medium: how often each channel decides, and what of it gets through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chances {
    through: Vec3,
    shares: Vec3,
}

impl Chances {
    /// Transmittance of the whole length.
    pub fn through(&self) -> Vec3 {
        self.through
    }

    /// How often the path passes, and the factor of its throughput then.
    pub fn pass(&self) -> (Vec3, f32) {
        let often = self.shares.dot(self.through);
        if often > 0.0 { (self.through / often, often) } else { (Vec3::ZERO, 0.0) }
    }
}

/// What a path does on its way through a medium, and the factor of its throughput that belongs to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// It is scattered at this distance. The factor holds transmittance, scattering coefficient and density.
    Scatter(f32, Vec3),
    /// It reaches the end. The factor holds transmittance and probability.
    Pass(Vec3),
}

impl Medium {
    /// A medium that absorbs and scatters these shares of light per unit of length, all finite and not negative, and
    /// scatters with the mean cosine `g`.
    pub fn new(sigma_a: Vec3, sigma_s: Vec3, g: f32) -> Self {
        Self { sigma_t: sigma_a + sigma_s, sigma_s, phase: Phase::new(g) }
    }

    /// Share of light lost per unit of length.
    pub fn sigma_t(&self) -> Vec3 {
        self.sigma_t
    }

    /// Share of light scattered per unit of length.
    pub fn sigma_s(&self) -> Vec3 {
        self.sigma_s
    }

    /// Whereto light is scattered.
    pub fn phase(&self) -> &Phase {
        &self.phase
    }

    /// Whether it scatters anything.
    pub fn scatters(&self) -> bool {
        self.sigma_s != Vec3::ZERO
    }

    /// Share of light that gets through a distance, which may be infinite.
    pub fn transmittance(&self, distance: f32) -> Vec3 {
        through(self.sigma_t, distance)
    }

    /// Decides by `u` whether a path with this throughput is scattered within a length, and where.
    ///
    /// A channel is chosen and its distances are sampled exponentially; the other channels see the same distance, weighed by
    /// the balance heuristic over all channels (Veach 1997, section 9.2.2), without which channels of different density
    /// have weights without bound, and are wrong where one is 0.
    pub fn sample(&self, beta: Vec3, length: f32, u: [f32; 2]) -> Event {
        self.decide(&self.chances(beta, length), length, u)
    }

    /// What a path with this throughput may do within a length.
    pub fn chances(&self, beta: Vec3, length: f32) -> Chances {
        let through = self.transmittance(length);
        Chances { through, shares: self.shares(beta, through) }
    }

    /// The same as [`Medium::sample`], with the chances known.
    pub fn decide(&self, chances: &Chances, length: f32, [choice, u]: [f32; 2]) -> Event {
        let Chances { through, shares } = *chances;
        let channel = if choice < shares.x {
            0
        } else if choice < shares.x + shares.y {
            1
        } else {
            2
        };
        // Rounding may choose a channel of no weight; it has no distances either.
        let channel = if shares[channel] > 0.0 { channel } else { shares.max_position() };
        // 1 − u has no rounding: random numbers are multiples of 2⁻²⁴.
        let distance = -ln(1.0 - u) / self.sigma_t[channel];
        if distance < length {
            let here = self.transmittance(distance);
            let density = shares.dot(self.sigma_t * here);
            Event::Scatter(distance, self.sigma_s * here / density)
        } else {
            Event::Pass(through / shares.dot(through))
        }
    }

    /// How often [`Medium::sample`] scatters a path with this throughput within a length.
    pub fn scattered(&self, beta: Vec3, length: f32) -> f32 {
        let through = self.transmittance(length);
        self.shares(beta, through).dot(Vec3::ONE - through)
    }

    /// A place within a length where a path with this throughput is scattered, if it is: the distance, and its density per
    /// unit of length. `None` where it never is.
    pub fn place(&self, beta: Vec3, length: f32, [choice, u]: [f32; 2]) -> Option<(f32, f32)> {
        let through = self.transmittance(length);
        let shares = self.shares(beta, through) * (Vec3::ONE - through);
        let often = shares.element_sum();
        if often <= 0.0 || often.is_nan() {
            return None;
        }
        let rest = choice * often;
        let channel = if rest < shares.x { 0 } else { 1 + usize::from(rest >= shares.x + shares.y) };
        let channel = if shares[channel] > 0.0 { channel } else { shares.max_position() };
        let distance = -libm::log1pf(-u * (1.0 - through[channel])) / self.sigma_t[channel];
        let distance = distance.min(length);
        Some((distance, self.density(beta, length, distance) / often))
    }

    /// Density per unit of length with which [`Medium::sample`] scatters at a distance within a length.
    pub fn density(&self, beta: Vec3, length: f32, distance: f32) -> f32 {
        let shares = self.shares(beta, self.transmittance(length));
        shares.dot(self.sigma_t * self.transmittance(distance))
    }

    /// How often each channel is chosen: by what it may still bring, scattered or from the end.
    fn shares(&self, beta: Vec3, through: Vec3) -> Vec3 {
        let albedo = Vec3::select(self.sigma_t.cmpgt(Vec3::ZERO), self.sigma_s / self.sigma_t, Vec3::ZERO);
        let weight = beta * (albedo * (Vec3::ONE - through) + through);
        let sum = weight.element_sum();
        if sum > 0.0 && sum.is_finite() { weight / sum } else { Vec3::splat(1.0 / 3.0) }
    }

    /// The mean coefficients of light of some colour: of loss, and of scattering.
    pub fn mean(&self, color: Vec3) -> (f32, f32) {
        let weight = luminance(color);
        if weight > 0.0 {
            (luminance(color * self.sigma_t) / weight, luminance(color * self.sigma_s) / weight)
        } else {
            (self.sigma_t.element_sum() / 3.0, self.sigma_s.element_sum() / 3.0)
        }
    }
}

/// exp(−σt) of all channels at a time: 1 where there is nothing, however far.
fn through(sigma: Vec3, distance: f32) -> Vec3 {
    let [x, y, z] = (-sigma * distance).to_array();
    let [x, y, z, _] = f32x4::new([x, y, z, 0.0]).exp().to_array();
    Vec3::select(sigma.cmpgt(Vec3::ZERO), Vec3::new(x, y, z), Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::{Event, Medium};
    use glam::{DVec3, Vec3};

    /// Means over many decisions of what is scattered and what passes.
    fn means(medium: &Medium, beta: Vec3, length: f32) -> (DVec3, DVec3, f64) {
        let (mut scattered, mut passed, mut most) = (DVec3::ZERO, DVec3::ZERO, 0.0_f64);
        let count = 1_500_000_u32;
        for i in 0..count {
            // Powers of the golden ratio's relative in the plane fill a square evenly.
            let u =
                [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|a| (f64::from(i) * a).fract() as f32);
            match medium.sample(beta, length, u) {
                Event::Scatter(distance, weight) => {
                    assert!((0.0..length).contains(&distance));
                    scattered += weight.as_dvec3();
                    most = most.max(f64::from(weight.max_element()));
                }
                Event::Pass(weight) => {
                    passed += weight.as_dvec3();
                    most = most.max(f64::from(weight.max_element()));
                }
            }
        }
        let count = f64::from(count);
        (scattered / count, passed / count, most)
    }

    /// What is scattered in a channel and what passes.
    fn expected(medium: &Medium, length: f32, channel: usize) -> [f64; 2] {
        let (t, s) = (f64::from(medium.sigma_t()[channel]), f64::from(medium.sigma_s()[channel]));
        let through = libm::exp(-t * f64::from(length));
        [if t > 0.0 { s / t * (1.0 - through) } else { 0.0 }, through]
    }

    #[test]
    fn what_is_scattered_and_what_passes_is_exact_in_every_channel() {
        for (sigma_a, sigma_s, length) in [
            (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.5, 0.5, 0.5), 2.0),
            (Vec3::ZERO, Vec3::new(0.0, 1.0, 3.0), 1.5),
            (Vec3::new(0.0, 0.1, 1.0), Vec3::new(0.1, 0.9, 4.0), 3.0),
            (Vec3::ZERO, Vec3::splat(1e-9), 100.0),
            (Vec3::ZERO, Vec3::splat(1e4), 1.0),
            (Vec3::splat(2.0), Vec3::ZERO, 0.5),
        ] {
            let medium = Medium::new(sigma_a, sigma_s, 0.0);
            for beta in [Vec3::ONE, Vec3::new(1.0, 0.01, 0.2)] {
                let (scattered, passed, most) = means(&medium, beta, length);
                for channel in 0..3 {
                    let expected = expected(&medium, length, channel);
                    let found = [scattered[channel], passed[channel]];
                    let close = |i: usize| (found[i] - expected[i]).abs() <= 2e-3 * expected[i] + 2e-5;
                    assert!(close(0) && close(1), "{medium:?}: {found:?}, expected {expected:?}");
                }
                if beta == Vec3::ONE {
                    assert!(most < 6.0, "{medium:?}: weights up to {most}");
                }
            }
        }
    }

    #[test]
    fn limits_are_exact() {
        let nothing = Medium::new(Vec3::ZERO, Vec3::ZERO, 0.0);
        assert_eq!(nothing.transmittance(f32::INFINITY), Vec3::ONE);
        assert_eq!(nothing.sample(Vec3::ONE, f32::INFINITY, [0.9, 0.999_999_9]), Event::Pass(Vec3::ONE));
        let fog = Medium::new(Vec3::ZERO, Vec3::new(0.0, 1.0, 3.0), 0.3);
        assert_eq!(fog.transmittance(f32::INFINITY), Vec3::X);
        for choice in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0] {
            for u in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0] {
                let weight = match fog.sample(Vec3::ONE, f32::INFINITY, [choice, u]) {
                    Event::Scatter(_, weight) | Event::Pass(weight) => weight,
                };
                assert!(weight.is_finite() && weight.min_element() >= 0.0, "{choice}, {u}: {weight}");
            }
        }
        assert!(!nothing.scatters() && fog.scatters());
    }

    #[test]
    fn the_density_is_that_of_the_samples() {
        let medium = Medium::new(Vec3::splat(0.1), Vec3::new(0.2, 1.0, 3.0), 0.0);
        let (beta, length) = (Vec3::new(0.5, 1.0, 0.25), 1.25_f32);
        let steps = 100_000;
        let integral: f64 = (0..steps)
            .map(|i| f64::from(medium.density(beta, length, (i as f32 + 0.5) / steps as f32 * length)))
            .sum::<f64>()
            * f64::from(length)
            / f64::from(steps);
        let (mut scattered, mut total) = (0.0, 0.0);
        for i in 0..300 {
            for j in 0..3000 {
                let u = [(i as f32 + 0.5) / 300.0, (j as f32 + 0.5) / 3000.0];
                let is_scattered = matches!(medium.sample(beta, length, u), Event::Scatter(..));
                scattered += f64::from(u32::from(is_scattered));
                total += 1.0;
            }
        }
        assert!((integral - scattered / total).abs() < 2e-3, "{integral} {}", scattered / total);
    }
}
