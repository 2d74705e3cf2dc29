//! Owns the set of solids that trees are made of.

use super::{
    Capsule, Cone, Cuboid, Cylinder, Ellipsoid, Julia, Mandelbulb, Plane, RoundedBox, Sphere, Torus, julia,
    mandelbulb,
};
use crate::math::Aabb;
use crate::sdf::real::{Point, Real};
use crate::sdf::traps::Traps;

/// A solid. Its value is negative inside, positive outside, and changes no faster than the place.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) enum Leaf {
    Sphere(Sphere),
    Cuboid(Cuboid),
    RoundedBox(RoundedBox),
    Plane,
    Torus(Torus),
    Cylinder(Cylinder),
    Capsule(Capsule),
    Cone(Cone),
    Ellipsoid(Ellipsoid),
    Mandelbulb(Mandelbulb),
    Julia(Julia),
}

impl Leaf {
    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(&self, p: Point<R>) -> R {
        match self {
            Self::Sphere(solid) => solid.distance(p),
            Self::Cuboid(solid) => solid.distance(p),
            Self::RoundedBox(solid) => solid.distance(p),
            Self::Plane => Plane::distance(p),
            Self::Torus(solid) => solid.distance(p),
            Self::Cylinder(solid) => solid.distance(p),
            Self::Capsule(solid) => solid.distance(p),
            Self::Cone(solid) => solid.distance(p),
            Self::Ellipsoid(solid) => solid.distance(p),
            Self::Mandelbulb(solid) => solid.distance(p),
            Self::Julia(solid) => solid.distance(p),
        }
    }

    /// A box around all places where the value is at most `margin`, which is not negative.
    pub(in crate::sdf) fn bounds(&self, margin: f32) -> Aabb {
        let hull = match self {
            Self::Sphere(solid) => solid.bounds(),
            Self::Cuboid(solid) => solid.bounds(),
            Self::RoundedBox(solid) => solid.bounds(),
            Self::Plane => Plane::bounds(),
            Self::Torus(solid) => solid.bounds(),
            Self::Cylinder(solid) => solid.bounds(),
            Self::Capsule(solid) => solid.bounds(),
            Self::Cone(solid) => solid.bounds(),
            Self::Ellipsoid(solid) => solid.bounds(),
            Self::Mandelbulb(solid) => return solid.bounds(margin),
            Self::Julia(solid) => return solid.bounds(margin),
        };
        // All values above are at least the distance to the box.
        hull.grown(margin)
    }

    /// Largest number that is subtracted near the surface besides those that the coordinates there are as large as.
    pub(in crate::sdf) fn reach(&self) -> f32 {
        match self {
            // The middle of the tube; ends of the slant, far from the tip.
            Self::Torus(_) | Self::Cone(_) => self.bounds(0.0).max.max_element(),
            Self::Sphere(_)
            | Self::Cuboid(_)
            | Self::RoundedBox(_)
            | Self::Plane
            | Self::Cylinder(_)
            | Self::Capsule(_)
            | Self::Ellipsoid(_)
            | Self::Mandelbulb(_)
            | Self::Julia(_) => 0.0,
        }
    }

    /// How close the orbit of a place comes to the traps, where there is one.
    pub(in crate::sdf) fn traps(&self, p: Point<f32>) -> Option<Traps> {
        match self {
            Self::Mandelbulb(solid) => Some(solid.traps(p)),
            Self::Julia(solid) => Some(solid.traps(p)),
            Self::Sphere(_)
            | Self::Cuboid(_)
            | Self::RoundedBox(_)
            | Self::Plane
            | Self::Torus(_)
            | Self::Cylinder(_)
            | Self::Capsule(_)
            | Self::Cone(_)
            | Self::Ellipsoid(_) => None,
        }
    }

    /// The value that stands for the surface, where that is a choice.
    pub(in crate::sdf) fn level(&self) -> Option<f32> {
        match self {
            Self::Mandelbulb(_) => Some(mandelbulb::LEVEL),
            Self::Julia(_) => Some(julia::LEVEL),
            Self::Sphere(_)
            | Self::Cuboid(_)
            | Self::RoundedBox(_)
            | Self::Plane
            | Self::Torus(_)
            | Self::Cylinder(_)
            | Self::Capsule(_)
            | Self::Cone(_)
            | Self::Ellipsoid(_) => None,
        }
    }
}
