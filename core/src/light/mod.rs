//! Owns where light comes from, and the choice among lights.
//!
//! A light is sampled from a surface point; densities are per solid angle at that point. The same density is computed
//! again when a path finds the light by itself, so that both strategies can be weighed (MIS).

mod environment;
mod mesh;
mod sphere;

pub use environment::EnvironmentLight;
pub use mesh::MeshLight;
pub use sphere::SphereLight;

use crate::math::Aabb;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Something that sends out light.
#[derive(Debug, Clone)]
pub enum Light {
    /// The front sides of a mesh.
    Mesh(MeshLight),
    /// The outside of a sphere.
    Sphere(SphereLight),
    /// All directions, infinitely far away.
    Environment(EnvironmentLight),
}

/// A point of a light as seen from a surface point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// Unit direction to the light.
    pub wi: Vec3,
    /// What the light sends back along it.
    pub radiance: Vec3,
    /// Density per solid angle, without the choice of the light.
    pub pdf: f32,
    /// The end of the shadow ray.
    pub target: Target,
}

/// Where a shadow ray ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// At a point of a surface: its position, the bound of its error, its geometric normal.
    Point(Vec3, Vec3, Vec3),
    /// Nowhere.
    Infinity,
}

/// The point from which lights are seen: position and shading normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Position.
    pub p: Vec3,
    /// Unit normal on the side that receives.
    pub n: Vec3,
}

impl Light {
    /// Samples the light; `part` chooses among its parts, `u` a point of it. `None` when it sends nothing this way.
    pub fn sample(&self, from: &Receiver, part: f32, u: Vec2) -> Option<LightSample> {
        match self {
            Self::Mesh(l) => l.sample(from, part, u),
            Self::Sphere(l) => l.sample(from, u),
            Self::Environment(l) => Some(l.sample(u)),
        }
    }

    /// How much light it might bring to a receiver, unoccluded: the weight of its choice. Never 0 where it can
    /// contribute.
    fn importance(&self, from: &Receiver) -> f32 {
        match self {
            Self::Mesh(l) => l.emitter().importance(from),
            Self::Sphere(l) => l.emitter().importance(from),
            Self::Environment(l) => l.importance(),
        }
    }

    /// Its weight where there is no receiver to ask: its flux.
    fn power(&self, scene: &Aabb) -> f32 {
        match self {
            Self::Mesh(l) => l.emitter().power,
            Self::Sphere(l) => l.emitter().power,
            Self::Environment(l) => l.power(scene),
        }
    }
}

/// The ball around an emitter and its flux.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Emitter {
    center: Vec3,
    radius: f32,
    power: f32,
}

impl Emitter {
    /// Roughly the irradiance that it brings: half its flux over the hemisphere, the squared distance, and the cosine
    /// of the best direction into the ball.
    fn importance(&self, from: &Receiver) -> f32 {
        let intensity = self.power * (0.5 * FRAC_1_PI);
        let towards = self.center - from.p;
        let d2 = towards.length_squared();
        let r2 = self.radius * self.radius;
        if d2 <= r2 {
            return intensity / r2;
        }
        // cos(max(0, θ − θ_ball)): the ball may reach above the horizon though its centre does not.
        let cos = towards.dot(from.n) / d2.sqrt();
        let (sin_ball, cos_ball) = ((r2 / d2).sqrt(), (1.0 - r2 / d2).sqrt());
        let best =
            if cos > cos_ball { 1.0 } else { cos * cos_ball + (1.0 - cos * cos).max(0.0).sqrt() * sin_ball };
        intensity * best.max(0.0) / d2.max(r2)
    }
}

/// All lights of a scene and the choice among them.
#[derive(Debug, Clone, Default)]
pub struct Lights {
    lights: Vec<Light>,
    /// Cumulative flux, used where weighing every light would cost more than it brings.
    cumulative: Vec<f32>,
}

impl Lights {
    /// Up to this many lights are all weighed at every receiver.
    const WEIGH_ALL: usize = 64;

    /// The lights of a scene with these bounds.
    pub fn new(lights: Vec<Light>, scene: &Aabb) -> Self {
        let mut sum = 0.0;
        let mut cumulative: Vec<f32> = Vec::with_capacity(lights.len());
        for light in &lights {
            sum += light.power(scene);
            cumulative.push(sum);
        }
        for c in &mut cumulative {
            *c /= sum;
        }
        Self { lights, cumulative }
    }

    /// Whether it is dark.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// The lights, by number.
    pub fn all(&self) -> &[Light] {
        &self.lights
    }

    /// Chooses a light for a receiver: its number and the probability of the choice.
    pub fn choose(&self, from: &Receiver, u: f32) -> Option<(usize, f32)> {
        if self.lights.len() > Self::WEIGH_ALL {
            let index = self.cumulative.partition_point(|&c| c <= u).min(self.lights.len() - 1);
            return Some((index, self.step(index))).filter(|(_, p)| *p > 0.0);
        }
        let total: f32 = self.lights.iter().map(|l| l.importance(from)).sum();
        if total <= 0.0 {
            return None;
        }
        let mut rest = u * total;
        let mut chosen = None;
        for (index, light) in self.lights.iter().enumerate() {
            let weight = light.importance(from);
            if weight > 0.0 {
                chosen = Some((index, weight / total));
                if rest < weight {
                    break;
                }
            }
            rest -= weight;
        }
        chosen
    }

    /// Probability with which [`Lights::choose`] takes a light.
    pub fn choice_pdf(&self, from: &Receiver, index: usize) -> f32 {
        if self.lights.len() > Self::WEIGH_ALL {
            return self.step(index);
        }
        let total: f32 = self.lights.iter().map(|l| l.importance(from)).sum();
        if total > 0.0 { self.lights[index].importance(from) / total } else { 0.0 }
    }

    fn step(&self, index: usize) -> f32 {
        self.cumulative[index] - if index == 0 { 0.0 } else { self.cumulative[index - 1] }
    }
}
