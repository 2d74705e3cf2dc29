//! Owns the tree that rays walk: an 8-wide hierarchy of boxes over anything that has one.
//!
//! obvhs builds a binary tree (PLOC, then reinsertion); it is collapsed to nodes of eight children whose boxes are
//! tested together. The slab test is widened by its rounding error (Ize 2013), so that with a watertight primitive test
//! nothing leaks between two boxes.

mod build;
mod leaf;
mod traverse;
pub mod triangle;

pub use build::{BuildError, Costs};
pub use traverse::{Cast, RayBoxes};

use crate::math::Aabb;

/// Marks a child as a leaf: the other bits hold its size less one and its first slot.
const LEAF: u32 = 1 << 31;
const LEAF_SIZE_SHIFT: u32 = 28;
const LEAF_START: u32 = (1 << LEAF_SIZE_SHIFT) - 1;
/// A child that does not exist: its box is empty and is never hit. No leaf begins at so high a slot.
const NONE: u32 = u32::MAX;

/// Eight children: boxes as min x, max x, min y, … of all, and what they are.
#[derive(Debug, Clone, PartialEq)]
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
#[derive(Debug, Clone, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Slot to primitive.
    slots: Vec<u32>,
    root: u32,
    bounds: Aabb,
    /// Most children that wait while one is visited.
    waiting: usize,
}

impl Bvh {
    /// The primitive of each slot.
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// First slot and size of every leaf, in the order of the slots.
    fn leaves(&self) -> Vec<(u32, u32)> {
        let children = self.nodes.iter().flat_map(|node| node.child);
        let codes = children.chain([self.root]).filter(|&code| code & LEAF != 0 && code != NONE);
        let mut leaves: Vec<_> = codes.map(range).collect();
        leaves.sort_unstable();
        leaves
    }

    /// Most children that wait while one below a child is visited: all others of every node on the way.
    fn most_waiting(&self, code: u32) -> usize {
        if code & LEAF != 0 {
            return 0;
        }
        let children = self.nodes[code as usize].child.into_iter().filter(|&child| child != NONE);
        let (count, deepest) = children.fold((0, 0), |(count, deepest): (usize, usize), child| {
            (count + 1, deepest.max(self.most_waiting(child)))
        });
        count.saturating_sub(1) + deepest
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

/// First slot and size of a leaf.
#[inline]
fn range(code: u32) -> (u32, u32) {
    (code & LEAF_START, (code >> LEAF_SIZE_SHIFT & 7) + 1)
}
