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
use super::pace::ROUNDOFF;
use super::real::Point;
use super::tape::Op;

/// Most solids of a closed form: with more, marching wins, since it can leave out those that are elsewhere.
pub(super) const MAX_SOLIDS: usize = 16;

/// Times the rounding error of a number that a surface may be away from where it is meant to be.
const SLACK: f64 = 4.0;

/// Least slope between a ray and two surfaces for which what is between them is looked at.
const FLATTEST: f64 = 1.0 / 1024.0;

/// A tree as the pieces of a ray that are inside of its solids.
#[derive(Debug, Clone)]
pub(super) struct ClosedForm {
    solids: Vec<Placed>,
    steps: Vec<Step>,
    /// The spaces that solids are placed in, parents first; the first one is the object's.
    spaces: Vec<Placing>,
}

/// How a space lies in its parent, which is named by its index.
#[derive(Debug, Clone, Copy)]
struct Placing {
    frame: Frame,
    parent: usize,
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
        let object = Placing { frame: Frame::OBJECT, parent: 0 };
        let mut form = Self { solids: Vec::new(), steps: Vec::new(), spaces: vec![object] };
        let mut space = 0;
        for op in ops {
            match op {
                Op::Leaf(leaf) => {
                    form.solids.push(Placed::new(*leaf, form.spaces[space].frame, space)?);
                    form.steps.push(Step::Solid);
                }
                Op::Operator(operator) if operator.is_hard() => form.steps.push(Step::Operator(*operator)),
                Op::Enter(Space::Placement(placement)) => {
                    let frame = form.spaces[space].frame.enter(placement)?;
                    form.spaces.push(Placing { frame, parent: space });
                    space = form.spaces.len() - 1;
                }
                Op::Leave(Space::Placement(_)) => space = form.spaces[space].parent,
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
            5..=8 => self.walk::<16>(sdf, ray, stats),
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

    /// How far apart the surfaces of two solids may be near a point although they are meant to be one.
    ///
    /// Numbers are rounded where they are placed in a space that holds both; how that space is placed moves both alike.
    fn slack(&self, a: &Placed, b: &Placed, p: DVec3) -> f64 {
        let (mut a, mut b, mut reach) = (a.space, b.space, 0.0);
        while a != b {
            // Parents come first, so that the greater of two indices is no parent of the other.
            let inner = if a > b { &mut a } else { &mut b };
            let Placing { frame, parent } = self.spaces[*inner];
            reach += (frame.origin - self.spaces[parent].frame.origin).length_squared().sqrt();
            *inner = parent;
        }
        let away = (p - self.spaces[a].frame.origin).length_squared().sqrt();
        SLACK * f64::from(ROUNDOFF) * away.max(reach)
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
        let band = SLACK * f64::from(self.sdf.noise(start.as_vec3()));
        solid.distance(start).abs() <= band
            && solid.distance(self.ray.at(0.5 * (self.ray.from + crossing.at))).abs() <= band
            && self.value(start).abs() <= band
    }

    /// The value of the whole.
    fn value(&mut self, p: DVec3) -> f64 {
        self.stats.evaluations += 1;
        self.sdf.tape().distance(Point::new(p.x, p.y, p.z))
    }

    /// Whether what is between two crossings is there by rounding only: the gap between two solids that touch, or the
    /// skin that is left where one was cut off flush with the other's face.
    ///
    /// A single solid hides nothing, however thin: its two sides are rounded alike.
    fn is_hidden(&self, crossing: Crossing, after: Crossing) -> bool {
        if crossing.solid == after.solid {
            return false;
        }
        let [a, b] = [crossing, after].map(|it| &self.form.solids[usize::from(it.solid)]);
        let middle = self.ray.at(0.5 * (crossing.at + after.at));
        let slack = self.form.slack(a, b, middle);
        FLATTEST * (after.at - crossing.at) <= slack
            && a.distance(middle).abs() <= slack
            && b.distance(middle).abs() <= slack
    }
}
