//! Owns what can be left out of a tape in a ball without changing a bit of the value there.
//!
//! A function with slope at most 1 is within the radius of its value in the middle of the ball. Where two operands are
//! so far apart that one of them decides everywhere (with a blend: by more than its width), the other does not matter
//! (Barbier et al. 2025, "Lipschitz Pruning"). On the way down from the root the values that can still matter narrow:
//! in a union nothing above the greatest value of a sibling does, so that of many solids only those stay that are among
//! the nearest somewhere in the ball, in whatever order they stand.
//!
//! Estimates whose slope is not proven never make others superfluous, and nothing is left out inside of what folds or
//! winds space.

use std::ops::Neg;

use super::node::{Operator, Space};
use super::real::Point;
use super::tape::Op;

/// A ball in the space of the tape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    pub(super) point: Point<f64>,
    pub(super) radius: f64,
    /// More than what rounding changes.
    pub(super) slack: f64,
}

/// Values from `low` to `high`.
#[derive(Debug, Clone, Copy)]
struct Span {
    low: f64,
    high: f64,
}

impl Span {
    const ALL: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
}

impl Neg for Span {
    type Output = Self;
    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

/// What is known of the value that a step leaves.
#[derive(Debug, Clone, Copy)]
struct Known {
    /// In the middle.
    value: f64,
    /// Everywhere in the ball.
    span: Span,
    /// The first step of those that make it.
    start: usize,
}

/// For each step whether it matters in the ball.
pub(super) fn what_matters(ops: &[&Op], ball: Ball) -> Vec<bool> {
    let known = walk(ops, ball);
    let mut matters = vec![true; ops.len()];
    // Steps whose value is needed where it lies in a span; outside of it only on which side.
    let mut pending = vec![(ops.len() - 1, Span::ALL)];
    while let Some((at, needed)) = pending.pop() {
        match ops[at] {
            Op::Displace(_) => pending.push((at - 1, Span::ALL)),
            Op::Leave(Space::Placement(place)) => {
                let scale = f64::from(place.scale);
                let inner = Span { low: needed.low / scale, high: needed.high / scale };
                pending.push((at - 1, inner));
            }
            Op::Operator(operator) => {
                let (b, a) = (at - 1, known[at - 1].start - 1);
                match decide(*operator, known[a].span, known[b].span, needed) {
                    Decision::First(needed) => {
                        matters[known[b].start..=at].fill(false);
                        pending.push((a, needed));
                    }
                    Decision::Second(needed) => {
                        matters[known[a].start..=a].fill(false);
                        matters[at] = false;
                        pending.push((b, needed));
                    }
                    Decision::Both(first, second) => pending.extend([(a, first), (b, second)]),
                }
            }
            Op::Leaf(_) | Op::Enter(_) | Op::Leave(_) => {}
        }
    }
    matters
}

/// Which operands of an operator matter, and where.
enum Decision {
    First(Span),
    Second(Span),
    Both(Span, Span),
}

fn decide(operator: Operator, a: Span, b: Span, needed: Span) -> Decision {
    let width = operator.width();
    match operator {
        Operator::Union | Operator::SmoothUnion(_) => lesser(a, b, needed, width),
        // The greater of two is the lesser of their negatives, with its sign turned.
        Operator::Intersection | Operator::SmoothIntersection(_) => match lesser(-a, -b, -needed, width) {
            Decision::First(needed) => Decision::First(-needed),
            Decision::Second(needed) => Decision::Second(-needed),
            Decision::Both(first, second) => Decision::Both(-first, -second),
        },
        Operator::Difference | Operator::SmoothDifference(_) => match lesser(-a, b, -needed, width) {
            Decision::First(needed) => Decision::First(-needed),
            Decision::Both(first, second) => Decision::Both(-first, second),
            // No operator makes the complement of a solid.
            Decision::Second(second) => Decision::Both(-needed_beside(b, -needed, width), second),
        },
    }
}

/// What matters of the lesser of two values, blended over a width `k`, where results above `needed.high` are not told
/// apart, and neither are those below `needed.low`.
fn lesser(a: Span, b: Span, needed: Span, k: f64) -> Decision {
    let (of_a, of_b) = (needed_beside(b, needed, k), needed_beside(a, needed, k));
    if a.low >= of_a.high || b.high <= needed.low {
        Decision::Second(needed)
    } else if b.low >= of_b.high || a.high <= needed.low {
        Decision::First(needed)
    } else {
        Decision::Both(of_a, of_b)
    }
}

/// Where a value is needed for the lesser of it and another.
///
/// A blend takes a quarter of `k` off at most: a result up to `high` has an operand up to `high + k / 4`. The greater
/// operand has a part in it only where it is less than `k` above the other.
fn needed_beside(other: Span, needed: Span, k: f64) -> Span {
    let least = needed.high + 0.25 * k;
    let beside = if other.low < least { other.high.min(least) + k } else { least };
    // Where the other is surely the lesser by more than the width, nothing is left to be needed.
    let high = if other.high + k < least { other.high + k } else { beside.max(least) };
    Span { low: needed.low, high: if high.is_nan() { f64::INFINITY } else { high } }
}

/// Evaluates in the middle of the ball.
fn walk(ops: &[&Op], ball: Ball) -> Vec<Known> {
    let mut here = ball;
    // Outside of each space: the ball, and the step that entered.
    let mut outer: Vec<(Ball, usize)> = Vec::new();
    let mut known: Vec<Known> = Vec::with_capacity(ops.len());
    for (at, op) in ops.iter().enumerate() {
        let top = at.checked_sub(1).map(|below| known[below]);
        let (value, start, proven) = match (op, top) {
            (Op::Leaf(leaf), _) => (leaf.distance(here.point), at, leaf.level().is_none()),
            (Op::Operator(operator), Some(b)) if b.start > 0 => {
                let a = known[b.start - 1];
                (operator.distance(a.value, b.value), a.start, a.is_proven() && b.is_proven())
            }
            (Op::Displace(displacement), Some(child)) => {
                (displacement.distance(child.value, here.point), child.start, child.is_proven())
            }
            (Op::Leave(space), Some(child)) => {
                let (ball, start) = outer.pop().unwrap_or((ball, 0));
                here = ball;
                (space.leave(child.value, here.point), start, child.is_proven())
            }
            (Op::Enter(space), _) => {
                outer.push((here, at));
                let scale = f64::from(space.scale());
                let point = space.enter(here.point);
                here = Ball { point, radius: here.radius / scale, slack: here.slack / scale };
                (0.0, at, true)
            }
            // A tape is made from a tree: there are no such steps.
            (Op::Operator(_) | Op::Displace(_) | Op::Leave(_), _) => (0.0, at, false),
        };
        let reach = here.radius + here.slack + 1e-5 * value.abs();
        let span = if proven { Span { low: value - reach, high: value + reach } } else { Span::ALL };
        known.push(Known { value, span, start });
    }
    known
}

impl Known {
    fn is_proven(&self) -> bool {
        self.span.high.is_finite()
    }
}
