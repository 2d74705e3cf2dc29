//! Owns the tree that rays walk: an 8-wide hierarchy of boxes over anything that has one.
//!
//! obvhs builds a binary tree (PLOC, then reinsertion); it is collapsed to nodes of eight children whose boxes are
//! tested together. The slab test is widened by its rounding error (Ize 2013), so that with a watertight primitive test
//! nothing leaks between two boxes.

mod build;
mod traverse;
pub mod triangle;

pub use build::BuildError;
pub use traverse::RayBoxes;

use crate::math::Aabb;

/// Marks a child as a leaf: the other bits hold its size less one and its first slot.
const LEAF: u32 = 1 << 31;
const LEAF_SIZE_SHIFT: u32 = 28;
const LEAF_START: u32 = (1 << LEAF_SIZE_SHIFT) - 1;
/// Most primitives of a leaf.
const MAX_LEAF: u32 = 4;
/// A child that does not exist: its box is empty and is never hit.
const NONE: u32 = LEAF;

/// Eight children: boxes as min x, max x, min y, … of all, and what they are.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Node {
    bounds: [[f32; 8]; 6],
    child: [u32; 8],
}

impl Node {
    const EMPTY: Self = Self {
        bounds: [
            [f32::INFINITY; 8],
            [f32::NEG_INFINITY; 8],
            [f32::INFINITY; 8],
            [f32::NEG_INFINITY; 8],
            [f32::INFINITY; 8],
            [f32::NEG_INFINITY; 8],
        ],
        child: [NONE; 8],
    };
}

/// A tree over primitives numbered as they were given.
///
/// Leaves refer to *slots*: primitives in the order of the tree, so that their data can lie beside each other.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Slot to primitive.
    slots: Vec<u32>,
    root: u32,
    bounds: Aabb,
}

impl Bvh {
    /// The primitive of each slot.
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// The box around everything.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Memory of the nodes and slots in bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.slots.len() * size_of::<u32>()
    }
}
