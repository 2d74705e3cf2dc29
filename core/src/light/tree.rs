//! Owns the tree over many lights: from the root down, what looks brighter to the receiver is likelier
//! (Conty Estevez and Kulla 2018, with eight children to a node: finer pictures of what lies below, weighed together).

use super::Receiver;
use super::emitter::{Balls, Emitter};
use glam::Vec3;
use std::cmp::Ordering;

/// Children of a node.
const WIDTH: usize = 8;

/// A tree over the lights at a finite distance that shine at all.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    /// The root first.
    nodes: Vec<Node>,
    /// The node and the lane in it of each light; `None` for lights that are not in the tree.
    places: Vec<Option<Place>>,
}

/// A child of a node.
#[derive(Debug, Clone, Copy)]
struct Place {
    node: u32,
    lane: u32,
}

#[derive(Debug, Clone)]
struct Node {
    balls: Balls,
    below: [Below; WIDTH],
    /// Whether some of the lights here are weighed one by one.
    exact: bool,
    /// Where it is in its parent; `None` of the root.
    parent: Option<Place>,
}

#[derive(Debug, Clone, Copy)]
enum Below {
    Nothing,
    /// Number of a node.
    Node(u32),
    /// Number of a light.
    Light(u32),
    /// Number of a light that is weighed by itself.
    Exact(u32),
}

/// A receiver that looks at the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a, F> {
    /// The receiver.
    pub(super) from: &'a Receiver,
    /// Squared distance below which lights do not gain weight.
    pub(super) nearest2: f32,
    /// What a light (by number) that is weighed by itself might bring.
    pub(super) exact: F,
}

/// A light on its way into the tree.
#[derive(Debug, Clone, Copy)]
struct Item {
    emitter: Emitter,
    light: u32,
    exact: bool,
}

impl Tree {
    /// Places along an axis at which a set of lights may be split, plus 1.
    const BUCKETS: usize = 12;

    /// From this depth on sets are halved by number, so that no arrangement of lights makes a deep tree.
    const BY_COST: u32 = 20;

    /// The tree over the emitters that there are; `None` stands for lights that are not in it. `exact` says which
    /// lights are weighed by themselves.
    pub(super) fn new(emitters: &[Option<Emitter>], exact: impl Fn(usize) -> bool) -> Self {
        let mut items: Vec<Item> = (0..)
            .zip(emitters)
            .filter_map(|(light, emitter)| {
                emitter.map(|emitter| Item { emitter, light, exact: exact(light as usize) })
            })
            .filter(|item| item.emitter.intensity > 0.0 && item.emitter.bounds.is_finite())
            .collect();
        let mut tree = Self { nodes: Vec::new(), places: vec![None; emitters.len()] };
        if !items.is_empty() {
            tree.build(&mut items, None, 0);
        }
        tree
    }

