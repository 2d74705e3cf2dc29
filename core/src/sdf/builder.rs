//! Owns the way from a tree of nodes to a tape.

use glam::{Mat3, Vec3, Vec4};

use super::error::SdfError;
use super::node::{
    Axis, Blend, Capsule, Cone, Cuboid, Cylinder, Displacement, Ellipsoid, Julia, Leaf, Mandelbulb, Operator,
    Repetition, RoundedBox, Similarity, Space, Sphere, Torus, Winding,
};
use super::noise::NoiseParameters;
use super::tape::{MAX_DEPTH, Op, Tape};

/// Most nodes of one tree.
pub const MAX_NODES: usize = 65_536;

/// Names a node of the [`TapeBuilder`] that made it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeId(u32);

/// A node as it was added; children precede their parents.
#[derive(Debug)]
enum Node {
    Leaf(Leaf),
    Operator(Operator, Vec<NodeId>),
    Displace(Displacement, NodeId),
    Space(Space, NodeId),
    Transform(Similarity, NodeId),
}

/// Collects the nodes of a tree, children first, and compiles them.
///
/// The first error is kept and returned by [`TapeBuilder::finish`]; until then every method returns an id.
///
/// ```
/// use glam::{Mat3, Vec3, Vec4};
/// use karst_core::sdf::{Point, TapeBuilder};
///
/// let mut tree = TapeBuilder::new();
/// let ball = tree.sphere(1.0);
/// let cube = tree.cuboid(Vec3::splat(1.0));
/// let cube = tree.transform(cube, Vec3::X, Mat3::IDENTITY, 1.0);
/// let both = tree.smooth_union(&[ball, cube], 0.25);
/// let tape = tree.finish(both)?;
/// assert_eq!(tape.distance::<f32>(Point::splat(Vec3::new(0.0, 3.0, 0.0))), 2.0);
/// # Ok::<(), karst_core::sdf::SdfError>(())
/// ```
#[derive(Debug, Default)]
pub struct TapeBuilder {
    nodes: Vec<Node>,
    error: Option<SdfError>,
}

impl TapeBuilder {
    /// A builder without nodes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Ball around the origin.
    pub fn sphere(&mut self, radius: f32) -> NodeId {
        self.leaf(Sphere::new(radius).map(Leaf::Sphere))
    }

    /// Box around the origin with the given full edge lengths.
    pub fn cuboid(&mut self, size: Vec3) -> NodeId {
        self.leaf(Cuboid::new(size).map(Leaf::Cuboid))
    }

    /// Box around the origin with the given full edge lengths, its edges rounded with `radius`.
    pub fn rounded_box(&mut self, size: Vec3, radius: f32) -> NodeId {
        self.leaf(RoundedBox::new(size, radius).map(Leaf::RoundedBox))
    }

    /// Everything below `y = 0`; something else must bound the object.
    pub fn plane(&mut self) -> NodeId {
        self.leaf(Ok(Leaf::Plane))
    }

    /// Torus around the y axis: a tube of radius `minor` along a circle of radius `major`.
    pub fn torus(&mut self, major: f32, minor: f32) -> NodeId {
        self.leaf(Torus::new(major, minor).map(Leaf::Torus))
    }

    /// Cylinder around the y axis with a full height.
    pub fn cylinder(&mut self, radius: f32, height: f32) -> NodeId {
        self.leaf(Cylinder::new(radius, height).map(Leaf::Cylinder))
    }

    /// Everything within `radius` of a piece of the y axis of length `height` around the origin.
    pub fn capsule(&mut self, radius: f32, height: f32) -> NodeId {
        self.leaf(Capsule::new(radius, height).map(Leaf::Capsule))
    }

    /// Cone around the y axis with a full height, `radius` at its bottom and `top_radius` (0 is a tip) at its top.
    pub fn cone(&mut self, radius: f32, top_radius: f32, height: f32) -> NodeId {
        self.leaf(Cone::new(radius, top_radius, height).map(Leaf::Cone))
    }

    /// Ellipsoid around the origin with half axes along x, y and z.
    pub fn ellipsoid(&mut self, radii: Vec3) -> NodeId {
        self.leaf(Ellipsoid::new(radii).map(Leaf::Ellipsoid))
    }

    /// Mandelbulb around the z axis, about 1.1 in radius at power 8.
    ///
    /// `iterations` at most are made, until the orbit leaves the radius `bailout`.
    pub fn mandelbulb(&mut self, power: f32, iterations: u32, bailout: f32) -> NodeId {
        self.leaf(Mandelbulb::new(power, iterations, bailout).map(Leaf::Mandelbulb))
    }

