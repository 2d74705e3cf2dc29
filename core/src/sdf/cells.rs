//! Owns which steps of a tape matter where: a grid of cells over the object, each with a short list.

use crate::math::Aabb;

use glam::{DVec3, Vec3};
use wide::{bytemuck, f32x8, i32x8, u32x8};

use super::prune;
use super::real::Point;
use super::tape::{Op, Tape};

/// Trees with fewer solids are evaluated whole: eight lanes are in several cells at a time, and each takes its own list.
/// One list of a hundred steps for all of them is no slower.
const FEWEST_LEAVES: usize = 32;

/// Most often that the box around an object is halved.
const MOST_HALVINGS: u32 = 16;

/// Most steps that making the lists may take, so that the time for it has a bound where nothing can be left out.
const BUDGET: usize = 16_000_000;

/// A grid of cells over an object, each with the steps that can matter in it ([`prune`]).
#[derive(Debug, Clone)]
pub(super) struct Cells {
    bounds: Aabb,
    /// Cells along each axis.
    count: [u32; 3],
    /// Cells per unit of length along each axis.
    scale: Vec3,
    /// Where in `steps` the list of a cell begins and ends.
    lists: Vec<[u32; 2]>,
    /// Lists of steps of the tape.
    steps: Vec<u32>,
    /// Steps of the tape.
    whole: usize,
}

/// How far out of its grid, in cells, a place is still in the outermost cell.
const BEYOND: f32 = 1e-3;

/// The cell of a place outside of the grid, where all steps matter.
pub(super) const EVERYWHERE: u32 = u32::MAX;

impl Cells {
    /// The cells of an object within bounds; `None` where the tree is too small for them to pay.
    pub(super) fn new(tape: &Tape, bounds: Aabb) -> Option<Self> {
        let leaves = tape.ops().iter().filter(|op| matches!(op, Op::Leaf(_))).count();
        if leaves < FEWEST_LEAVES || !bounds.is_finite() || bounds.size().min_element() <= 0.0 {
            return None;
        }
        let halvings = (leaves.ilog2() + 7).min(MOST_HALVINGS);
        let axes = halving_axes(bounds.size(), halvings);
        let count = [0, 1, 2].map(|axis| 1 << axes.iter().filter(|&&halved| halved == axis).count());
        let scale = Vec3::from_array(count.map(|n: u32| n as f32)) / bounds.size();
        let lists = vec![[0; 2]; count.iter().product::<u32>() as usize];
        let cells = Self { bounds, count, scale, lists, steps: Vec::new(), whole: tape.ops().len() };
        let mut maker = Maker { tape, axes, cells };
        let all: Vec<u32> = (0..tape.ops().len() as u32).collect();
        maker.fill(&all, [[0; 3], count], 0, BUDGET);
        maker.cells.scale.is_finite().then_some(maker.cells)
    }

    /// The steps of a cell.
    #[inline]
    pub(super) fn list(&self, cell: u32) -> &[u32] {
        let [start, end] = self.lists[cell as usize];
        &self.steps[start as usize..end as usize]
    }

    /// How many steps a cell takes: all of them where that is [`EVERYWHERE`].
    #[inline]
    pub(super) fn cost(&self, cell: u32) -> usize {
        if cell == EVERYWHERE { self.whole } else { self.list(cell).len() }
    }

    /// Cells, and the mean number of steps in their lists.
    pub(super) fn extent(&self) -> (usize, f64) {
        let steps: u64 = self.lists.iter().map(|[start, end]| u64::from(end - start)).sum();
        (self.lists.len(), steps as f64 / self.lists.len() as f64)
    }