    /// Adds the node over one or more items and everything below it: its number.
    fn build(&mut self, items: &mut [Item], parent: Option<Place>, depth: u32) -> u32 {
        let number = self.nodes.len() as u32;
        // What fits into one node needs no halves.
        let mut groups: Vec<Group<'_>> = if items.len() <= WIDTH {
            items.chunks_mut(1).map(Group::new).collect()
        } else {
            vec![Group::new(items)]
        };
        while groups.len() < WIDTH {
            let largest = (0..groups.len())
                .filter(|&i| groups[i].items.len() > 1)
                .max_by(|&a, &b| groups[a].size.partial_cmp(&groups[b].size).unwrap_or(Ordering::Equal));
            let Some(largest) = largest else { break };
            let items = groups.swap_remove(largest).items;
            let middle = split(items, depth < Self::BY_COST);
            let (left, right) = items.split_at_mut(middle);
            groups.extend([Group::new(left), Group::new(right)]);
        }
        let pictures: Vec<Option<Emitter>> = groups.iter().map(|group| Some(group.whole)).collect();
        let below = [Below::Nothing; WIDTH];
        self.nodes.push(Node { balls: Balls::new(&pictures), below, exact: false, parent });
        for (lane, group) in groups.into_iter().enumerate() {
            let place = Place { node: number, lane: lane as u32 };
            let below = match group.items {
                [item] => {
                    self.places[item.light as usize] = Some(place);
                    if item.exact { Below::Exact(item.light) } else { Below::Light(item.light) }
                }
                items => Below::Node(self.build(items, Some(place), depth + 1)),
            };
            let node = &mut self.nodes[number as usize];
            node.exact |= matches!(below, Below::Exact(_));
            node.below[lane] = below;
        }
        number
    }

    /// The nodes that the receiver looks into together.
    pub(super) fn cut<F: Fn(usize) -> f32>(&self, view: &View<'_, F>) -> Cut {
        let mut cut = Cut { rows: [Row::default(); Cut::MOST], count: 0 };
        if !self.nodes.is_empty() {
            cut.open(self, 0, view);
        }
        while cut.count < Cut::MOST {
            let rows = &mut cut.rows[..cut.count];
            let total: f32 = rows.iter().map(|row| row.total).sum();
            let worst = rows.iter_mut().max_by(|a, b| a.worst.total_cmp(&b.worst));
            let Some(row) = worst.filter(|row| row.worst > Cut::GOOD * total) else { break };
            let lane = row.worst_lane as usize;
            let Below::Node(child) = self.nodes[row.node as usize].below[lane] else { break };
            row.weights[lane] = 0.0;
            row.urgency[lane] = 0.0;
            row.sum_up();
            cut.open(self, child, view);
        }
        cut
    }

    /// Walks down from the cut by `u` in [0, 1): the light and its probability.
    pub(super) fn choose<F: Fn(usize) -> f32>(
        &self,
        view: &View<'_, F>,
        cut: &Cut,
        u: f64,
    ) -> Option<(usize, f32)> {
        let rows = cut.rows();
        let lanes = rows.iter().flat_map(|row| row.weights);
        let (at, mut u, mut pdf) = pick(lanes, u, cut.total())?;
        let mut below = self.nodes[rows[at / WIDTH].node as usize].below[at % WIDTH];
        loop {
            match below {
                Below::Nothing => return None,
                Below::Light(light) | Below::Exact(light) => return Some((light as usize, pdf as f32)),
                Below::Node(number) => {
                    let node = &self.nodes[number as usize];
                    let weights = node.importance(view).0;
                    let lane;
                    let share;
                    (lane, u, share) = pick(weights.into_iter(), u, sum(&weights))?;
                    pdf *= share;
                    below = node.below[lane];
                }
            }
        }
    }

    /// Probability with which [`Tree::choose`] takes a light, but for roundings: the same walk, upwards.
    pub(super) fn choice_pdf<F: Fn(usize) -> f32>(&self, view: &View<'_, F>, cut: &Cut, light: usize) -> f32 {
        let mut pdf = 1.0;
        let mut place = self.places[light];
        while let Some(Place { node: number, lane }) = place {
            if let Some(row) = cut.rows().iter().find(|row| row.node == number) {
                let weight = f64::from(row.weights[lane as usize]);
                return if weight > 0.0 { (pdf * (weight / cut.total())) as f32 } else { 0.0 };
            }
            let node = &self.nodes[number as usize];
            let weights = node.importance(view).0;
            let weight = f64::from(weights[lane as usize]);
            if weight == 0.0 {
                return 0.0;
            }
            pdf *= weight / sum(&weights);
            place = node.parent;
        }
        0.0
    }
}

/// The nodes into which a receiver looks before it chooses: from the root down, always where the guess is coarsest for
/// what it weighs, so that what is near is looked at closely (the adaptive splitting of Conty Estevez and Kulla).
#[derive(Debug)]
pub(super) struct Cut {
    rows: [Row; Self::MOST],
    count: usize,
}

