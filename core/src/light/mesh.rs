//! Owns light from the front sides of a placed mesh, sampled by area.

use super::{Emitter, LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::{Aabb, even_error, gamma};
use crate::warp::triangle_uniform;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Triangles in the world that send out the same radiance from their front sides.
#[derive(Debug, Clone)]
pub struct MeshLight {
    triangles: Vec<[Vec3; 3]>,
    /// Cumulative share of the area.
    cumulative: Vec<f32>,
    area: f32,
    radiance: Vec3,
    bounds: Aabb,
}

impl MeshLight {
    /// Triangles whose corners run counter-clockwise seen from the front; `None` when they have no area.
    pub fn new(triangles: Vec<[Vec3; 3]>, radiance: Vec3) -> Option<Self> {
        let mut sum = 0.0_f64;
        let mut sums = Vec::with_capacity(triangles.len());
        for t in &triangles {
            sum += f64::from((t[1] - t[0]).cross(t[2] - t[0]).length()) * 0.5;
            sums.push(sum);
        }
        let bounds = triangles.iter().flatten().fold(Aabb::EMPTY, |b, p| b.with_point(*p));
        let cumulative = sums.iter().map(|s| (s / sum) as f32).collect();
        (sum > 0.0).then_some(Self { triangles, cumulative, area: sum as f32, radiance, bounds })
    }

    /// Radiance that the front sides send out.
    pub fn radiance(&self) -> Vec3 {
        self.radiance
    }

    pub(super) fn emitter(&self) -> Emitter {
        let power = luminance(self.radiance) * PI * self.area;
        Emitter { center: self.bounds.center(), radius: self.bounds.size().length() * 0.5, power }
    }

    pub(super) fn sample(&self, from: &Receiver, part: f32, u: Vec2) -> Option<LightSample> {
        let index = self.cumulative.partition_point(|&c| c <= part).min(self.triangles.len() - 1);
        let [a, b, c] = self.triangles[index];
        let w = triangle_uniform(u);
        let p = a * w.x + b * w.y + c * w.z;
        let error = even_error((a.abs() * w.x + b.abs() * w.y + c.abs() * w.z) * gamma(6));
        let n = (b - a).cross(c - a).normalize_or_zero();
        let towards = p - from.p;
        let wi = towards.normalize_or_zero();
        let pdf = self.pdf(towards.length_squared(), -wi.dot(n));
        (pdf > 0.0 && pdf.is_finite()).then_some(LightSample {
            wi,
            radiance: self.radiance,
            pdf,
            target: Target::Point(p, error, n),
        })
    }

    /// Density of sampling a point at a squared distance whose normal has this cosine to the receiver; 0 behind.
    pub fn pdf(&self, distance_squared: f32, cos: f32) -> f32 {
        if cos > 0.0 { distance_squared / (cos * self.area) } else { 0.0 }
    }
}
