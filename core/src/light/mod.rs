//! Owns where light comes from, and the choice among lights.
//!
//! A light is sampled from a surface point; densities are per solid angle at that point. The same density is computed
//! again when a path finds the light by itself, so that both strategies can be weighed (MIS): whatever decides how a
//! light is sampled depends on the light and the position of the receiver only.

mod along;
mod beacon;
mod choice;
mod emitter;
mod environment;
mod glow;
mod map;
mod mesh;
mod point;
mod polygon;
mod rectangle;
mod sides;
mod sphere;
mod spotlight;
mod sun;
mod tree;
mod triangle;

#[cfg(test)]
mod tests;

pub use along::{Along, Numbers};
pub use beacon::Span;
pub use choice::Lights;
pub use environment::EnvironmentLight;
pub use glow::Glow;
pub use mesh::mesh_lights;
pub use point::PointLight;
pub use rectangle::RectangleLight;
pub use sides::Side;
pub use sphere::SphereLight;
pub use spotlight::{SpotFalloff, SpotLight};
pub use sun::SunLight;
pub use triangle::TriangleLight;

use crate::math::Aabb;
use emitter::Emitter;
use glam::{Vec2, Vec3};

/// Something that sends out light.
#[derive(Debug, Clone)]
pub enum Light {
    /// The front side of a triangle.
    Triangle(TriangleLight),
    /// The front side of a rectangle.
    Rectangle(RectangleLight),
    /// The outside of a sphere.
    Sphere(SphereLight),
    /// The front side of a surface that scattered rays find and that is never sampled: the inside of a sphere, and what
    /// is there in part only. Its radiance, linear Rec.709.
    Unsampled(Vec3),
    /// A point that shines evenly.
    Point(PointLight),
    /// A point that shines in a direction.
    Spotlight(SpotLight),
    /// A disk, infinitely far away.
    Sun(SunLight),
    /// All directions, infinitely far away.
    Environment(EnvironmentLight),
}

/// A point of a light as seen from a surface point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// Unit direction to the light.
    pub wi: Vec3,
    /// What the light sends back along it; of a `delta` light the irradiance of a surface that faces it.
    pub radiance: Vec3,
    /// Density per solid angle, without the choice of the light; 1 of a `delta` light.
    pub pdf: f32,
    /// Whether no scattered ray ever finds the light: a point, or a sun without size.
    pub delta: bool,
    /// The end of the shadow ray.
    pub target: Target,
}

/// Where a shadow ray ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// At a point: its position, the bound of its error, its geometric normal (of a point light, towards the receiver).
    Point(Vec3, Vec3, Vec3),
    /// Nowhere.
    Infinity,
}

/// The point from which lights are seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Position.
    pub p: Vec3,
    /// Unit normal on the side that receives; 0 where all sides do.
    pub n: Vec3,
}

impl Light {
    /// Samples a point of the light with `u`; `None` when it sends nothing this way.
    pub fn sample(&self, from: &Receiver, u: Vec2) -> Option<LightSample> {
        match self {
            Self::Triangle(l) => l.sample(from, u),
            Self::Rectangle(l) => l.sample(from, u),
            Self::Sphere(l) => l.sample(from, u),
            Self::Unsampled(_) => None,
            Self::Point(l) => l.sample(from),
            Self::Spotlight(l) => l.sample(from),
            Self::Sun(l) => Some(l.sample(u)),
            Self::Environment(l) => l.sample(u),
        }
    }

    /// Whether it is infinitely far away.
    pub(crate) fn is_infinite(&self) -> bool {
        matches!(self, Self::Sun(_) | Self::Environment(_))
    }

    /// A box around it; `None` at infinity.
    pub(crate) fn bounds(&self) -> Option<Aabb> {
        self.emitter().filter(|_| !matches!(self, Self::Unsampled(_))).map(|emitter| emitter.bounds)
    }

    /// Where it is and how it shines, roughly; `None` at infinity.
    fn emitter(&self) -> Option<Emitter> {
        match self {
            Self::Triangle(l) => Some(l.emitter()),
            Self::Rectangle(l) => Some(l.emitter()),
            Self::Sphere(l) => Some(l.emitter()),
            Self::Unsampled(_) => Some(Emitter::NOTHING),
            Self::Point(l) => Some(l.emitter()),
            Self::Spotlight(l) => Some(l.emitter()),
            Self::Sun(_) | Self::Environment(_) => None,
        }
    }
}
