//! Owns light from the front side of a rectangle, sampled by solid angle.

use super::emitter::Emitter;
use super::polygon::Seen;
use super::{LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::{Aabb, even_error, gamma};
use glam::{DVec3, Vec2, Vec3};

/// A rectangle (or parallelogram) whose front side sends out the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RectangleLight {
    corner: Vec3,
    edges: [Vec3; 2],
    radiance: Vec3,
}

impl RectangleLight {
    /// A rectangle by a corner and the edges that leave it; seen from the front, the second edge is to the left of the
    /// first. `None` when it has no area.
    pub fn new(corner: Vec3, edges: [Vec3; 2], radiance: Vec3) -> Option<Self> {
        let cross = cross(edges);
        let usable = cross.try_normalize().is_some() && cross.length() as f32 > 0.0;
        usable.then_some(Self { corner, edges, radiance })
    }

    /// Radiance that the front side sends out, linear Rec.709.
    pub fn radiance(&self) -> Vec3 {
        self.radiance
    }

    /// Counter-clockwise seen from the front.
    fn corners(&self) -> [Vec3; 4] {
        let [a, b] = self.edges;
        [self.corner, self.corner + a, self.corner + a + b, self.corner + b]
    }

    pub(super) fn emitter(&self) -> Emitter {
        let cross = cross(self.edges);
        let bounds = self.corners().iter().fold(Aabb::EMPTY, |b, p| b.with_point(*p));
        Emitter::front(bounds, cross.normalize(), f64::from(luminance(self.radiance)) * cross.length())
    }

    pub(super) fn sample(&self, from: &Receiver, u: Vec2) -> Option<LightSample> {
        let seen = Seen::new(self.corners(), from.p)?;
        let (wi, at, pdf) = seen.sample(u, |u| u);
        let [a, b] = self.edges;
        let p = self.corner + a * at.x + b * at.y;
        let error = even_error((self.corner.abs() + a.abs() + b.abs()) * gamma(6));
        let target = Target::Point(p, error, cross(self.edges).normalize().as_vec3());
        Some(LightSample { wi, radiance: self.radiance, pdf, delta: false, target })
    }

    /// Density of sampling its point `q` from `p`; 0 from behind.
    pub(super) fn pdf(&self, p: Vec3, q: Vec3) -> f32 {
        Seen::new(self.corners(), p).map_or(0.0, |seen| seen.pdf(p, q))
    }
}

/// The front normal, as long as the area.
fn cross([a, b]: [Vec3; 2]) -> DVec3 {
    a.as_dvec3().cross(b.as_dvec3())
}