    /// The cells of eight points, [`EVERYWHERE`] outside of the grid.
    #[inline]
    pub(super) fn find(&self, p: Point<f32x8>) -> u32x8 {
        let mut cells = i32x8::splat(0);
        let mut inside = f32x8::splat(0.0).simd_eq(f32x8::splat(0.0));
        let mut stride = 1;
        for (axis, at) in [p.x, p.y, p.z].into_iter().enumerate() {
            let at = (at - f32x8::splat(self.bounds.min[axis])) * f32x8::splat(self.scale[axis]);
            let count = self.count[axis];
            // Rays begin on the faces of the box, with rounding. Written so that NaN is outside.
            inside &= at.simd_ge(f32x8::splat(-BEYOND)) & at.simd_le(f32x8::splat(count as f32 + BEYOND));
            let here = at.fast_max(f32x8::splat(0.0)).fast_min(f32x8::splat((count - 1) as f32));
            cells += here.trunc_int() * i32x8::splat(stride);
            stride *= count.cast_signed();
        }
        let cells: u32x8 = bytemuck::cast(cells);
        cells | !bytemuck::cast::<f32x8, u32x8>(inside)
    }
}

/// Which axis to halve at each level: always the longest.
fn halving_axes(size: Vec3, halvings: u32) -> Vec<usize> {
    let mut rest = size;
    let halve = |_| {
        let axis = (0..3).max_by(|&a, &b| rest[a].total_cmp(&rest[b])).unwrap_or(0);
        rest[axis] *= 0.5;
        axis
    };
    (0..halvings).map(halve).collect()
}

/// Makes the lists of all cells, from the whole box down.
struct Maker<'a> {
    tape: &'a Tape,
    axes: Vec<usize>,
    cells: Cells,
}

impl Maker<'_> {
    /// Fills a box of cells with what matters there of `steps`; takes the steps that it looks at from a budget, and
    /// returns what is left of it.
    fn fill(&mut self, steps: &[u32], [low, high]: [[u32; 3]; 2], level: usize, budget: usize) -> usize {
        let solids = steps.iter().filter(|&&i| matches!(self.tape.ops()[i as usize], Op::Leaf(_))).count();
        let cost = 2 * steps.len();
        if level == self.axes.len() || solids <= 1 || budget < cost {
            self.write(steps, low, high);
            return budget;
        }
        let axis = self.axes[level];
        let middle = low[axis].midpoint(high[axis]);
        let (mut left, mut right) = (high, low);
        (left[axis], right[axis]) = (middle, middle);
        let mut rest = budget - cost;
        for ([low, high], share) in [([low, left], rest / 2), ([right, high], 0)] {
            let list = self.prune(steps, low, high);
            // The first half of the box may take half of what there is, the second what is then left.
            let given = if share > 0 { share } else { rest };
            rest = rest - given + self.fill(&list, [low, high], level + 1, given);
        }
        rest
    }

    fn write(&mut self, steps: &[u32], low: [u32; 3], high: [u32; 3]) {
        let start = self.cells.steps.len() as u32;
        self.cells.steps.extend(steps);
        let list = [start, self.cells.steps.len() as u32];
        let [width, height, _] = self.cells.count;
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                let row = (z * height + y) * width;
                self.cells.lists[(row + low[0]) as usize..(row + high[0]) as usize].fill(list);
            }
        }
    }

    /// What matters of `steps` in the box of cells from `low` to `high`.
    fn prune(&self, steps: &[u32], low: [u32; 3], high: [u32; 3]) -> Vec<u32> {
        let corner = |at: [u32; 3]| {
            self.cells.bounds.min.as_dvec3()
                + DVec3::from_array(at.map(f64::from)) / self.cells.scale.as_dvec3()
        };
        let (low, high) = (corner(low), corner(high));
        let middle = (low + high) * 0.5;
        // A little more than the box: which cell a place is in is decided with rounding.
        let beyond = (high - low).max_element() * f64::from(BEYOND);
        let radius = 0.5 * (high - low).length() + 2.0 * beyond + 1e-6 * middle.abs().max_element();
        let slack = 1e-5 * (radius + middle.length() + f64::from(self.tape.reach()));
        let point = Point::new(middle.x, middle.y, middle.z);
        let ops: Vec<&Op> = steps.iter().map(|&step| &self.tape.ops()[step as usize]).collect();
        let matters = prune::what_matters(&ops, prune::Ball { point, radius, slack });
        steps.iter().zip(matters).filter(|(_, matters)| *matters).map(|(&step, _)| step).collect()
    }
}
