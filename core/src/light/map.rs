//! Owns choosing directions by the brightness of a map of longitude and latitude.

use crate::math::{sin_cos_turn, turn_of};
use glam::{Vec2, Vec3};
use std::f64::consts::{PI, TAU};

/// A density over directions, constant within the cells of a grid of longitude and latitude.
///
/// A cell's weight is the mean of the bilinearly interpolated brightness over the cell less the mean over the sphere,
/// but not less than 0. Within a cell directions are uniform per solid angle, so nothing is singular at the poles.
#[derive(Debug)]
pub(super) struct SphereMap {
    /// Width and height of the image in texels.
    size: [u32; 2],
    /// Width and height of a cell in texels; the last cell of a row or column may be smaller.
    step: [u32; 2],
    /// Cumulative probability of the rows of cells, from the top.
    rows: Vec<f32>,
    /// Cumulative probability of the cells within each row, row after row.
    cells: Vec<f32>,
    /// Where to look in `rows`, and in each row of `cells`, row after row.
    row_guide: Vec<u32>,
    guides: Vec<u32>,
    /// Cosine of the angle from the top at the upper edge of each row, and at the end.
    edges: Vec<f64>,
    mean: f32,
}

impl SphereMap {
    /// Most cells along a row and along a column: larger images share cells, so that the grid stays small.
    const MOST: [u32; 2] = [1024, 512];

    /// Where the brightness above the mean is less than this part of all, the map is as good as even, and the mean
    /// stays in.
    const EVEN: f64 = 1e-3;

    /// The density of an image by the brightness of its texels (columns from the left, rows from the top).
    pub(super) fn new(size: [u32; 2], brightness: impl Fn(u32, u32) -> f32) -> Self {
        let step = [0, 1].map(|axis| size[axis].div_ceil(Self::MOST[axis]));
        let [columns, rows] = [0, 1].map(|axis| size[axis].div_ceil(step[axis]) as usize);
        let edge =
            |row: usize| libm::cos(f64::from((row as u32 * step[1]).min(size[1])) / f64::from(size[1]) * PI);
        let edges: Vec<f64> = (0..=rows).map(edge).collect();
        let mut map = Self {
            size,
            step,
            rows: vec![0.0; rows],
            cells: Vec::new(),
            row_guide: Vec::new(),
            guides: Vec::new(),
            edges,
            mean: 0.0,
        };
        let mut weights = cell_weights(size, step, columns, brightness);
        let total = sum(&weights);
        let mean = total / (4.0 * PI);
        map.mean = mean as f32;
        let above: Vec<f32> = (0..weights.len())
            .map(|i| {
                (f64::from(weights[i]) - mean * map.solid_angle(i % columns, i / columns)).max(0.0) as f32
            })
            .collect();
        if sum(&above) > Self::EVEN * total {
            weights = above;
        }
        for (row, cells) in map.rows.iter_mut().zip(weights.chunks_mut(columns)) {
            *row = accumulate(cells) as f32;
        }
        accumulate(&mut map.rows);
        map.row_guide = guide(&map.rows);
        map.guides = weights.chunks(columns).flat_map(guide).collect();
        map.cells = weights;
        map
    }

    /// Mean brightness over the sphere.
    pub(super) fn mean(&self) -> f32 {
        self.mean
    }

    /// Solid angle of a cell.
    fn solid_angle(&self, column: usize, row: usize) -> f64 {
        let [left, right] = self.sides(column);
        (right - left) * (self.edges[row] - self.edges[row + 1])
    }

    /// Longitudes of a cell's sides.
    fn sides(&self, column: usize) -> [f64; 2] {
        let side = |column: usize| f64::from((column as u32 * self.step[0]).min(self.size[0]));
        [side(column), side(column + 1)].map(|texel| texel / f64::from(self.size[0]) * TAU)
    }

    /// The cumulative probabilities of the cells of a row.
    fn row(&self, row: usize) -> &[f32] {
        let columns = self.cells.len() / self.rows.len();
        &self.cells[row * columns..(row + 1) * columns]
    }

    /// A direction in the map's frame, its image coordinates, and its density per solid angle; `None` when the map is
    /// black.
    pub(super) fn sample(&self, u: Vec2) -> Option<(Vec3, Vec2, f32)> {
        let (row, down) = find(&self.rows, &self.row_guide, u.y)?;
        let length = self.guides.len() / self.rows.len();
        let (column, across) = find(self.row(row), &self.guides[row * length..(row + 1) * length], u.x)?;
        let cos = self.edges[row] + (self.edges[row + 1] - self.edges[row]) * down;
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt() as f32;
        let [left, right] = self.sides(column);
        let turn = ((left + (right - left) * across) / TAU) as f32;
        let (sin_phi, cos_phi) = sin_cos_turn(turn);
        let latitude = 2.0 * turn_of(sin, cos as f32);
        let direction = Vec3::new(sin * sin_phi, cos as f32, -sin * cos_phi);
        Some((direction, Vec2::new(turn, latitude), self.density(column, row)))
    }

