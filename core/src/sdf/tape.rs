//! Owns flat tapes: a tree of distance functions as a list of steps for a small stack machine.

use crate::math::Aabb;

use super::node::{Cuboid, Displacement, Leaf, Operator, transform};
use super::real::{Point, Real};

/// One step of a tape. Leaves push a value; operators pop two values and push one; [`Op::Displace`] changes the value
/// on top; [`Op::Enter`] changes the point
/// that leaves see until the matching [`Op::Leave`].
#[derive(Debug, Clone, Copy)]
pub(super) enum Op {
    Leaf(Leaf),
    Operator(Operator),
    Displace(Displacement),
    Enter(transform::Placement),
    /// Ends a placement: the value on top is multiplied by the scale.
    Leave(f32),
}

/// Most intermediate values, and most nested placements, that a tape may need.
pub const MAX_DEPTH: usize = 128;

/// A compiled tree of distance functions. Made by [`super::TapeBuilder`].
///
/// The value is negative inside and positive outside. Evaluation allocates nothing.
#[derive(Debug, Clone)]
pub struct Tape {
    ops: Vec<Op>,
    /// Intermediate values or nested points needed, whichever is more.
    depth: usize,
    nodes: usize,
    bounds: Aabb,
    reach: f32,
    level: Option<f32>,
}

impl Tape {
    /// A tape of steps that leave exactly one value, from a tree of `nodes` nodes.
    pub(super) fn new(ops: Vec<Op>, nodes: usize, depth: usize) -> Self {
        let summary = Summary::of(&ops);
        Self { ops, depth, nodes, bounds: summary.bounds, reach: summary.reach, level: summary.level }
    }

    /// Nodes of the tree that this tape was made from.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// The tape of what is inside of a box.
    pub(super) fn cut(mut self, to: Aabb) -> Self {
        let half = Cuboid::from_half(to.size() * 0.5);
        let place = transform::Placement::at(to.center());
        self.ops.extend([
            Op::Enter(place),
            Op::Leaf(Leaf::Cuboid(half)),
            Op::Leave(1.0),
            Op::Operator(Operator::Intersection),
        ]);
        Self::new(self.ops, self.nodes, self.depth.max(2))
    }

    /// A box in object space that holds the object: outside of it values are positive. Empty where the object is known
    /// to be, infinite where it has no end.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Largest slope of the value, in units of value per unit of length.
    ///
    /// Proven where [`Tape::level`] is `None`. With a Mandelbulb it is what its step factor aims at.
    pub fn lipschitz(&self) -> f32 {
        // Every leaf has bound 1, and every operator of this version keeps the bound of its children.
        1.0
    }

    /// Distance level, in object units, that stands for the surface of the coarsest fractal; `None` without fractals.
    pub fn level(&self) -> Option<f32> {
        self.level
    }

    /// Largest number that an evaluation subtracts besides the coordinates of the point, in object units: offsets of
    /// nodes and radii of tori. With the coordinates it bounds the rounding error of a value.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// The value at a point in object space: a lower bound of the distance to the surface, negative inside.
    #[inline]
    pub fn distance<R: Real>(&self, p: Point<R>) -> R {
        // Small trees take small scratch: clearing it is part of every evaluation.
        match self.depth {
            0..=4 => self.run::<R, 4>(p),
            5..=16 => self.run::<R, 16>(p),
            _ => self.run::<R, MAX_DEPTH>(p),
        }
    }

    fn run<R: Real, const DEPTH: usize>(&self, p: Point<R>) -> R {
        let mut point = p;
        let mut outer = [p; DEPTH];
        let mut entered = 0;
        let mut below = [R::splat(0.0); DEPTH];
        let mut held = 0;
        // The newest value stays in a register; `below` holds the ones under it. The first push stores a filler.
        let mut top = R::splat(0.0);
        for op in &self.ops {
            match op {
                Op::Leaf(leaf) => {
                    below[held] = top;
                    held += 1;
                    top = leaf.distance(point);
                }
                Op::Operator(operator) => {
                    held -= 1;
                    top = operator.distance(below[held], top);
                }
                Op::Displace(displacement) => top = displacement.distance(top, point),
                Op::Enter(placement) => {
                    outer[entered] = point;
                    entered += 1;
                    point = placement.enter(point);
                }
                Op::Leave(scale) => {
                    entered -= 1;
                    point = outer[entered];
                    top = top * R::splat(*scale);
                }
            }
        }
        top
    }
}

/// What a walk over the steps finds out about the whole.
struct Summary {
    bounds: Aabb,
    reach: f32,
    level: Option<f32>,
}

impl Summary {
    fn of(ops: &[Op]) -> Self {
        let mut margins = margins(ops);
        let mut boxes: Vec<Aabb> = Vec::new();
        let mut placements: Vec<(transform::Placement, f32)> = Vec::new();
        let (mut scale, mut reach, mut level) = (1.0_f32, 0.0_f32, None);
        for op in ops {
            let found = match op {
                Op::Leaf(leaf) => {
                    reach = reach.max(leaf.reach() * scale);
                    let here = leaf.level().map(|level| level * scale);
                    level = level.map_or(here, |other: f32| Some(here.map_or(other, |here| here.max(other))));
                    leaf.bounds(margins.pop().expect("every leaf has a margin"))
                }
                Op::Operator(operator) => {
                    let b = boxes.pop().expect("an operator has two operands");
                    let a = boxes.pop().expect("an operator has two operands");
                    operator.bounds(a, b)
                }
                Op::Displace(displacement) => {
                    reach = reach.max(displacement.reach() * scale);
                    continue;
                }
                Op::Enter(placement) => {
                    placements.push((*placement, scale));
                    reach = reach.max(placement.reach() * scale);
                    scale *= placement.scale;
                    continue;
                }
                Op::Leave(_) => {
                    let (placement, outer) = placements.pop().expect("every Leave has its Enter");
                    scale = outer;
                    placement.bounds(boxes.pop().expect("a placement has a child"))
                }
            };
            boxes.push(found);
        }
        let bounds = boxes.pop().unwrap_or(Aabb::EMPTY);
        Self { bounds: if bounds.is_empty() { Aabb::EMPTY } else { bounds }, reach, level }
    }
}

/// The value of each leaf, the last one first, up to which it matters for where the whole is not positive: from the
/// last step back to the first, what each operator needs of its operands.
fn margins(ops: &[Op]) -> Vec<f32> {
    let (mut pending, mut margins) = (vec![0.0_f32], Vec::new());
    for op in ops.iter().rev() {
        match op {
            Op::Leaf(_) => margins.extend(pending.pop()),
            Op::Operator(operator) => {
                if let Some(margin) = pending.pop() {
                    pending.extend([operator.margin(margin); 2]);
                }
            }
            Op::Displace(displacement) => {
                if let Some(margin) = pending.last_mut() {
                    *margin += displacement.reach();
                }
            }
            Op::Leave(scale) => {
                if let Some(margin) = pending.last_mut() {
                    *margin /= scale;
                }
            }
            Op::Enter(_) => {}
        }
    }
    margins
}
