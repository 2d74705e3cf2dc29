//! Owns directions towards the glow of lights in a medium.
//!
//! A medium around a light shines by what it scatters of it: a ball of light around a lamp, a beam before a spotlight. Paths
//! rarely meet these by chance and find them bright, which makes noise. Here places are taken in the light, even in distance
//! from the lamp and in solid angle at it, and looked at: a place y at the distance r from the lamp has the density
//! `1 / (R Ω r²)` within the radius R, and a direction the integral of that over all places along it,
//! `∫ t² / (R Ω r(t)²) dt`, which has a closed form.

use super::Lights;
use super::beacon::{Beacon, Span};
use glam::{Vec2, Vec3};

/// The lights whose glow a point sees, and how much of all they are.
#[derive(Debug, Clone)]
pub struct Glow<'a> {
    from: Vec3,
    /// Lights, and how often each is chosen.
    lights: [Option<(&'a Beacon, f32)>; MOST],
    count: usize,
}

/// Up to this many lights are known each.
const MOST: usize = 16;

impl Glow<'_> {
    /// How often a direction is taken towards the glow, where there is one.
    pub const SHARE: f32 = 0.3;

    /// Radius of the light that is looked at, in units of the distance from the lamp.
    const REACH: f32 = 1.25;

    fn lights(&self) -> impl Iterator<Item = (&Beacon, f32)> {
        self.lights[..self.count].iter().filter_map(|light| *light)
    }

    /// A direction, by `light` which light and how far from it, and by `u` on which side of it; `None` where that is no
    /// direction.
    pub fn sample(&self, light: f32, u: Vec2) -> Option<Vec3> {
        let mut rest = light;
        let mut chosen = None;
        for (beacon, share) in self.lights() {
            chosen = Some((beacon, (rest / share).clamp(0.0, 1.0)));
            if rest < share {
                break;
            }
            rest -= share;
        }
        let (beacon, part) = chosen?;
        let reach = Self::REACH * (beacon.position - self.from).length();
        let place = beacon.position + beacon.direction(u) * (reach * part);
        (place - self.from).try_normalize()
    }

    /// The density with which a direction is taken, towards the glow or else with some other density.
    pub fn mixed(&self, d: Vec3, other: f32) -> f32 {
        Self::SHARE * self.pdf(d) + (1.0 - Self::SHARE) * other
    }

    /// The density per solid angle with which [`Glow::sample`] takes a direction.
    pub fn pdf(&self, d: Vec3) -> f32 {
        self.lights().map(|(beacon, share)| share * density(beacon, self.from, d)).sum()
    }
}

/// The density of a direction towards one light.
fn density(beacon: &Beacon, from: Vec3, d: Vec3) -> f32 {
    let towards = (beacon.position - from).as_dvec3();
    let away = towards.length();
    let reach = f64::from(Glow::REACH) * away;
    let nearest = towards.dot(d.as_dvec3());
    let apart2 = (towards - d.as_dvec3() * nearest).length_squared().max(1e-16 * away * away);
    let half = reach * reach - apart2;
    if half <= 0.0 {
        return 0.0;
    }
    let half = half.sqrt();
    let span = Span { o: from, d, near: (nearest - half).max(0.0) as f32, far: (nearest + half) as f32 };
    let Some(span) = Some(span).filter(|span| span.near < span.far).and_then(|span| beacon.clip(span)) else {
        return 0.0;
    };
    let apart = apart2.sqrt();
    // The integral of t² / ((t − δ)² + D²) between two places: the angle between them at the lamp, and the ratio of their
    // distances from it.
    let [near, far] = [span.near, span.far].map(|t| f64::from(t) - nearest);
    let angle = libm::atan2((far - near) * apart, apart2 + near * far);
    let ratio = (far * far + apart2) / (near * near + apart2);
    let integral = (far - near) + nearest * libm::log(ratio) + (nearest * nearest - apart2) / apart * angle;
    let integral = integral.max(0.0);
    (integral / (reach * beacon.solid_angle())) as f32
}

