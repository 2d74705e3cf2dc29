//! Owns the rough picture of a finite light as a segment of a ray sees it: which part of the segment it shines on, and how
//! brightly along that.

use super::Light;
use super::spotlight::SpotLight;
use crate::color::luminance;
use crate::math::Frame;
use crate::warp::cone_uniform;
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;
use wide::f32x8;

/// A part of a ray: from `near` to `far` along the unit direction `d`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Origin of the ray.
    pub o: Vec3,
    /// Unit direction.
    pub d: Vec3,
    /// Where it begins.
    pub near: f32,
    /// Where it ends; may be infinite.
    pub far: f32,
}

impl Span {
    /// The part of it between two distances; `None` where that is nothing.
    fn clipped(self, near: f64, far: f64) -> Option<Self> {
        let (near, far) = (self.near.max(near as f32), self.far.min(far as f32));
        (near < far).then_some(Self { near, far, ..self })
    }
}

/// A light as a ball that shines; exact for points.
#[derive(Debug, Clone)]
pub(super) struct Beacon {
    pub(super) position: Vec3,
    /// Of the ball around it; 0 of a point.
    pub(super) radius: f32,
    /// Power per solid angle where it is greatest, linear Rec.709.
    pub(super) intensity: Vec3,
    shape: Shape,
}

/// Where a beacon shines.
#[derive(Debug, Clone)]
enum Shape {
    /// Evenly in all directions.
    Everywhere,
    /// Before a plane, with the cosine to its normal.
    Front(Vec3),
    /// In a cone.
    Cone(SpotLight),
}

impl Beacon {
    /// That of a light at a finite distance; `None` of others, and of those that are never sampled.
    pub(super) fn of(light: &Light) -> Option<Self> {
        let emitter = light.emitter()?;
        let (middle, radius) = (emitter.bounds.center(), 0.5 * emitter.bounds.size().length());
        let normal = emitter.axis.as_vec3();
        let (position, radius, color, shape) = match light {
            Light::Point(l) => (l.position, 0.0, l.intensity, Shape::Everywhere),
            Light::Spotlight(l) => (l.position(), 0.0, l.intensity(), Shape::Cone(*l)),
            Light::Sphere(l) => (l.center, l.radius, l.radiance, Shape::Everywhere),
            Light::Triangle(l) => (l.middle(), radius, l.radiance(), Shape::Front(normal)),
            Light::Rectangle(l) => (middle, radius, l.radiance(), Shape::Front(normal)),
            Light::Unsampled(_) | Light::Sun(_) | Light::Environment(_) => return None,
        };
        let bright = luminance(color);
        let intensity = if bright > 0.0 { color * (emitter.intensity as f32 / bright) } else { Vec3::ZERO };
        Some(Self { position, radius, intensity, shape })
    }

    /// The part of a segment on which the light may shine.
    pub(super) fn clip(&self, span: Span) -> Option<Span> {
        match &self.shape {
            Shape::Everywhere => Some(span),
            Shape::Front(normal) => {
                // Points behind the plane see nothing of it.
                let (o, d) = ((span.o - self.position).dot(*normal), span.d.dot(*normal));
                let crossing = -f64::from(o) / f64::from(d);
                match (d > 0.0, d < 0.0) {
                    (true, _) => span.clipped(crossing, f64::INFINITY),
                    (_, true) => span.clipped(f64::NEG_INFINITY, crossing),
                    _ => Some(span).filter(|_| o > 0.0),
                }
            }
            Shape::Cone(light) => {
                let co = span.o.as_dvec3() - light.position().as_dvec3();
                let (near, far) = cone(co, span.d.as_dvec3(), light.axis(), light.cos_edge())?;
                span.clipped(near, far)
            }
        }
    }

    /// Luminance of a light of some colour that it sends from its position along the unit directions with these
    /// coordinates, over that of its intensity.
    #[inline]
    pub(super) fn share(&self, away: [f32x8; 3]) -> f32x8 {
        let dot =
            |v: Vec3| away[0] * f32x8::splat(v.x) + away[1] * f32x8::splat(v.y) + away[2] * f32x8::splat(v.z);
        match &self.shape {
            Shape::Everywhere => f32x8::splat(1.0),
            // Its edges shine a little farther to the side than its middle.
            Shape::Front(normal) => dot(*normal).max(f32x8::splat(0.05)),
            Shape::Cone(light) => light.shares(dot(light.axis().as_vec3())),
        }
    }

    /// The solid angle that it shines into.
    pub(super) fn solid_angle(&self) -> f64 {
        match &self.shape {
            Shape::Everywhere => 4.0 * PI,
            Shape::Front(_) => 2.0 * PI,
            Shape::Cone(light) => 2.0 * PI * (1.0 - edge(light)),
        }
    }

    /// A direction in which it shines, even in solid angle.
    pub(super) fn direction(&self, u: Vec2) -> Vec3 {
        let (axis, cos_edge) = match &self.shape {
            Shape::Everywhere => (Vec3::Z, -1.0),
            Shape::Front(normal) => (*normal, 0.0),
            Shape::Cone(light) => (light.axis().as_vec3(), edge(light)),
        };
        Frame::new(axis).to_world(cone_uniform(u, (1.0 - cos_edge) as f32))
    }

    /// Luminance of its intensity in the eyes of a path with this throughput.
    pub(super) fn brightness(&self, beta: Vec3) -> f32 {
        luminance(self.intensity * beta)
    }
}

/// Cosine of the edge of the part of a spotlight that [`cone`] clips to.
fn edge(light: &SpotLight) -> f64 {
    if light.cos_edge() <= WIDEST { -1.0 } else { light.cos_edge() }
}

/// Cosine of the widest cone that lines are clipped to.
const WIDEST: f64 = 1e-3;

/// The part of a line, seen from the apex at `co`, that is inside of a cone around a unit axis.
///
/// Widened by a few roundings: the light itself is 0 beyond its edge.
fn cone(co: DVec3, d: DVec3, axis: DVec3, cos_edge: f64) -> Option<(f64, f64)> {
    const EVERYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
    // From a right angle on the cone has no inside that a line has one part in.
    if cos_edge <= WIDEST {
        return Some(EVERYWHERE);
    }
    let c = cos_edge * (1.0 - 1e-9) - 1e-12;
    let (along, height, c2) = (d.dot(axis), co.dot(axis), c * c);
    let a = along * along - c2 * d.length_squared();
    let b = along * height - c2 * d.dot(co);
    let rest = height * height - c2 * co.length_squared();
    let inside = b * b - a * rest;
    if a < 0.0 && inside <= 0.0 {
        return None;
    }
    let root = inside.max(0.0).sqrt();
    // The stable pair of roots of a t² + 2 b t + rest.
    let q = -(b + root.copysign(b));
    let (first, second) = (q / a, if q == 0.0 { 0.0 } else { rest / q });
    let (low, high) = if first <= second { (first, second) } else { (second, first) };
    let forward = |t: f64| height + t * along;
    if a < 0.0 {
        // The line is steeper than the cone: it is inside between the roots, of this cone or of its mirror image.
        return (forward(0.5 * (low + high)) > 0.0).then_some((low, high));
    }
    if !(a > 0.0 && low.is_finite() && high.is_finite()) {
        // Along the surface of the cone: one root at most.
        let at = -rest / (2.0 * b);
        let clip = if along > 0.0 { (at, f64::INFINITY) } else { (f64::NEG_INFINITY, at) };
        return Some(if at.is_finite() { clip } else { EVERYWHERE });
    }
    Some(if along > 0.0 { (high, f64::INFINITY) } else { (f64::NEG_INFINITY, low) })
}