    /// Slice `w = 0` of the Julia set of `q² + c` in the quaternions, at most 2.6 in radius.
    pub fn julia(&mut self, c: Vec4, iterations: u32) -> NodeId {
        self.leaf(Julia::new(c, iterations).map(Leaf::Julia))
    }

    /// Union of one or more objects.
    pub fn union(&mut self, children: &[NodeId]) -> NodeId {
        self.operator("union", Operator::Union, children)
    }

    /// What is in all of one or more objects.
    pub fn intersection(&mut self, children: &[NodeId]) -> NodeId {
        self.operator("intersection", Operator::Intersection, children)
    }

    /// What is in the first of one or more objects and in none of the others.
    pub fn difference(&mut self, children: &[NodeId]) -> NodeId {
        self.operator("difference", Operator::Difference, children)
    }

    /// Union with seams rounded over a width of `k`, folded pairwise in the given order.
    pub fn smooth_union(&mut self, children: &[NodeId], k: f32) -> NodeId {
        let blend = Blend::new("smooth_union.k", k);
        self.smooth("smooth_union", blend, Operator::SmoothUnion, Operator::Union, children)
    }

    /// Intersection with edges rounded over a width of `k`, folded pairwise in the given order.
    pub fn smooth_intersection(&mut self, children: &[NodeId], k: f32) -> NodeId {
        let (blend, hard) = (Blend::new("smooth_intersection.k", k), Operator::Intersection);
        self.smooth("smooth_intersection", blend, Operator::SmoothIntersection, hard, children)
    }

    /// Difference with edges rounded over a width of `k`, folded pairwise in the given order.
    pub fn smooth_difference(&mut self, children: &[NodeId], k: f32) -> NodeId {
        let (blend, hard) = (Blend::new("smooth_difference.k", k), Operator::Difference);
        self.smooth("smooth_difference", blend, Operator::SmoothDifference, hard, children)
    }

    /// A child whose surface is moved out by noise.
    pub fn fbm_noise(&mut self, child: NodeId, parameters: NoiseParameters) -> NodeId {
        match Displacement::new(parameters) {
            Ok(displacement) => self.add(Node::Displace(displacement, child)),
            Err(error) => self.fail(error),
        }
    }

    /// Copies of a child with a period along each axis (0 for none), `count` of them on either side or without end.
    pub fn repetition(&mut self, child: NodeId, period: Vec3, count: Option<u32>) -> NodeId {
        self.space(Repetition::new(period, [count; 3]).map(Space::Repetition), child)
    }

    /// A child turned around the y axis by `degrees` per unit of y.
    pub fn twist(&mut self, child: NodeId, degrees: f32) -> NodeId {
        self.space(Winding::new(Axis::Twist, degrees).map(Space::Winding), child)
    }

    /// A child turned around the z axis by `degrees` per unit of x.
    pub fn bend(&mut self, child: NodeId, degrees: f32) -> NodeId {
        self.space(Winding::new(Axis::Bend, degrees).map(Space::Winding), child)
    }

    /// A child scaled by `scale`, then turned by `rotation` (a pure rotation; see [`Mat3::from_quat`]), then moved by
    /// `translate`.
    pub fn transform(&mut self, child: NodeId, translate: Vec3, rotation: Mat3, scale: f32) -> NodeId {
        match Similarity::new(translate, rotation, scale) {
            Ok(similarity) => self.add(Node::Transform(similarity, child)),
            Err(error) => self.fail(error),
        }
    }

    /// Compiles the tree under `root`.
    ///
    /// # Errors
    /// The first bad parameter; an operator without children; copies that are too close to each other; what has no end
    /// wound; a node with two parents; more than [`MAX_NODES`] nodes or
    /// a nesting that needs more than [`MAX_DEPTH`] intermediate values, with the figure.
    pub fn finish(mut self, root: NodeId) -> Result<Tape, SdfError> {
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        if self.nodes.len() > MAX_NODES {
            return Err(SdfError::TooManyNodes { found: self.nodes.len(), allowed: MAX_NODES });
        }
        let (ops, nodes) = self.flatten(root)?;
        let depth = depth(&ops);
        if depth > MAX_DEPTH {
            return Err(SdfError::TooDeep { found: depth, allowed: MAX_DEPTH });
        }
        Tape::new(ops, nodes, depth)
    }

    fn leaf(&mut self, made: Result<Leaf, SdfError>) -> NodeId {
        match made {
            Ok(leaf) => self.add(Node::Leaf(leaf)),
            Err(error) => self.fail(error),
        }
    }

