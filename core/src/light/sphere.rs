//! Owns light from a sphere, sampled by the cone that it fills.

use super::{Emitter, LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::{Frame, even_error, gamma};
use crate::warp::{cone_uniform, cone_uniform_pdf};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// A sphere that sends out the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLight {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
    /// Radiance, linear Rec.709.
    pub radiance: Vec3,
    /// Sends its light inwards: such a sphere is found by scattered rays only.
    pub inward: bool,
}

impl SphereLight {
    pub(super) fn emitter(&self) -> Emitter {
        let outward = if self.inward { 0.0 } else { luminance(self.radiance) };
        let power = outward * PI * 4.0 * PI * self.radius * self.radius;
        Emitter { center: self.center, radius: self.radius, power }
    }

    /// 1 − cos of the half angle under which the sphere is seen; `None` from inside, or when it shines inwards.
    fn cone(&self, p: Vec3) -> Option<f32> {
        let sin2 = f64::from(self.radius).powi(2) / (self.center - p).as_dvec3().length_squared();
        (sin2 < 1.0 && !self.inward).then(|| (sin2 / (1.0 + (1.0 - sin2).sqrt())) as f32)
    }

    pub(super) fn sample(&self, from: &Receiver, u: Vec2) -> Option<LightSample> {
        let one_minus_cos = self.cone(from.p)?;
        let towards = self.center - from.p;
        let wi = Frame::new(towards.normalize()).to_world(cone_uniform(u, one_minus_cos)).normalize();
        // The nearer point along wi; a ray that just misses by rounding ends at the rim.
        let along = towards.dot(wi);
        let miss2 = (towards - wi * along).length_squared();
        let n =
            (wi * -(self.radius * self.radius - miss2).max(0.0).sqrt() + (wi * along - towards)).normalize();
        let p = self.center + n * self.radius;
        let error = even_error((n.abs() * self.radius + self.center.abs()) * gamma(5));
        let pdf = cone_uniform_pdf(one_minus_cos);
        Some(LightSample { wi, radiance: self.radiance, pdf, target: Target::Point(p, error, n) })
    }

    /// Density of sampling any direction that meets the sphere from `p`.
    pub fn pdf(&self, p: Vec3) -> f32 {
        self.cone(p).map_or(0.0, cone_uniform_pdf)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Decision, Replicate, Sampler, Stream};

    /// Irradiance of a sphere above a plane is (R/d)² · cos θ · π · L.
    #[test]
    fn irradiance_equals_the_form_factor() {
        for (center, radius) in [(Vec3::new(0.3, 0.4, 2.0), 0.5), (Vec3::new(30.0, 0.0, 40.0), 0.01)] {
            let light = SphereLight { center, radius, radiance: Vec3::ONE, inward: false };
            let from = Receiver { p: Vec3::ZERO, n: Vec3::Z };
            let n = 4096;
            let sum: f64 = (0..n)
                .map(|i| {
                    Sampler::new(Stream::new(0, 0), [0, 0], Replicate::A, i).get_2d(Decision::LightPoint(0))
                })
                .filter_map(|u| light.sample(&from, u))
                .map(|s| f64::from(s.wi.z.max(0.0) / s.pdf))
                .sum();
            let want = f64::from(radius / center.length()).powi(2)
                * f64::from(center.normalize().z)
                * std::f64::consts::PI;
            assert!((sum / f64::from(n) / want - 1.0).abs() < 1e-3, "{} {want}", sum / f64::from(n));
        }
    }
}
