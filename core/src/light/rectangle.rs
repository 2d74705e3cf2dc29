//! Owns light from the front side of a rectangle, sampled by solid angle.

use super::emitter::Emitter;
use super::polygon::{Plate, Seen};
use super::{LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::{Aabb, even_error, gamma};
use glam::{Vec2, Vec3};

/// A rectangle (or parallelogram) whose front side sends out the same radiance everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RectangleLight {
    corner: Vec3,
    edges: [Vec3; 2],
    plate: Plate,
    radiance: Vec3,
}

impl RectangleLight {
    /// A rectangle by a corner and the edges that leave it; seen from the front, the second edge is to the left of the
    /// first. `None` when it has no area.
    pub fn new(corner: Vec3, edges: [Vec3; 2], radiance: Vec3) -> Option<Self> {
        let plate = Plate::new(corners(corner, edges))?;
        Some(Self { corner, edges, plate, radiance })
    }

    /// Radiance that the front side sends out, linear Rec.709.
    pub fn radiance(&self) -> Vec3 {
        self.radiance
    }

    fn corners(&self) -> [Vec3; 4] {
        corners(self.corner, self.edges)
    }

    pub(super) fn emitter(&self) -> Emitter {
        let bounds = self.corners().iter().fold(Aabb::EMPTY, |b, p| b.with_point(*p));
        let intensity = f64::from(luminance(self.radiance)) * self.plate.area();
        Emitter::front(bounds, self.plate.normal(), intensity)
    }

    pub(super) fn sample(&self, from: &Receiver, u: Vec2) -> Option<LightSample> {
        let seen = Seen::new(&self.plate, self.corners(), from.p)?;
        let (wi, at, pdf) = seen.sample(u, |u| u);
        let [a, b] = self.edges;
        let p = self.corner + a * at.x + b * at.y;
        let error = even_error((self.corner.abs() + a.abs() + b.abs()) * gamma(6));
        let target = Target::Point(p, error, self.plate.normal().as_vec3());
        Some(LightSample { wi, radiance: self.radiance, pdf, delta: false, target })
    }

    /// Density of sampling its point `q` from `p`; 0 from behind.
    pub(super) fn pdf(&self, p: Vec3, q: Vec3) -> f32 {
        Seen::new(&self.plate, self.corners(), p).map_or(0.0, |seen| seen.pdf(p, q))
    }
}

/// Counter-clockwise seen from the front.
fn corners(corner: Vec3, [a, b]: [Vec3; 2]) -> [Vec3; 4] {
    [corner, corner + a, corner + a + b, corner + b]
}
