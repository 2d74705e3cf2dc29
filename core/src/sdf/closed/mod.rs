//! Owns objects that a ray meets by formula: unblended convex solids, and hard operators on them.
//!
//! A ray is inside of each solid along one piece at most, and a union, intersection or difference works on lists of
//! such pieces. Nothing is stepped through, so nothing is too thin to be found.

mod crossings;
mod line;
mod solid;

use glam::DVec3;

use self::crossings::{Crossing, Stack};
pub(super) use self::line::{Line, Span};
use self::solid::{Frame, Placed};
use super::march::MarchStats;
use super::node::{Operator, Space};
use super::object::Sdf;
use super::tape::Op;

/// Most solids of a closed form: with more, marching wins, since it can leave out those that are elsewhere.
pub(super) const MAX_SOLIDS: usize = 16;

/// How much longer than the rounding error of a value a piece of a ray may be that rounding hides: such pieces are
/// looked at where the surfaces on both sides are at least this flat to the ray, as a slope.
const FLATTEST: f64 = 1.0 / 1024.0;

/// A tree as the pieces of a ray that are inside of its solids.
#[derive(Debug, Clone)]
pub(super) struct ClosedForm {
    solids: Vec<Placed>,
    steps: Vec<Step>,
}

/// What to do with the stack of lists of crossings.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// Push those of the next solid.
    Solid,
    Operator(Operator),
}

/// A part of a ray in object space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) origin: DVec3,
    /// Unit vector.
    pub(super) dir: DVec3,
    /// Distance from the origin to where the part begins.
    pub(super) from: f64,
    /// Distance from the origin to where it ends; may be infinite.
    pub(super) to: f64,
}

impl Ray {
    fn at(&self, distance: f64) -> DVec3 {
        self.origin + self.dir * distance
    }
}

impl ClosedForm {
    /// The closed form of a tape, where it has one: at most [`MAX_SOLIDS`] convex solids, placements, and operators
    /// that do not blend.
    pub(super) fn of(ops: &[Op]) -> Option<Self> {
        let mut form = Self { solids: Vec::new(), steps: Vec::new() };
        let mut frames = vec![Frame::OBJECT];
        for op in ops {
            match op {
                Op::Leaf(leaf) => {
                    form.solids.push(Placed::new(*leaf, *frames.last()?)?);
                    form.steps.push(Step::Solid);
                }
                Op::Operator(operator) if operator.is_hard() => form.steps.push(Step::Operator(*operator)),
                Op::Enter(Space::Placement(placement)) => {
                    let inner = frames.last()?.enter(placement)?;
                    frames.push(inner);
                }
                Op::Leave(Space::Placement(_)) => {
                    frames.pop();
                }
                Op::Operator(_) | Op::Displace(_) | Op::Enter(_) | Op::Leave(_) => return None,
            }
        }
        (form.solids.len() <= MAX_SOLIDS).then_some(form)
    }

    /// Distance from the ray's origin to where it first comes in or out between `from` and `to`; both excluded are
    /// the place that it leaves, where it starts on a surface, and what rounding hides.
    pub(super) fn first_hit(&self, sdf: &Sdf, ray: &Ray, stats: &mut MarchStats) -> Option<f64> {
        if !ray.origin.is_finite() {
            return None;
        }
        // Little trees take little scratch: clearing it is part of every ray.
        match self.solids.len() {
            0..=1 => self.walk::<2>(sdf, ray, stats),
            2..=4 => self.walk::<8>(sdf, ray, stats),
            _ => self.walk::<{ 2 * MAX_SOLIDS }>(sdf, ray, stats),
        }
    }

    fn walk<const N: usize>(&self, sdf: &Sdf, ray: &Ray, stats: &mut MarchStats) -> Option<f64> {
        let mut stack = Stack::<N>::new();
        let mut solids = (0_u8..).zip(&self.solids);
        for step in &self.steps {
            match step {
                Step::Solid => {
                    let (index, solid) = solids.next()?;
                    stack.push(solid.span(ray.origin, ray.dir), index);
                }
                Step::Operator(operator) => stack.combine(*operator),
            }
        }
        Judge { form: self, sdf, ray, stats }.first(stack.crossings())
    }
}

/// Decides which crossing is the hit.
struct Judge<'a> {
    form: &'a ClosedForm,
    sdf: &'a Sdf,
    ray: &'a Ray,
    stats: &'a mut MarchStats,
}

impl Judge<'_> {
    fn first(&mut self, crossings: &[Crossing]) -> Option<f64> {
        let mut next = crossings.iter().position(|crossing| crossing.at > self.ray.from)?;
        while let Some(&crossing) = crossings.get(next) {
            if crossing.at > self.ray.to || !crossing.at.is_finite() {
                return None;
            }
            if self.is_left_behind(crossing) {
                next += 1;
            } else if crossings.get(next + 1).is_some_and(|&after| self.is_hidden(crossing, after)) {
                next += 2;
            } else {
                self.stats.brackets += 1;
                return Some(crossing.at);
            }
        }
        None
    }

    /// Whether the ray starts on the surface that it crosses here, and has not been clear of it in between.
    ///
    /// The start is known to its rounding only. A solid's value is convex along a line: where it is as good as 0 at
    /// the start, at the crossing and in the middle, it is so all the way. The whole must have a surface there, too.
    fn is_left_behind(&mut self, crossing: Crossing) -> bool {
        let solid = &self.form.solids[usize::from(crossing.solid)];
        let start = self.ray.at(self.ray.from);
        let band = self.band(start);
        solid.distance(start).abs() <= band
            && solid.distance(self.ray.at(0.5 * (self.ray.from + crossing.at))).abs() <= band
            && self.value(start).abs() <= band
    }

    /// Whether what is between two crossings is there by rounding only: the gap between two solids that touch, or the
    /// skin that is left where one was cut off flush with the other's face.
    ///
    /// A single solid hides nothing, however thin: its two sides are rounded alike.
    fn is_hidden(&mut self, crossing: Crossing, after: Crossing) -> bool {
        let middle = self.ray.at(0.5 * (crossing.at + after.at));
        let band = self.band(middle);
        crossing.solid != after.solid
            && FLATTEST * (after.at - crossing.at) <= 2.0 * band
            && self.value(middle).abs() <= band
    }

    /// Values that may as well be 0 near a point: a few times the error of a value in f32.
    fn band(&self, p: DVec3) -> f64 {
        4.0 * f64::from(self.sdf.noise(p.as_vec3()))
    }

    fn value(&mut self, p: DVec3) -> f64 {
        self.stats.evaluations += 1;
        self.sdf.tape().distance(super::Point::new(p.x, p.y, p.z))
    }
}