impl Lights {
    /// The glow of the lights at a finite distance that `counts` takes, as a point sees it; `None` where there is none, or
    /// where there are too many lights to know each.
    pub fn glow(&self, from: Vec3, beta: Vec3, counts: impl Fn(usize) -> bool) -> Option<Glow<'_>> {
        if self.all.len() > MOST {
            return None;
        }
        let mut glow = Glow { from, lights: [None; MOST], count: 0 };
        let mut total = 0.0;
        for (light, beacon) in self.beacons.all() {
            // Light falls off with the square of the distance, the glow around it with the distance itself.
            let power = beacon.brightness(beta) * beacon.solid_angle() as f32;
            let weight = power / (beacon.position - from).length();
            if weight > 0.0 && weight.is_finite() && counts(light) {
                glow.lights[glow.count] = Some((beacon, weight));
                glow.count += 1;
                total += weight;
            }
        }
        for (_, share) in glow.lights.iter_mut().flatten() {
            *share /= total;
        }
        (glow.count > 0 && total.is_finite()).then_some(glow)
    }
}

#[cfg(test)]
mod tests {
    use crate::light::{Light, Lights, PointLight, SpotFalloff, SpotLight};
    use crate::math::Aabb;
    use glam::{DVec3, Vec2, Vec3};

    fn lamps() -> Lights {
        let lamp = |position, intensity| Light::Point(PointLight { position, intensity });
        let falloff = SpotFalloff::Linear { beam_width: 20.0, cutoff_angle: 35.0 };
        let beam =
            SpotLight::new(Vec3::new(0.0, 2.0, -1.0), DVec3::new(0.3, -1.0, 0.2), Vec3::splat(9.0), falloff);
        let all = vec![
            lamp(Vec3::new(1.0, 2.0, 3.0), Vec3::ONE),
            lamp(Vec3::new(-2.0, 0.0, 1.0), Vec3::splat(3.0)),
            Light::Spotlight(beam),
        ];
        Lights::new(all, &Aabb { min: Vec3::splat(-3.0), max: Vec3::splat(3.0) })
    }

    #[test]
    fn densities_are_those_of_the_samples() {
        let lamps = lamps();
        let glow = lamps.glow(Vec3::new(0.3, -0.2, 0.1), Vec3::ONE, |_| true).expect("all lamps glow");
        // A histogram of directions against the integral of the density over each bin: 8 bands of z, 16 sectors.
        let bin = |d: Vec3| {
            let band = ((d.z * 0.5 + 0.5) * 8.0).clamp(0.0, 7.0) as usize;
            let turn = libm::atan2(f64::from(d.y), f64::from(d.x)) / std::f64::consts::TAU + 0.5;
            band * 16 + ((turn * 16.0) as usize).min(15)
        };
        let (n, mut found) = (1_000_000_u32, [0.0; 128]);
        for i in 0..n {
            let golden = |factor: f64| (f64::from(i) * factor).fract() as f32;
            // Powers of the three-dimensional golden ratio fill a cube evenly.
            let d = glow
                .sample(golden(0.819_172_513_4), Vec2::new(golden(0.671_043_606_7), golden(0.549_700_477_9)));
            found[bin(d.expect("a direction"))] += 1.0 / f64::from(n);
        }
        let (bands, sectors, mut expected) = (2400, 4800, [0.0; 128]);
        for i in 0..bands {
            for j in 0..sectors {
                let z = (f64::from(i) + 0.5) / f64::from(bands) * 2.0 - 1.0;
                let turn = ((f64::from(j) + 0.5) / f64::from(sectors) - 0.5) * std::f64::consts::TAU;
                let flat = (1.0 - z * z).sqrt();
                let d = DVec3::new(flat * libm::cos(turn), flat * libm::sin(turn), z).as_vec3();
                let area = 4.0 * std::f64::consts::PI / f64::from(bands * sectors);
                expected[bin(d)] += f64::from(glow.pdf(d)) * area;
            }
        }
        let whole: f64 = expected.iter().sum();
        assert!((whole - 1.0).abs() < 5e-3, "{whole}");
        for (bin, (found, expected)) in found.into_iter().zip(expected).enumerate() {
            assert!((found - expected).abs() < 0.02 * expected + 2e-4, "bin {bin}: {found} {expected}");
        }
    }

    #[test]
    fn only_lights_that_count_glow() {
        let from = Vec3::ZERO;
        let lamps = lamps();
        assert!(lamps.glow(from, Vec3::ONE, |_| false).is_none());
        let one = lamps.glow(from, Vec3::ONE, |light| light == 1).expect("one lamp glows");
        let towards = Vec3::new(-2.0, 0.0, 1.0).normalize();
        let beside = (towards + Vec3::Y * 0.01).normalize();
        assert!(one.pdf(beside) > 50.0 * one.pdf(Vec3::Y));
    }
}
