//! Owns building: obvhs' binary tree, collapsed to eight children a node by the surface-area heuristic.

use super::{Bvh, LEAF, LEAF_SIZE_SHIFT, LEAF_START, NONE, Node};
use crate::math::Aabb;
use obvhs::aabb::Aabb as Box2;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Why no tree could be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A box is empty or not finite.
    #[error("the box of primitive {0} is empty or not finite")]
    BadBox(usize),
    /// More primitives than slots can number.
    #[error("{0} primitives or more; fewer than {LEAF_START} are allowed")]
    TooMany(usize),
}

/// What a leaf costs against the eight boxes of a node, in the surface-area heuristic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Costs {
    /// A leaf, whatever is in it.
    pub leaf: f32,
    /// A primitive more.
    pub primitive: f32,
    /// Most primitives of a leaf, up to 8.
    pub most: u32,
}

impl Costs {
    /// Of `count` primitives in a leaf.
    fn of(self, count: u32) -> f32 {
        if count <= self.most { self.leaf + self.primitive * count as f32 } else { f32::INFINITY }
    }
}

impl Bvh {
    /// Whether a tree can be built with a box as its primitive of this number.
    ///
    /// # Errors
    /// The box is empty or not finite, or there are too many before it.
    pub fn check(number: usize, it: &Aabb) -> Result<(), BuildError> {
        if number >= LEAF_START as usize - 1 {
            return Err(BuildError::TooMany(number + 1));
        }
        if it.is_empty() || !it.is_finite() { Err(BuildError::BadBox(number)) } else { Ok(()) }
    }

    /// The tree over nothing.
    pub(super) fn empty() -> Self {
        let nodes = vec![Node::EMPTY];
        Self { nodes, slots: Vec::new(), root: 0, bounds: Aabb::EMPTY, waiting: 0 }
    }

    /// Builds the tree over boxes.
    ///
    /// # Errors
    /// Names the first box that is empty or not finite, or says that there are too many.
    pub fn build(boxes: &[Aabb], costs: Costs) -> Result<Self, BuildError> {
        for (number, it) in boxes.iter().enumerate() {
            Self::check(number, it)?;
        }
        if boxes.is_empty() {
            return Ok(Self::empty());
        }
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let mut out = Self { nodes: Vec::new(), slots: Vec::new(), root: NONE, bounds, waiting: 0 };
        let binary = build_binary(boxes);
        let choices = choose(&binary, costs);
        let mut emit = Emit { binary: &binary, choices: &choices, out: &mut out };
        let root = if choices[0].is_leaf { emit.leaf(0) } else { emit.node(0) };
        out.root = root;
        out.waiting = out.most_waiting(root);
        Ok(out)
    }
}

/// From so many primitives on the builder's sort leaves the order of ties to the number of threads.
const MANY: usize = 4_000_000;

/// Threads that build large trees, wherever.
const BUILDERS: usize = 4;

/// The binary tree, the same whatever the number of threads.
fn build_binary(boxes: &[Aabb]) -> Bvh2 {
    if boxes.len() < MANY {
        return build_by_all(boxes);
    }
    match rayon::ThreadPoolBuilder::new().num_threads(BUILDERS).build() {
        Ok(pool) => pool.install(|| build_by_all(boxes)),
        // The tree is a good one anyway, and no pixel depends on which.
        Err(_) => build_by_all(boxes),
    }
}

fn build_by_all(boxes: &[Aabb]) -> Bvh2 {
    let boxes: Vec<Box2> = boxes.iter().map(|b| Box2::new(b.min.into(), b.max.into())).collect();
    let indices = (0..boxes.len() as u32).collect();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        &boxes,
        indices,
        SortPrecision::U64,
        1,
    );
    ReinsertionOptimizer::default().run(&mut binary, 0.2, None);
    binary
}

/// What the heuristic decided for a binary node.
#[derive(Clone, Default)]
struct Choice {
    /// Cheapest cost of giving the subtree 1 … 7 child places of an 8-wide node; `cost[0]` is that of one place.
    cost: [f32; 7],
    /// How many of k + 1 places go to the left half; 0 means that k places are as good.
    left: [u8; 8],
    is_leaf: bool,
    primitives: u32,
}

/// Dynamic program from the leaves up (Ylitie et al. 2017, section 3.1).
fn choose(binary: &Bvh2, costs: Costs) -> Vec<Choice> {
    let mut order = Vec::with_capacity(binary.nodes.len());
    let mut stack = vec![0];
    while let Some(index) = stack.pop() {
        order.push(index);
        let node = &binary.nodes[index];
        if !node.is_leaf() {
            stack.extend([node.first_index as usize, node.first_index as usize + 1]);
        }
    }
    let mut choices = vec![Choice::default(); binary.nodes.len()];
    for &index in order.iter().rev() {
        choices[index] = choose_node(binary, &choices, index, costs);
    }
    choices
}

