//! Owns the node kinds, one file each: formula, Lipschitz bound and where it comes from.
//!
//! Every leaf promises that its value is negative inside, positive outside, and never greater than the distance to
//! its surface (its Lipschitz bound is 1); operators say what they keep of that promise.

pub(super) mod cuboid;
pub(super) mod mandelbulb;
pub(super) mod smooth_union;
pub(super) mod sphere;
pub(super) mod torus;
pub(super) mod transform;
pub(super) mod union;

pub(super) use cuboid::Cuboid;
pub(super) use mandelbulb::Mandelbulb;
pub(super) use smooth_union::SmoothUnion;
pub(super) use sphere::Sphere;
pub(super) use torus::Torus;
pub(super) use transform::Similarity;
