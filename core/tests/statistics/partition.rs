//! Owns cells of the sphere that are as small as a density is peaked: a tree of rectangles of equal shares of samples.
//!
//! Directions are points of a rectangle: 1 − z from 0 to 2, and the angle around z. It preserves areas, so densities per
//! solid angle stay what they are. The first cut is the horizon, where densities jump.

use super::quadrature::Rect;
use glam::Vec3;
use std::f64::consts::TAU;

/// 1 − z and the angle, in f64: near the poles 1 − z comes from x and y, which have digits left there.
pub(crate) fn to_plane(w: Vec3) -> [f64; 2] {
    let w = w.as_dvec3();
    let n = w.length();
    let h = (w.x * w.x + w.y * w.y) / (n * (n + w.z.abs()));
    let angle = libm::atan2(w.y, w.x);
    // Exactly at the horizon belongs to neither side; below is where no lobe of one side is.
    [if w.z > 0.0 { h.min(1.0) } else { 2.0 - h.min(1.0) }, if angle < 0.0 { angle + TAU } else { angle }]
}

/// The direction at a point of the rectangle.
pub(crate) fn to_sphere([t, angle]: [f64; 2]) -> Vec3 {
    let h = t.min(2.0 - t);
    let s = (h * (2.0 - h)).max(0.0).sqrt();
    let (sin, cos) = libm::sincos(angle);
    Vec3::new((s * cos) as f32, (s * sin) as f32, (1.0 - t) as f32)
}

/// Cosine of the directions nearest to the horizon.
const HAIR: f64 = 1e-7;

enum Node {
    Split { axis: usize, at: f64, children: [u32; 2] },
    Cell(u32),
}

/// How finely to cut.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grain {
    /// Most samples of a cell: of what is compared.
    pub(crate) cell: usize,
    /// Most samples of a leaf: of what is integrated. Lobes that hold fewer samples may be missed by the quadrature.
    pub(crate) leaf: usize,
}

/// The sphere in cells, each of some leaves.
pub(crate) struct Partition {
    nodes: Vec<Node>,
    leaves: Vec<(u32, Rect)>,
    cells: u32,
}

impl Partition {
    /// Cuts the sphere by these directions, at their medians.
    pub(crate) fn new(directions: &[Vec3], grain: Grain) -> Self {
        let mut points: Vec<[f64; 2]> = directions.iter().copied().map(to_plane).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let above = points.partition_point(|p| p[0] <= 1.0);
        let mut tree = Self { nodes: vec![Node::Cell(0)], leaves: Vec::new(), cells: 0 };
        let (upper, lower) = points.split_at_mut(above);
        // Rules have nodes on the edges: those at the horizon lie a hair off it.
        let [top, bottom] = [Rect([0.0..1.0 - HAIR, 0.0..TAU]), Rect([1.0 + HAIR..2.0, 0.0..TAU])];
        let children = [tree.grow(upper, &top, 0, None, grain), tree.grow(lower, &bottom, 0, None, grain)];
        tree.nodes[0] = Node::Split { axis: 0, at: 1.0, children };
        tree
    }

    fn grow(
        &mut self,
        points: &mut [[f64; 2]],
        rect: &Rect,
        axis: usize,
        cell: Option<u32>,
        grain: Grain,
    ) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node::Cell(cell.unwrap_or(self.cells)));
        let cell = if cell.is_none() && points.len() <= grain.cell {
            self.cells += 1;
            Some(self.cells - 1)
        } else {
            cell
        };
        let cut = if points.len() <= grain.leaf {
            None
        } else {
            [axis, 1 - axis].into_iter().find_map(|axis| Some((axis, median(points, axis, rect)?)))
        };
        let Some((axis, at)) = cut else {
            let cell = cell.unwrap_or_else(|| {
                self.cells += 1;
                self.cells - 1
            });
            self.nodes[node as usize] = Node::Cell(cell);
            self.leaves.push((cell, rect.clone()));
            return node;
        };
        points.sort_unstable_by(|a, b| a[axis].total_cmp(&b[axis]));
        let middle = points.partition_point(|p| p[axis] <= at);
        let (low, high) = points.split_at_mut(middle);
        let [below, above] = rect.split(axis, at);
        let children =
            [self.grow(low, &below, 1 - axis, cell, grain), self.grow(high, &above, 1 - axis, cell, grain)];
        if cell.is_none() {
            self.nodes[node as usize] = Node::Split { axis, at, children };
        }
        node
    }

    /// Number of cells.
    pub(crate) fn len(&self) -> usize {
        self.cells as usize
    }

    /// The cell of a direction.
    pub(crate) fn cell(&self, w: Vec3) -> usize {
        let point = to_plane(w);
        let mut node = 0;
        loop {
            match self.nodes[node] {
                Node::Cell(cell) => return cell as usize,
                Node::Split { axis, at, children } => {
                    node = children[usize::from(point[axis] > at)] as usize;
                }
            }
        }
    }

    /// The integral of a function of directions over each cell; its whole is about `size`.
    pub(crate) fn integrals(&self, f: &dyn Fn(Vec3) -> f64, size: f64) -> Vec<f64> {
        let tolerance = 0.003 * size / self.leaves.len() as f64;
        let mut sums = vec![0.0; self.len()];
        for (cell, rect) in &self.leaves {
            sums[*cell as usize] += rect.integral(&|p| f(to_sphere(p)), tolerance, 40);
        }
        sums
    }
}

/// The middle one of the points along an axis, where it cuts them and the rectangle in two.
fn median(points: &mut [[f64; 2]], axis: usize, rect: &Rect) -> Option<f64> {
    let middle = (points.len() - 1) / 2;
    let at = points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis])).1[axis];
    let most = points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    (at > rect.0[axis].start && at < rect.0[axis].end && at < most).then_some(at)
}

#[test]
fn the_plane_keeps_directions_and_areas() {
    for w in [
        Vec3::new(0.6, 0.0, 0.8),
        Vec3::new(1e-6, -2e-6, 1.0),
        Vec3::new(0.3, -0.4, -0.866_025_4),
        Vec3::new(0.0, 1.0, 1e-5),
    ] {
        let back = to_sphere(to_plane(w));
        assert!((back - w).abs().max_element() < 1e-6 * w.abs().max_element(), "{w} {back}");
        assert!(((back - w).x / w.x.max(1e-30)).abs() < 1e-5 || w.x <= 0.0, "{w} {back}");
    }
    let directions: Vec<Vec3> =
        (0_u16..4096).map(|i| to_sphere([f64::from(i) / 2048.0, f64::from(i % 61) / 10.0])).collect();
    let partition = Partition::new(&directions, Grain { cell: 64, leaf: 16 });
    let areas = partition.integrals(&|_| 1.0, 4.0 * std::f64::consts::PI);
    assert!(areas.iter().all(|a| *a > 0.0));
    assert!((areas.iter().sum::<f64>() / (2.0 * TAU) - 1.0).abs() < 1e-6);
}