    fn space(&mut self, made: Result<Space, SdfError>, child: NodeId) -> NodeId {
        match made {
            Ok(space) => self.add(Node::Space(space, child)),
            Err(error) => self.fail(error),
        }
    }

    fn operator(&mut self, kind: &'static str, operator: Operator, children: &[NodeId]) -> NodeId {
        if children.is_empty() {
            self.keep(SdfError::NoChildren { kind });
        }
        self.add(Node::Operator(operator, children.to_vec()))
    }

    /// The smooth operator, or the hard one where the blend vanishes.
    fn smooth(
        &mut self,
        kind: &'static str,
        blend: Result<Option<Blend>, SdfError>,
        smooth: fn(Blend) -> Operator,
        hard: Operator,
        children: &[NodeId],
    ) -> NodeId {
        match blend {
            Ok(blend) => self.operator(kind, blend.map_or(hard, smooth), children),
            Err(error) => self.fail(error),
        }
    }

    fn add(&mut self, node: Node) -> NodeId {
        let id = NodeId(u32::try_from(self.nodes.len()).unwrap_or(u32::MAX));
        // Past the limit nodes are only counted: what they hold cannot be used any more.
        self.nodes.push(if self.nodes.len() < MAX_NODES {
            node
        } else {
            Node::Operator(Operator::Union, Vec::new())
        });
        id
    }

    fn fail(&mut self, error: SdfError) -> NodeId {
        self.keep(error);
        self.add(Node::Operator(Operator::Union, Vec::new()))
    }

    fn keep(&mut self, error: SdfError) {
        self.error.get_or_insert(error);
    }

    /// The steps of the tree in evaluation order, and how many nodes it has. No recursion: trees may be deep.
    fn flatten(&self, root: NodeId) -> Result<(Vec<Op>, usize), SdfError> {
        let mut used = vec![false; self.nodes.len()];
        let mut ops = Vec::with_capacity(self.nodes.len());
        let mut pending = vec![Work::Visit(root, None)];
        while let Some(work) = pending.pop() {
            let (id, placed) = match work {
                Work::Visit(id, placed) => (id, placed),
                Work::Emit(op) => {
                    ops.push(op);
                    continue;
                }
            };
            let index = id.0 as usize;
            if used.get(index).copied().unwrap_or(true) {
                return Err(SdfError::NotATree { id: id.0 });
            }
            used[index] = true;
            // A placement of a placement is one placement; anything else ends the chain.
            if let (Some(outer), false) = (placed, matches!(self.nodes[index], Node::Transform(..))) {
                let placement = outer.placement()?;
                let space = Space::Placement(placement);
                ops.push(Op::Enter(space));
                pending.push(Work::Emit(Op::Leave(space)));
            }
            match &self.nodes[index] {
                Node::Leaf(leaf) => ops.push(Op::Leaf(*leaf)),
                Node::Operator(operator, children) => {
                    fold(&mut pending, children, Op::Operator(*operator));
                }
                Node::Displace(displacement, child) => {
                    pending.push(Work::Emit(Op::Displace(*displacement)));
                    pending.push(Work::Visit(*child, None));
                }
                Node::Space(space, child) => {
                    ops.push(Op::Enter(*space));
                    pending.push(Work::Emit(Op::Leave(*space)));
                    pending.push(Work::Visit(*child, None));
                }
                Node::Transform(inner, child) => {
                    let placed = placed.map_or(*inner, |outer: Similarity| outer.then_inner(*inner));
                    pending.push(Work::Visit(*child, Some(placed)));
                }
            }
        }
        let nodes = used.iter().filter(|&&used| used).count();
        Ok((ops, nodes))
    }
}

/// What is still to be done in [`TapeBuilder::flatten`], last first.
enum Work {
    Visit(NodeId, Option<Similarity>),
    Emit(Op),
}

/// Plans `((a op b) op c) …` on the work stack.
fn fold(pending: &mut Vec<Work>, children: &[NodeId], op: Op) {
    for (i, &child) in children.iter().enumerate().rev() {
        if i > 0 {
            pending.push(Work::Emit(op));
        }
        pending.push(Work::Visit(child, None));
    }
}

/// Values or nested points needed at once, whichever is more.
fn depth(ops: &[Op]) -> usize {
    let (mut values, mut points, mut most) = (0_usize, 0_usize, 0_usize);
    for op in ops {
        match op {
            Op::Leaf(_) => values += 1,
            Op::Operator(_) => values -= 1,
            Op::Displace(_) => {}
            Op::Enter(_) => points += 1,
            Op::Leave(_) => points -= 1,
        }
        most = most.max(values).max(points);
    }
    most
}
