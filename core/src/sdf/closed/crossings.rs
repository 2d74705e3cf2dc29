//! Owns what operators make of the pieces of a line that are inside of their operands.

use super::line::Span;
use crate::sdf::node::Operator;

/// Where a line crosses a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Crossing {
    /// Place on the line.
    pub(super) at: f64,
    /// The solid whose surface it is.
    pub(super) solid: u8,
}

/// A stack of lists of crossings, each in ascending order and in turns a way in and a way out.
///
/// `N` is twice the number of solids: every operator makes at most as many crossings as its operands have together.
#[derive(Debug)]
pub(super) struct Stack<const N: usize> {
    crossings: [Crossing; N],
    /// Where each list begins; the last one ends with `held`.
    starts: [u8; N],
    lists: usize,
    held: usize,
}

impl<const N: usize> Stack<N> {
    pub(super) fn new() -> Self {
        Self { crossings: [Crossing::default(); N], starts: [0; N], lists: 0, held: 0 }
    }

    /// Puts what a line has of a solid on top.
    #[inline]
    pub(super) fn push(&mut self, span: Option<Span>, solid: u8) {
        self.starts[self.lists] = self.held as u8;
        self.lists += 1;
        if let Some(span) = span {
            self.crossings[self.held] = Crossing { at: span.start, solid };
            self.crossings[self.held + 1] = Crossing { at: span.end, solid };
            self.held += 2;
        }
    }

    /// Makes one list of the two on top.
    pub(super) fn combine(&mut self, operator: Operator) {
        self.lists -= 1;
        let (first, second) =
            (usize::from(self.starts[self.lists - 1]), usize::from(self.starts[self.lists]));
        let (no_a, no_b) = (first == second, second == self.held);
        // Most lines miss most solids: then one list stays as it is, where it is.
        if no_a || no_b {
            if !operator.holds(!no_a, !no_b) {
                self.held = first;
            }
            return;
        }
        let (a, b) = (&self.crossings[first..second], &self.crossings[second..self.held]);
        let mut made = [Crossing::default(); N];
        let (mut i, mut j, mut count) = (0, 0, 0);
        let mut inside = false;
        while i < a.len() || j < b.len() {
            let next = match (a.get(i), b.get(j)) {
                (Some(a), Some(b)) if b.at < a.at => b,
                (Some(next), _) | (None, Some(next)) => next,
                (None, None) => break,
            };
            // All that happens at one place is one step: where two solids touch there is nothing between them.
            i += usize::from(a.get(i).is_some_and(|a| a.at <= next.at));
            j += usize::from(b.get(j).is_some_and(|b| b.at <= next.at));
            let now = operator.holds(i % 2 == 1, j % 2 == 1);
            if now != inside {
                made[count] = *next;
                count += 1;
                inside = now;
            }
        }
        self.crossings[first..first + count].copy_from_slice(&made[..count]);
        self.held = first + count;
    }

    /// The list at the bottom.
    pub(super) fn crossings(&self) -> &[Crossing] {
        &self.crossings[..self.held]
    }
}

#[cfg(test)]
mod tests {
    use super::{Span, Stack};
    use crate::sdf::node::Operator;

    /// Where what an operator makes of two lists of pieces begins and ends.
    fn made(operator: Operator, a: &[(f64, f64)], b: &[(f64, f64)]) -> Vec<f64> {
        let mut stack = Stack::<8>::new();
        for list in [a, b] {
            stack.push(list.first().map(|&(start, end)| Span { start, end }), 0);
            for &(start, end) in list.iter().skip(1) {
                stack.push(Some(Span { start, end }), 0);
                stack.combine(Operator::Union);
            }
        }
        stack.combine(operator);
        stack.crossings().iter().map(|crossing| crossing.at).collect()
    }

    #[test]
    fn what_touches_is_one_and_what_is_equal_cancels() {
        let (a, b) = ([(0.0, 1.0)], [(1.0, 2.0)]);
        for (a, b) in [(a, b), (b, a)] {
            assert_eq!(made(Operator::Union, &a, &b), [0.0, 2.0]);
            assert!(made(Operator::Intersection, &a, &b).is_empty());
            assert_eq!(made(Operator::Difference, &a, &b), [a[0].0, a[0].1]);
        }
        assert!(made(Operator::Difference, &a, &a).is_empty());
        assert_eq!(made(Operator::Union, &a, &a), [0.0, 1.0]);
        assert_eq!(made(Operator::Difference, &[(0.0, 2.0)], &b), [0.0, 1.0]);
    }

    #[test]
    fn lists_are_merged_in_order() {
        let (a, b) = ([(0.0, 4.0), (6.0, 7.0)], [(1.0, 2.0), (3.0, f64::INFINITY)]);
        assert_eq!(made(Operator::Difference, &a, &b), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(made(Operator::Intersection, &a, &b), [1.0, 2.0, 3.0, 4.0, 6.0, 7.0]);
        assert_eq!(made(Operator::Union, &a, &b), [0.0, f64::INFINITY]);
        assert_eq!(made(Operator::Difference, &a, &[]), [0.0, 4.0, 6.0, 7.0]);
        assert!(
            made(Operator::Intersection, &[], &b).is_empty()
                && made(Operator::Difference, &[], &b).is_empty()
        );
        assert_eq!(made(Operator::Union, &[], &a), [0.0, 4.0, 6.0, 7.0]);
    }
}