fn choose_node(binary: &Bvh2, choices: &[Choice], index: usize, costs: Costs) -> Choice {
    let node = &binary.nodes[index];
    let area = node.aabb().half_area();
    if node.is_leaf() {
        let cost = area * costs.of(node.prim_count);
        return Choice { cost: [cost; 7], left: [0; 8], is_leaf: true, primitives: node.prim_count };
    }
    let (l, r) = (&choices[node.first_index as usize], &choices[node.first_index as usize + 1]);
    let mut out = Choice { primitives: l.primitives + r.primitives, ..Choice::default() };
    let best_split = |places: usize| {
        (1..places)
            .map(|left| (l.cost[left - 1] + r.cost[places - left - 1], left as u8))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("two or more places can always be split")
    };
    // One place: a leaf, or a node of its own that spends all eight places.
    let (children, left) = best_split(8);
    out.left[7] = left;
    let as_node = children + area;
    let as_leaf = area * costs.of(out.primitives);
    out.is_leaf = as_leaf <= as_node;
    out.cost[0] = as_leaf.min(as_node);
    // More places: split them, unless fewer are as good.
    for places in 2..8 {
        let (cost, left) = best_split(places);
        let fewer = out.cost[places - 2];
        out.cost[places - 1] = cost.min(fewer);
        out.left[places - 1] = if cost < fewer { left } else { 0 };
    }
    out
}

struct Emit<'a> {
    binary: &'a Bvh2,
    choices: &'a [Choice],
    out: &'a mut Bvh,
}

impl Emit<'_> {
    /// Writes the wide node of a binary node; the recursion is as deep as the wide tree.
    fn node(&mut self, index: usize) -> u32 {
        let me = self.out.nodes.len();
        self.out.nodes.push(Node::EMPTY);
        let mut children = Vec::with_capacity(8);
        self.split(index, 8, &mut children);
        for (slot, &child) in children.iter().enumerate() {
            let aabb = self.binary.nodes[child].aabb();
            for axis in 0..3 {
                self.out.nodes[me].bounds[2 * axis][slot] = aabb.min[axis];
                self.out.nodes[me].bounds[2 * axis + 1][slot] = aabb.max[axis];
            }
            let code = if self.choices[child].is_leaf { self.leaf(child) } else { self.node(child) };
            self.out.nodes[me].child[slot] = code;
        }
        me as u32
    }

    /// Hands `places` child places of a binary node to its halves.
    fn split(&self, index: usize, places: usize, children: &mut Vec<usize>) {
        let first = self.binary.nodes[index].first_index as usize;
        let left = usize::from(self.choices[index].left[places - 1]);
        for (half, places) in [(first, left), (first + 1, places - left)] {
            self.hand(half, places, children);
        }
    }

    fn hand(&self, index: usize, places: usize, children: &mut Vec<usize>) {
        let choice = &self.choices[index];
        if places == 1 || self.binary.nodes[index].is_leaf() {
            children.push(index);
        } else if choice.left[places - 1] == 0 {
            self.hand(index, places - 1, children);
        } else {
            self.split(index, places, children);
        }
    }

    fn leaf(&mut self, index: usize) -> u32 {
        let mut ids = Vec::new();
        let mut stack = vec![index];
        while let Some(index) = stack.pop() {
            let node = &self.binary.nodes[index];
            let first = node.first_index as usize;
            if node.is_leaf() {
                ids.extend_from_slice(
                    &self.binary.primitive_indices[first..first + node.prim_count as usize],
                );
            } else {
                stack.extend([first, first + 1]);
            }
        }
        ids.sort_unstable();
        let start = self.out.slots.len() as u32;
        self.out.slots.extend_from_slice(&ids);
        LEAF | (ids.len() as u32 - 1) << LEAF_SIZE_SHIFT | start
    }
}

#[cfg(test)]
mod tests {
    use super::{Bvh, Costs};
    use crate::math::Aabb;
    use glam::Vec3;

    /// A field of many equal boxes, whose order only ties decide, with some others among them.
    fn field(edge: u32) -> Vec<Aabb> {
        let cell = |i: u32, j: u32| {
            let low =
                Vec3::new(i as f32, if (i * 31 + j * 17).is_multiple_of(97) { 0.5 } else { 0.0 }, j as f32);
            Aabb { min: low, max: low + Vec3::new(1.0, 0.25, 1.0) }
        };
        (0..edge).flat_map(|i| (0..edge).map(move |j| cell(i, j))).collect()
    }

    #[test]
    fn threads_change_nothing() {
        let costs = Costs { leaf: 0.8, primitive: 0.06, most: 8 };
        for edge in [100, 730] {
            let boxes = field(edge);
            let build = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| Bvh::build(&boxes, costs).unwrap())
            };
            let want = build(1);
            for threads in [2, 3, 8] {
                assert!(build(threads) == want, "{edge}, {threads} threads");
            }
        }
    }
}
