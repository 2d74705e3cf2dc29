//! Owns flat tapes: a tree of distance functions as a list of steps for a small stack machine.

use crate::math::Aabb;

use super::error::SdfError;
use super::node::{Cuboid, Displacement, Leaf, Operator, Space, transform};
use super::real::{Point, Real};

/// One step of a tape. Leaves push a value; operators pop two values and push one; [`Op::Displace`] changes the value
/// on top; [`Op::Enter`] changes the point
/// that leaves see until the matching [`Op::Leave`].
#[derive(Debug, Clone, Copy)]
pub(super) enum Op {
    Leaf(Leaf),
    Operator(Operator),
    Displace(Displacement),
    Enter(Space),
    /// Back to the parent's space.
    Leave(Space),
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
    ///
    /// # Errors
    /// A child that its space does not suit.
    pub(super) fn new(mut ops: Vec<Op>, nodes: usize, depth: usize) -> Result<Self, SdfError> {
        let summary = Summary::of(&mut ops)?;
        Ok(Self { ops, depth, nodes, bounds: summary.bounds, reach: summary.reach, level: summary.level })
    }

    /// The steps, in the order in which they are taken.
    pub(super) fn ops(&self) -> &[Op] {
        &self.ops
    }

    /// Nodes of the tree that this tape was made from.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// The tape of what is inside of a box.
    ///
    /// # Errors
    /// None but those of [`Tape::new`].
    pub(super) fn cut(mut self, to: Aabb) -> Result<Self, SdfError> {
        let half = Cuboid::from_half(to.size() * 0.5);
        let place = Space::Placement(transform::Placement::at(to.center()));
        self.ops.extend([
            Op::Enter(place),
            Op::Leaf(Leaf::Cuboid(half)),
            Op::Leave(place),
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
        self.of_steps(self.ops.iter(), p)
    }

    /// The value that some of the steps make.
    #[inline]
    pub(super) fn of_list<R: Real>(&self, steps: &[u32], p: Point<R>) -> R {
        self.of_steps(steps.iter().map(|&step| &self.ops[step as usize]), p)
    }

    #[inline]
    fn of_steps<'a, R: Real>(&self, ops: impl Iterator<Item = &'a Op>, p: Point<R>) -> R {
        // Small trees take small scratch: clearing it is part of every evaluation.
        match self.depth {
            0..=4 => run::<R, 4>(ops, p),
            5..=16 => run::<R, 16>(ops, p),
            _ => run::<R, MAX_DEPTH>(ops, p),
        }
    }
}

/// The stack machine.
#[inline]
fn run<'a, R: Real, const DEPTH: usize>(ops: impl Iterator<Item = &'a Op>, p: Point<R>) -> R {
    let mut point = p;
    let mut outer = [p; DEPTH];
    let mut entered = 0;
    let mut below = [R::splat(0.0); DEPTH];
    let mut held = 0;
    // The newest value stays in a register; `below` holds the ones under it. The first push stores a filler.
    let mut top = R::splat(0.0);
    for op in ops {
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
            Op::Enter(space) => {
                outer[entered] = point;
                entered += 1;
                point = space.enter(point);
            }
            Op::Leave(space) => {
                entered -= 1;
                point = outer[entered];
                top = space.leave(top, point);
            }
        }
    }
    top
}

/// What a walk over the steps finds out about the whole.
struct Summary {
    bounds: Aabb,
    reach: f32,
    level: Option<f32>,
}

impl Summary {
    /// Walks the steps, and fits spaces to what is in them.
    fn of(ops: &mut [Op]) -> Result<Self, SdfError> {
        let mut margins = margins(ops);
        let mut boxes: Vec<Aabb> = Vec::new();
        let mut scales: Vec<f32> = Vec::new();
        let (mut scale, mut reach, mut level) = (1.0_f32, 0.0_f32, None::<f32>);
        for op in ops {
            let found = match op {
                Op::Leaf(leaf) => {
                    reach = reach.max(leaf.reach() * scale);
                    if let Some(here) = leaf.level() {
                        level = Some(level.unwrap_or(0.0).max(here * scale));
                    }
                    leaf.bounds(pop(&mut margins))
                }
                Op::Operator(operator) => {
                    let (b, a) = (pop(&mut boxes), pop(&mut boxes));
                    operator.bounds(a, b)
                }
                Op::Displace(displacement) => {
                    reach = reach.max(displacement.reach() * scale);
                    continue;
                }
                Op::Enter(space) => {
                    scales.push(scale);
                    reach = reach.max(space.reach() * scale);
                    scale *= space.scale();
                    continue;
                }
                Op::Leave(space) => {
                    scale = pop(&mut scales);
                    let hull = pop(&mut boxes);
                    *space = space.around(hull)?;
                    space.bounds(hull, pop(&mut margins))
                }
            };
            boxes.push(found);
        }
        let bounds = boxes.pop().unwrap_or(Aabb::EMPTY);
        Ok(Self { bounds: if bounds.is_empty() { Aabb::EMPTY } else { bounds }, reach, level })
    }
}

/// What a step finds on a stack.
fn pop<T>(stack: &mut Vec<T>) -> T {
    stack.pop().expect("the steps were made from a tree")
}

/// The value of each leaf and space, the last one first, up to which it matters for where the whole is not positive:
/// from the last step back to the first, what each step needs of what is below it.
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
            Op::Leave(space) => {
                if let Some(margin) = pending.last_mut() {
                    margins.push(*margin);
                    *margin = space.margin(*margin);
                }
            }
            Op::Enter(_) => {}
        }
    }
    margins
}
