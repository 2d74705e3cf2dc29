//! Owns orbit traps: how close the orbit of a point of a fractal comes to something simple.

use glam::Vec3;

use super::object::Sdf;
use super::real::Point;
use super::tape::Op;

/// What the points of an orbit may come close to, in the fractal's own space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trap {
    /// The middle.
    Origin,
    /// The nearest axis.
    Axes,
    /// The nearest plane on which a coordinate is 0.
    Planes,
}

/// The least distances of the points of an orbit from the traps, in the fractal's own units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traps {
    /// From the middle.
    pub origin: f32,
    /// From the nearest axis.
    pub axes: f32,
    /// From the nearest plane on which a coordinate is 0.
    pub planes: f32,
}

impl Traps {
    /// Those of an orbit without points.
    pub const NONE: Self = Self { origin: f32::INFINITY, axes: f32::INFINITY, planes: f32::INFINITY };

    /// The least distance from one of them.
    pub fn of(&self, trap: Trap) -> f32 {
        match trap {
            Trap::Origin => self.origin,
            Trap::Axes => self.axes,
            Trap::Planes => self.planes,
        }
    }

    /// Takes a point of the orbit into account.
    pub(super) fn pass(&mut self, z: &[f32]) {
        let (mut sum, mut least, mut largest) = (0.0, f32::INFINITY, 0.0_f32);
        for part in z {
            let square = part * part;
            (sum, least, largest) = (sum + square, least.min(square), largest.max(square));
        }
        self.origin = self.origin.min(sum.sqrt());
        // What is left without the greatest part is the distance from the nearest axis.
        self.axes = self.axes.min((sum - largest).max(0.0).sqrt());
        self.planes = self.planes.min(least.sqrt());
    }
}

impl Sdf {
    /// The traps of the orbit at a place in object space: that of the fractal whose surface is nearest, by its own value.
    /// [`Traps::NONE`] without fractals.
    pub fn traps(&self, p: Vec3) -> Traps {
        let (mut place, mut scale) = (Point::<f32>::splat(p), 1.0_f32);
        let mut outer = Vec::new();
        let mut nearest = (f32::INFINITY, Traps::NONE);
        for op in self.tape().ops() {
            match op {
                Op::Enter(space) => {
                    outer.push((place, scale));
                    (place, scale) = (space.enter(place), scale * space.scale());
                }
                Op::Leave(_) => (place, scale) = outer.pop().unwrap_or((place, scale)),
                Op::Leaf(leaf) => {
                    let Some(traps) = leaf.traps(place) else { continue };
                    let away = (leaf.distance(place) * scale).abs();
                    if away < nearest.0 {
                        nearest = (away, traps);
                    }
                }
                Op::Operator(_) | Op::Displace(_) => {}
            }
        }
        nearest.1
    }

    /// Whether there are orbits that traps may be held against.
    pub fn has_orbits(&self) -> bool {
        self.tape().level().is_some()
    }
}
