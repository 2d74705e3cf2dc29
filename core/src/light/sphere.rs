//! Owns light from a sphere, sampled by the cone that it fills.

use super::emitter::Emitter;
use super::{LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::{Aabb, Frame, even_error, gamma};
use crate::warp::{cone_uniform, cone_uniform_pdf};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;

/// A sphere that sends out the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SphereLight {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
    /// Radiance, linear Rec.709.
    pub radiance: Vec3,
}

impl SphereLight {
    pub(super) fn emitter(&self) -> Emitter {
        let radius = f64::from(self.radius);
        let bounds = Aabb { min: self.center - self.radius, max: self.center + self.radius };
        Emitter::everywhere(bounds, f64::from(luminance(self.radiance)) * PI * radius * radius)
    }

    /// The vector to the centre, and 1 − cos of the half angle under which the sphere is seen; `None` from inside.
    fn cone(&self, p: Vec3) -> Option<(DVec3, f32)> {
        let towards = self.center.as_dvec3() - p.as_dvec3();
        let radius = f64::from(self.radius);
        let sin2 = radius * radius / towards.length_squared();
        let one_minus_cos = (sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())) as f32;
        (sin2 < 1.0 && one_minus_cos > 0.0).then_some((towards, one_minus_cos))
    }

    pub(super) fn sample(&self, from: &Receiver, u: Vec2) -> Option<LightSample> {
        let (towards, one_minus_cos) = self.cone(from.p)?;
        let axis = towards.normalize().as_vec3();
        let wi = Frame::new(axis).to_world(cone_uniform(u, one_minus_cos)).normalize();
        // The nearer point along wi; a ray that just misses by rounding ends at the rim.
        let (d, radius) = (wi.as_dvec3(), f64::from(self.radius));
        let along = towards.dot(d);
        let miss = d * along - towards;
        let n = (miss - d * (radius * radius - miss.length_squared()).max(0.0).sqrt()).normalize();
        let p = (self.center.as_dvec3() + n * radius).as_vec3();
        let n = n.as_vec3();
        let error = even_error((n.abs() * self.radius + self.center.abs()) * gamma(5));
        let pdf = cone_uniform_pdf(one_minus_cos);
        let target = Target::Point(p, error, n);
        Some(LightSample { wi, radiance: self.radiance, pdf, delta: false, target })
    }

    /// Density of sampling any direction that meets the sphere from `p`; 0 where it is not sampled.
    pub(super) fn pdf(&self, p: Vec3) -> f32 {
        self.cone(p).map_or(0.0, |(_, one_minus_cos)| cone_uniform_pdf(one_minus_cos))
    }
}
