//! Owns light from a point that shines evenly in all directions.

use super::emitter::Emitter;
use super::{LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::Aabb;
use glam::Vec3;

/// A point with the same radiant intensity in all directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointLight {
    /// Position.
    pub position: Vec3,
    /// Power per solid angle, linear Rec.709.
    pub intensity: Vec3,
}

impl PointLight {
    pub(super) fn sample(&self, from: &Receiver) -> Option<LightSample> {
        delta_sample(self.position, from.p, |_| self.intensity)
    }

    pub(super) fn emitter(&self) -> Emitter {
        let place = Aabb { min: self.position, max: self.position };
        Emitter::everywhere(place, f64::from(luminance(self.intensity)))
    }
}

/// What a point brings whose intensity depends on the direction from it; `None` where that is nothing, and at the
/// point itself.
pub(super) fn delta_sample(
    position: Vec3,
    from: Vec3,
    intensity: impl FnOnce(glam::DVec3) -> Vec3,
) -> Option<LightSample> {
    let towards = position.as_dvec3() - from.as_dvec3();
    let d2 = towards.length_squared();
    let wi = towards / d2.sqrt();
    let radiance = intensity(-wi) / d2 as f32;
    let lit = d2 > 0.0 && radiance.is_finite() && radiance.max_element() > 0.0;
    let wi = wi.as_vec3();
    let target = Target::Point(position, Vec3::ZERO, -wi);
    lit.then_some(LightSample { wi, radiance, pdf: 1.0, delta: true, target })
}