    /// Density per solid angle of sampling the direction with these image coordinates.
    pub(super) fn pdf(&self, uv: Vec2) -> f32 {
        let texel = |axis: usize| ((uv[axis] * self.size[axis] as f32) as u32).min(self.size[axis] - 1);
        let [column, row] = [0, 1].map(|axis| (texel(axis) / self.step[axis]) as usize);
        self.density(column, row)
    }

    /// Density per solid angle within a cell.
    fn density(&self, column: usize, row: usize) -> f32 {
        let p = f64::from(width(&self.rows, row)) * f64::from(width(self.row(row), column));
        (p / self.solid_angle(column, row)) as f32
    }
}

/// Image coordinates of a direction in the map's frame: u to the right from −z over +x, v down from +y, 0 to 1.
pub(super) fn uv_of_direction(d: Vec3) -> Vec2 {
    let longitude = turn_of(d.x, -d.z);
    // By the arc tangent, which stays exact at the poles.
    let latitude = 2.0 * turn_of((d.x * d.x + d.z * d.z).sqrt(), d.y);
    Vec2::new(if longitude < 0.0 { longitude + 1.0 } else { longitude }, latitude)
}

/// The integral of the bilinearly interpolated brightness over each cell. Over the width of a texel the interpolation
/// has mean weights of 1/8, 6/8 and 1/8 for its neighbour, itself, and its other neighbour.
fn cell_weights(
    [width, height]: [u32; 2],
    step: [u32; 2],
    columns: usize,
    brightness: impl Fn(u32, u32) -> f32,
) -> Vec<f32> {
    let smooth = |a: f32, b: f32, c: f32| (a + c) * 0.125 + b * 0.75;
    let row = |y: u32| -> Vec<f32> {
        // Negative texels count as black; a limit keeps sums finite.
        let texels: Vec<f32> = (0..width).map(|x| brightness(x, y).clamp(0.0, 1e30)).collect();
        let at = |x: u32| texels[x as usize];
        (0..width).map(|x| smooth(at((x + width - 1) % width), at(x), at((x + 1) % width))).collect()
    };
    let mut weights = vec![0.0_f64; columns * height.div_ceil(step[1]) as usize];
    let (mut above, mut here) = (row(0), row(0));
    for y in 0..height {
        let below = if y + 1 < height { row(y + 1) } else { here.clone() };
        let edge = |y: u32| libm::cos(f64::from(y) / f64::from(height) * PI);
        let solid_angle = (edge(y) - edge(y + 1)) * TAU / f64::from(width);
        let first = (y / step[1]) as usize * columns;
        for x in 0..width as usize {
            let mean = smooth(above[x], here[x], below[x]);
            weights[first + x / step[0] as usize] += f64::from(mean) * solid_angle;
        }
        above = std::mem::replace(&mut here, below);
    }
    weights.into_iter().map(|w| w as f32).collect()
}

fn sum(weights: &[f32]) -> f64 {
    weights.iter().map(|w| f64::from(*w)).sum()
}

/// Turns weights into cumulative probabilities that end at 1, or are all 0; returns their sum.
fn accumulate(weights: &mut [f32]) -> f64 {
    let total = sum(weights);
    let last = weights.iter().rposition(|w| *w > 0.0).unwrap_or(weights.len());
    let mut so_far = 0.0;
    for (index, weight) in weights.iter_mut().enumerate() {
        so_far += f64::from(*weight);
        *weight = if index >= last {
            1.0
        } else if total > 0.0 {
            (so_far / total) as f32
        } else {
            0.0
        };
    }
    total
}

/// How many cumulative probabilities there are, on average, for an entry of their guide.
const GUIDED: usize = 4;

/// For even steps of `u` from 0 to 1, a power of two of them, and for 1: how many cumulative probabilities are not above.
/// A search may begin there and end at the next, in memory that lies together.
fn guide(cumulative: &[f32]) -> Vec<u32> {
    let steps = cumulative.len().div_ceil(GUIDED).next_power_of_two();
    let not_above = |step: usize| {
        let u = step as f32 / steps as f32;
        cumulative.partition_point(|c| *c <= u) as u32
    };
    (0..=steps).map(not_above).collect()
}

/// Where `u` falls among cumulative probabilities, and how far within; `None` when they are all 0.
fn find(cumulative: &[f32], guide: &[u32], u: f32) -> Option<(usize, f64)> {
    let steps = guide.len() - 1;
    // Exact, because the number of steps is a power of two.
    let step = ((u * steps as f32) as usize).min(steps - 1);
    let (from, to) = (guide[step] as usize, guide[step + 1] as usize);
    let index = from + cumulative[from..to].partition_point(|c| *c <= u);
    let end = *cumulative.get(index)?;
    let start = if index == 0 { 0.0 } else { cumulative[index - 1] };
    Some((index, f64::from(u - start) / f64::from(end - start)))
}

/// Probability of one of them.
fn width(cumulative: &[f32], index: usize) -> f32 {
    cumulative[index] - if index == 0 { 0.0 } else { cumulative[index - 1] }
}
