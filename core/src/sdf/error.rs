//! Owns what can be wrong with a distance function, and how it is said.

use std::ops::RangeInclusive;

use glam::Vec3;

/// Why a tree of distance functions was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SdfError {
    /// A parameter of a node or a setting is outside its range.
    #[error("{name}: found {found}, expected {allowed}")]
    Parameter {
        /// Node kind and parameter, such as `mandelbulb.power`.
        name: &'static str,
        /// The value that was given.
        found: f32,
        /// What is allowed, in words.
        allowed: &'static str,
    },
    /// An operator has no children.
    #[error("{kind}: found no children, expected at least one")]
    NoChildren {
        /// Such as `union`.
        kind: &'static str,
    },
    /// A node is the child of two nodes, or is unknown to this builder.
    #[error("node {id} is used twice or does not exist: every node has exactly one parent")]
    NotATree {
        /// The node in question.
        id: u32,
    },
    /// The tree has more nodes than the limit.
    #[error("the tree has {found} nodes, allowed are {allowed}")]
    TooManyNodes {
        /// Nodes in the tree.
        found: usize,
        /// The limit.
        allowed: usize,
    },
    /// Evaluating the tree needs more intermediate values than the limit.
    #[error(
        "the tree is nested {found} deep, allowed are {allowed}\n  hint: put the deepest child of a union first, \
         or give a union many children instead of nesting unions"
    )]
    TooDeep {
        /// Depth that was needed.
        found: usize,
        /// The limit.
        allowed: usize,
    },
    /// The object has no end and no bounds.
    #[error(
        "the object has no end\n  hint: give it bounds, which then cut it, or an intersection with something that ends"
    )]
    Endless,
    /// The given bounds cut the object.
    #[error(
        "bounds are too small: the object reaches {amount} beyond them\n  hint: leave bounds out, or use at least \
         min [{}, {}, {}] and max [{}, {}, {}]",
        needed_min.x, needed_min.y, needed_min.z, needed_max.x, needed_max.y, needed_max.z
    )]
    BoundsTooSmall {
        /// How far the object reaches out of the given bounds, in object units.
        amount: f32,
        /// Lower corner of bounds that hold the object.
        needed_min: Vec3,
        /// Upper corner of bounds that hold the object.
        needed_max: Vec3,
    },
    /// Pixels see less of a fractal than single precision tells apart.
    #[error(
        "a pixel sees {pixel:.1e} of the fractal where it is nearest, expected at least {least:.1e}: single precision tells \
         no more apart\n  hint: move the camera back, widen its vfov, or take a smaller film"
    )]
    TooClose {
        /// Width of a pixel on the surface, in object units.
        pixel: f32,
        /// Least width that has neighbours in single precision.
        least: f32,
    },
}

/// Lengths whose squares, and products of a few of them, stay within f32.
pub(super) const LENGTHS: RangeInclusive<f32> = 1e-12..=1e12;

/// What [`LENGTHS`] allows, in words.
pub(super) const A_LENGTH: &str = "a number greater than 0 (1e-12 to 1e12)";

/// `Ok` when `ok`, else the error of a parameter out of range.
pub(super) fn require(
    ok: bool,
    name: &'static str,
    found: f32,
    allowed: &'static str,
) -> Result<(), SdfError> {
    if ok { Ok(()) } else { Err(SdfError::Parameter { name, found, allowed }) }
}
