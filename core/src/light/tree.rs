//! Owns the tree over many lights: from the root down, the brighter half as seen from the receiver is likelier
//! (Conty Estevez and Kulla 2018).

use super::Receiver;
use super::emitter::{Ball, Emitter};
use glam::Vec3;

/// A binary tree over the lights at a finite distance that shine at all.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    /// The root first; the children of a node stand side by side.
    nodes: Vec<Node>,
    /// The way to each light, from the lowest bit: 1 is the second child. `None` for lights that are not in the tree.
    trails: Vec<Option<u64>>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    ball: Ball,
    below: Below,
}

#[derive(Debug, Clone, Copy)]
enum Below {
    /// Number of the first child.
    Children(u32),
    /// Number of the light.
    Light(u32),
}

/// A receiver that looks at the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a, F> {
    /// The receiver.
    pub(super) from: &'a Receiver,
    /// Squared distance below which lights do not gain weight.
    pub(super) nearest2: f32,
    /// What a single light (by number) might bring.
    pub(super) of_light: F,
}

/// A light on its way into the tree.
#[derive(Debug, Clone, Copy)]
struct Item {
    emitter: Emitter,
    light: u32,
}

impl Tree {
    /// Places along an axis at which a set of lights may be split, plus 1.
    const BUCKETS: usize = 12;

    /// From this depth on sets are halved by number, so that a trail has bits enough: 40 and the binary logarithm of
    /// their number is less than 64.
    const BY_COST: u32 = 40;

    /// The tree over the emitters that there are; `None` stands for lights that are not in it.
    pub(super) fn new(emitters: &[Option<Emitter>]) -> Self {
        let mut items: Vec<Item> = (0..)
            .zip(emitters)
            .filter_map(|(light, emitter)| emitter.map(|emitter| Item { emitter, light }))
            .filter(|item| item.emitter.intensity > 0.0 && item.emitter.bounds.is_finite())
            .collect();
        let mut tree = Self { nodes: Vec::new(), trails: vec![None; emitters.len()] };
        if let Some(first) = items.first() {
            tree.nodes.reserve_exact(items.len() * 2 - 1);
            tree.nodes.push(Node { ball: Ball::new(&first.emitter), below: Below::Light(first.light) });
            tree.build(&mut items, 0, 0, 0);
        }
        tree
    }

    fn build(&mut self, items: &mut [Item], node: usize, trail: u64, depth: u32) {
        let whole = union(items);
        self.nodes[node].ball = Ball::new(&whole);
        if let [item] = items {
            self.nodes[node].below = Below::Light(item.light);
            self.trails[item.light as usize] = Some(trail);
            return;
        }
        let first = self.nodes.len();
        self.nodes[node].below = Below::Children(first as u32);
        self.nodes.extend([self.nodes[node]; 2]);
        let middle = split(items, depth < Self::BY_COST);
        let (left, right) = items.split_at_mut(middle);
        self.build(left, first, trail, depth + 1);
        self.build(right, first + 1, trail | 1 << depth, depth + 1);
    }

    /// What all lights together might bring.
    pub(super) fn importance<F: Fn(usize) -> f32>(&self, view: &View<'_, F>) -> f32 {
        self.nodes.first().map_or(0.0, |root| root.importance(view))
    }

    /// The probability of the first of two children; `None` when neither brings anything.
    #[inline]
    fn first_share<F: Fn(usize) -> f32>(&self, first: u32, view: &View<'_, F>) -> Option<f32> {
        let weight = |i: u32| self.nodes[i as usize].importance(view);
        let (a, b) = (weight(first), weight(first + 1));
        let share = a / (a + b);
        share.is_finite().then_some(share)
    }

