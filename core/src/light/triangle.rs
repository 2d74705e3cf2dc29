//! Owns light from the front side of a triangle, sampled by solid angle.

use super::emitter::Emitter;
use super::polygon::{Plate, Seen};
use super::{LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::{Aabb, even_error, gamma};
use crate::warp::triangle_uniform;
use glam::{Vec2, Vec3};

/// A triangle whose front side sends out the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleLight {
    corners: [Vec3; 3],
    plate: Plate,
    radiance: Vec3,
}

impl TriangleLight {
    /// A triangle whose corners run counter-clockwise seen from the front; `None` when it has no area.
    pub fn new(corners: [Vec3; 3], radiance: Vec3) -> Option<Self> {
        Some(Self { corners, plate: Plate::new(corners)?, radiance })
    }

    /// Radiance that the front side sends out, linear Rec.709.
    pub fn radiance(&self) -> Vec3 {
        self.radiance
    }

    /// Its centre of mass.
    pub(super) fn middle(&self) -> Vec3 {
        self.corners.iter().sum::<Vec3>() / 3.0
    }

    pub(super) fn emitter(&self) -> Emitter {
        let bounds = self.corners.iter().fold(Aabb::EMPTY, |b, p| b.with_point(*p));
        let intensity = f64::from(luminance(self.radiance)) * self.plate.area();
        Emitter::front(bounds, self.plate.normal(), intensity)
    }

    pub(super) fn sample(&self, from: &Receiver, u: Vec2) -> Option<LightSample> {
        let seen = Seen::new(&self.plate, self.corners, from.p)?;
        let (wi, at, pdf) = seen.sample(u, |u| triangle_uniform(u).truncate());
        let w = [(1.0 - at.x - at.y).max(0.0), at.x, at.y];
        let sum = w[0] + w[1] + w[2];
        let blend = |v: [Vec3; 3]| (v[0] * w[0] + v[1] * w[1] + v[2] * w[2]) / sum;
        let p = blend(self.corners);
        let error = even_error(blend(self.corners.map(Vec3::abs)) * gamma(8));
        let target = Target::Point(p, error, self.plate.normal().as_vec3());
        Some(LightSample { wi, radiance: self.radiance, pdf, delta: false, target })
    }

    /// Density of sampling its point `q` from `p`; 0 from behind.
    pub(super) fn pdf(&self, p: Vec3, q: Vec3) -> f32 {
        Seen::new(&self.plate, self.corners, p).map_or(0.0, |seen| seen.pdf(p, q))
    }
}
