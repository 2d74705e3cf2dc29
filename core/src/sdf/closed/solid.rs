//! Owns the solids that a line meets by formula, and where they are placed.

use glam::{DMat3, DVec3};

use super::line::{Line, Span};
use crate::sdf::node::transform::Placement;
use crate::sdf::node::{Capsule, Cone, Cuboid, Cylinder, Ellipsoid, Leaf, Plane, Sphere};
use crate::sdf::real::Point;

/// A convex solid: a line is inside of it along one piece at most.
#[derive(Debug, Clone, Copy)]
enum Solid {
    Sphere(Sphere),
    Cuboid(Cuboid),
    Plane,
    Cylinder(Cylinder),
    Capsule(Capsule),
    Cone(Cone),
    Ellipsoid(Ellipsoid),
}

impl Solid {
    fn of(leaf: Leaf) -> Option<Self> {
        match leaf {
            Leaf::Sphere(solid) => Some(Self::Sphere(solid)),
            Leaf::Cuboid(solid) => Some(Self::Cuboid(solid)),
            Leaf::Plane => Some(Self::Plane),
            Leaf::Cylinder(solid) => Some(Self::Cylinder(solid)),
            Leaf::Capsule(solid) => Some(Self::Capsule(solid)),
            Leaf::Cone(solid) => Some(Self::Cone(solid)),
            Leaf::Ellipsoid(solid) => Some(Self::Ellipsoid(solid)),
            // A line may meet a torus twice. A rounded box is convex, but the formula asks for three boxes and twelve
            // capsules, which takes longer than the march.
            Leaf::RoundedBox(_) | Leaf::Torus(_) | Leaf::Mandelbulb(_) | Leaf::Julia(_) => None,
        }
    }

    #[inline]
    fn span(&self, line: &Line) -> Option<Span> {
        match self {
            Self::Sphere(solid) => solid.span(line),
            Self::Cuboid(solid) => solid.span(line),
            Self::Plane => Plane::span(line),
            Self::Cylinder(solid) => solid.span(line),
            Self::Capsule(solid) => solid.span(line),
            Self::Cone(solid) => solid.span(line),
            Self::Ellipsoid(solid) => solid.span(line),
        }
    }

    fn distance(&self, p: Point<f64>) -> f64 {
        match self {
            Self::Sphere(solid) => solid.distance(p),
            Self::Cuboid(solid) => solid.distance(p),
            Self::Plane => Plane::distance(p),
            Self::Cylinder(solid) => solid.distance(p),
            Self::Capsule(solid) => solid.distance(p),
            Self::Cone(solid) => solid.distance(p),
            Self::Ellipsoid(solid) => solid.distance(p),
        }
    }
}

/// Nested placements as one, in f64, so that none of the numbers that a tape holds is rounded again.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Origin of this space, in object space.
    pub(super) origin: DVec3,
    /// Turns and scales vectors of object space into this one.
    inwards: DMat3,
    /// Size of a unit of this space, in object units.
    scale: f64,
}

impl Frame {
    /// Object space.
    pub(super) const OBJECT: Self = Self { origin: DVec3::ZERO, inwards: DMat3::IDENTITY, scale: 1.0 };

    /// The space that a placement makes in this one; `None` where it is too small for numbers.
    pub(super) fn enter(&self, placement: &Placement) -> Option<Self> {
        let (translate, inwards) = placement.inwards();
        let frame = Self {
            origin: self.origin + self.inwards.inverse() * translate,
            inwards: inwards * self.inwards,
            scale: self.scale * f64::from(placement.scale),
        };
        (frame.origin.is_finite() && frame.inwards.is_finite() && frame.scale > 0.0).then_some(frame)
    }

    fn place(&self, p: DVec3) -> DVec3 {
        self.inwards * (p - self.origin)
    }
}

/// A solid somewhere in object space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    solid: Solid,
    frame: Frame,
    /// The space that it is placed in, by its index in the closed form.
    pub(super) space: usize,
}

impl Placed {
    pub(super) fn new(leaf: Leaf, frame: Frame, space: usize) -> Option<Self> {
        Solid::of(leaf).map(|solid| Self { solid, frame, space })
    }

    /// The piece of the line `origin + t dir` that is inside, in `t`.
    #[inline]
    pub(super) fn span(&self, origin: DVec3, dir: DVec3) -> Option<Span> {
        let (origin, dir) = (self.frame.place(origin), self.frame.inwards * dir);
        let per_length = 1.0 / dir.length_squared().sqrt();
        let dir = dir * per_length;
        let ahead = -origin.dot(dir);
        let found = self.solid.span(&Line { foot: origin + dir * ahead, dir })?;
        Some(Span { start: (ahead + found.start) * per_length, end: (ahead + found.end) * per_length })
    }

    /// The value at a point, in object units: convex along every line.
    pub(super) fn distance(&self, p: DVec3) -> f64 {
        let p = self.frame.place(p);
        self.solid.distance(Point::new(p.x, p.y, p.z)) * self.frame.scale
    }
}