    /// Walks down by `u` in [0, 1): the light and its probability.
    pub(super) fn choose<F: Fn(usize) -> f32>(&self, view: &View<'_, F>, mut u: f64) -> Option<(usize, f32)> {
        let mut pdf = 1.0;
        let mut node = self.nodes.first()?;
        loop {
            let first = match node.below {
                Below::Light(light) => return Some((light as usize, pdf)),
                Below::Children(first) => first,
            };
            let share = self.first_share(first, view)?;
            let second = u >= f64::from(share);
            (u, pdf) = if second {
                ((u - f64::from(share)) / (1.0 - f64::from(share)), pdf * (1.0 - share))
            } else {
                (u / f64::from(share), pdf * share)
            };
            // Rounding must not make it 1, which is beyond every share.
            u = u.min(1.0 - f64::EPSILON);
            node = &self.nodes[first as usize + usize::from(second)];
        }
    }

    /// Probability with which [`Tree::choose`] takes a light: the same walk, along its trail.
    pub(super) fn choice_pdf<F: Fn(usize) -> f32>(&self, view: &View<'_, F>, light: usize) -> f32 {
        let Some(mut trail) = self.trails[light] else { return 0.0 };
        let mut pdf = 1.0;
        let mut node = &self.nodes[0];
        while let Below::Children(first) = node.below {
            let Some(share) = self.first_share(first, view) else { return 0.0 };
            pdf *= if trail & 1 == 1 { 1.0 - share } else { share };
            if pdf == 0.0 {
                return 0.0;
            }
            node = &self.nodes[first as usize + (trail & 1) as usize];
            trail >>= 1;
        }
        pdf
    }
}

impl Node {
    #[inline]
    fn importance<F: Fn(usize) -> f32>(&self, view: &View<'_, F>) -> f32 {
        match self.below {
            Below::Light(light) => (view.of_light)(light as usize),
            Below::Children(_) => self.ball.importance(view.from, view.nearest2),
        }
    }
}

fn union(items: &[Item]) -> Emitter {
    items[1..].iter().fold(items[0].emitter, |sum, item| sum.union(&item.emitter))
}

/// Orders two or more items so that the first ones make one half and the others the other: their number.
fn split(items: &mut [Item], by_cost: bool) -> usize {
    let (low, high) = items.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), item| {
        let center = item.emitter.bounds.center();
        (low.min(center), high.max(center))
    });
    let best = if by_cost { best_plane(items, low, high) } else { None };
    let Some((axis, last)) = best else { return items.len() / 2 };
    items.sort_by_key(|item| bucket(item, axis, low, high) > last);
    let middle = items.partition_point(|item| bucket(item, axis, low, high) <= last);
    // Centres so far apart that their distance overflows all share a bucket.
    if middle == 0 || middle == items.len() { items.len() / 2 } else { middle }
}

/// Which part of the extent of all centres an item's centre is in.
fn bucket(item: &Item, axis: usize, low: Vec3, high: Vec3) -> usize {
    let along = (item.emitter.bounds.center()[axis] - low[axis]) / (high[axis] - low[axis]);
    ((along * Tree::BUCKETS as f32) as usize).min(Tree::BUCKETS - 1)
}

/// The axis and the last bucket of the first half that cost least; `None` when all centres are the same.
fn best_plane(items: &[Item], low: Vec3, high: Vec3) -> Option<(usize, usize)> {
    let size = high - low;
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
        let mut buckets: [Option<Emitter>; Tree::BUCKETS] = [None; Tree::BUCKETS];
        for item in items {
            let sum = &mut buckets[bucket(item, axis, low, high)];
            *sum = join(*sum, Some(item.emitter));
        }
        // Costs of everything after each plane, from the last one down.
        let mut after = [0.0; Tree::BUCKETS];
        let mut sum = None;
        for i in (1..Tree::BUCKETS).rev() {
            sum = join(sum, buckets[i]);
            after[i - 1] = sum.as_ref().map_or(0.0, Emitter::cost);
        }
        // Long thin halves are worse than their cost says.
        let thin = f64::from(size.max_element() / size[axis]);
        let mut sum = None;
        for (i, after) in after.iter().enumerate().take(Tree::BUCKETS - 1) {
            sum = join(sum, buckets[i]);
            let cost = thin * (sum.as_ref().map_or(0.0, Emitter::cost) + after);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    best.map(|(_, axis, last)| (axis, last))
}

fn join(a: Option<Emitter>, b: Option<Emitter>) -> Option<Emitter> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}
