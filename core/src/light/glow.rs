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
use wide::f64x4;

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
        let mut sum = 0.0;
        let mut four = [Part::NONE; 4];
        let mut known = 0;
        for (beacon, share) in self.lights() {
            if let Some(part) = Part::new(beacon, self.from, d) {
                four[known] = Part { scale: part.scale * f64::from(share), ..part };
                known += 1;
            }
            if known == four.len() {
                sum += densities(&four);
                (four, known) = ([Part::NONE; 4], 0);
            }
        }
        if known > 0 { (sum + densities(&four)) as f32 } else { sum as f32 }
    }
}

/// The part of a direction's ray that passes through the light of a lamp.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Where it comes nearest to the lamp, and the squared distance there.
    nearest: f64,
    apart2: f64,
    /// Where it begins and ends, from the nearest place on.
    near: f64,
    far: f64,
    /// Factor of the integral of t² / ((t − δ)² + D²).
    scale: f64,
}

impl Part {
    const NONE: Self = Self { nearest: 0.0, apart2: 1.0, near: 0.0, far: 1.0, scale: 0.0 };

    /// `None` where there is no such part.
    fn new(beacon: &Beacon, from: Vec3, d: Vec3) -> Option<Self> {
        let towards = (beacon.position - from).as_dvec3();
        let away2 = towards.length_squared();
        let nearest = towards.dot(d.as_dvec3());
        let apart2 = (towards - d.as_dvec3() * nearest).length_squared().max(1e-16 * away2);
        let half = f64::from(Glow::REACH * Glow::REACH) * away2 - apart2;
        if half <= 0.0 {
            return None;
        }
        let half = half.sqrt();
        let span = Span { o: from, d, near: (nearest - half).max(0.0) as f32, far: (nearest + half) as f32 };
        let span = Some(span).filter(|span| span.near < span.far).and_then(|span| beacon.clip(span))?;
        let [near, far] = [span.near, span.far].map(|t| f64::from(t) - nearest);
        let scale = 1.0 / (f64::from(Glow::REACH) * away2.sqrt() * beacon.solid_angle());
        Some(Self { nearest, apart2, near, far, scale })
    }
}

/// The densities of a direction towards four lights, added up.
///
/// The integral of t² / ((t − δ)² + D²) between two places: the angle between them at the lamp, and the ratio of their
/// distances from it.
#[inline]
fn densities(four: &[Part; 4]) -> f64 {
    let lanes = |of: fn(&Part) -> f64| f64x4::new(four.each_ref().map(of));
    let (nearest, apart2) = (lanes(|p| p.nearest), lanes(|p| p.apart2));
    let (near, far) = (lanes(|p| p.near), lanes(|p| p.far));
    let (apart, length) = (apart2.sqrt(), far - near);
    let angle = (length * apart).atan2(apart2 + near * far);
    let ratio = (far * far + apart2) / (near * near + apart2);
    let integral = length + nearest * ratio.ln() + (nearest * nearest - apart2) / apart * angle;
    let [a, b, c, d] = (integral.max(f64x4::splat(0.0)) * lanes(|p| p.scale)).to_array();
    a + b + c + d
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