/// A node of a cut: what its children weigh; 0 for those that are nodes of the cut themselves.
#[derive(Debug, Clone, Copy, Default)]
struct Row {
    node: u32,
    weights: [f32; WIDTH],
    /// How coarse a guess each weight is, in units of weight; 0 of lights.
    urgency: [f32; WIDTH],
    total: f32,
    /// The greatest urgency, and whose it is.
    worst: f32,
    worst_lane: u32,
}

impl Cut {
    /// Most nodes in a cut.
    const MOST: usize = 8;

    /// Guesses that are coarse by less than this part of the total are good enough.
    const GOOD: f32 = 1.0 / 64.0;

    fn rows(&self) -> &[Row] {
        &self.rows[..self.count]
    }

    /// What all lights of the tree together might bring.
    pub(super) fn total(&self) -> f64 {
        self.rows().iter().flat_map(|row| row.weights).map(f64::from).sum()
    }

    fn open<F: Fn(usize) -> f32>(&mut self, tree: &Tree, number: u32, view: &View<'_, F>) {
        let node = &tree.nodes[number as usize];
        let (weights, coarse) = node.importance(view);
        let row = &mut self.rows[self.count];
        (row.node, row.weights) = (number, weights);
        for lane in 0..WIDTH {
            let inner = matches!(node.below[lane], Below::Node(_));
            row.urgency[lane] = if inner { weights[lane] * coarse[lane] } else { 0.0 };
        }
        row.sum_up();
        self.count += 1;
    }
}

impl Row {
    fn sum_up(&mut self) {
        self.total = self.weights.iter().sum();
        self.worst = 0.0;
        for (lane, urgency) in self.urgency.iter().enumerate() {
            if *urgency > self.worst {
                (self.worst, self.worst_lane) = (*urgency, lane as u32);
            }
        }
    }
}

impl Node {
    /// What each child might bring, and how coarse a guess that is.
    #[inline]
    fn importance<F: Fn(usize) -> f32>(&self, view: &View<'_, F>) -> ([f32; WIDTH], [f32; WIDTH]) {
        let (mut weights, coarse) = self.balls.importance(view.from, view.nearest2);
        if self.exact {
            for (weight, below) in weights.iter_mut().zip(&self.below) {
                if let Below::Exact(light) = below {
                    *weight = (view.exact)(*light as usize);
                }
            }
        }
        (weights, coarse)
    }
}

fn sum(weights: &[f32; WIDTH]) -> f64 {
    weights.iter().map(|w| f64::from(*w)).sum()
}

/// The weight at the part `u` of weights laid end to end: its number, where `u` falls within it (0 to 1), and its part
/// of the total. Never one of weight 0.
fn pick(weights: impl Iterator<Item = f32>, u: f64, total: f64) -> Option<(usize, f64, f64)> {
    let mut rest = u * total;
    let mut picked = None;
    for (index, weight) in weights.map(f64::from).enumerate() {
        if weight > 0.0 {
            // Rounding must not make it 1, which is beyond every weight.
            picked = Some((index, (rest / weight).min(1.0 - f64::EPSILON), weight / total));
            if rest < weight {
                break;
            }
            rest -= weight;
        }
    }
    picked
}

/// One or more items that may become a child.
#[derive(Debug)]
struct Group<'a> {
    items: &'a mut [Item],
    whole: Emitter,
    /// How urgent it is to split it.
    size: (f64, usize),
}

impl<'a> Group<'a> {
    fn new(items: &'a mut [Item]) -> Self {
        let whole = union(items);
        let size = (whole.cost(), items.len());
        Self { items, whole, size }
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
    let middle = partition(items, |item| bucket(item, axis, low, high) <= last);
    // Centres so far apart that their distance overflows all share a bucket.
    if middle == 0 || middle == items.len() { items.len() / 2 } else { middle }
}

/// Brings the items of the first half to the front: their number.
fn partition(items: &mut [Item], is_first: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for at in 0..items.len() {
        if is_first(&items[at]) {
            items.swap(middle, at);
            middle += 1;
        }
    }
    middle
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
