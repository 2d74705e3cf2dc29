//! Owns the node kinds: formula, Lipschitz bound and where it comes from.
//!
//! Every [`Leaf`] promises that its value is negative inside, positive outside, and never greater than the distance to
//! its surface (its Lipschitz bound is 1); an [`Operator`] keeps that promise.

pub(super) mod blend;
pub(super) mod capsule;
pub(super) mod cone;
pub(super) mod cuboid;
pub(super) mod cylinder;
pub(super) mod displacement;
pub(super) mod ellipsoid;
pub(super) mod julia;
pub(super) mod leaf;
pub(super) mod mandelbulb;
pub(super) mod operator;
pub(super) mod plane;
pub(super) mod repetition;
pub(super) mod rounded_box;
pub(super) mod space;
pub(super) mod sphere;
pub(super) mod torus;
pub(super) mod transform;
pub(super) mod winding;

pub(super) use blend::Blend;
pub(super) use capsule::Capsule;
pub(super) use cone::Cone;
pub(super) use cuboid::Cuboid;
pub(super) use cylinder::Cylinder;
pub(super) use displacement::Displacement;
pub(super) use ellipsoid::Ellipsoid;
pub(super) use julia::Julia;
pub(super) use leaf::Leaf;
pub(super) use mandelbulb::Mandelbulb;
pub(super) use operator::Operator;
pub(super) use plane::Plane;
pub(super) use repetition::Repetition;
pub(super) use rounded_box::RoundedBox;
pub(super) use space::Space;
pub(super) use sphere::Sphere;
pub(super) use torus::Torus;
pub(super) use transform::Similarity;
pub(super) use winding::{Axis, Winding};
