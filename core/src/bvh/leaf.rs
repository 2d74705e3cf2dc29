//! Owns the triangles in the leaves of a tree: the watertight test, eight at a time.

use glam::Vec3;
use wide::f32x8;

/// Most triangles of a leaf.
pub(super) const LANES: usize = 8;

/// Numbers of a triangle: the coordinates of three corners.
const ROWS: usize = 9;

/// Corners in the order of the leaves.
///
/// Each leaf has nine rows as long as it has triangles: x of all first corners, y, z, then the second and the third
/// corners. A row is read as eight numbers; those beyond its end belong to the next row and count for nothing.
#[derive(Debug, Clone)]
pub(super) struct Leaves {
    rows: Vec<f32>,
}

impl Leaves {
    /// The corners of leaves, given as their triangles, in the order of the tree.
    pub(super) fn new<'a>(triangles: usize, leaves: impl Iterator<Item = &'a [[Vec3; 3]]>) -> Self {
        let mut rows = Vec::with_capacity(ROWS * triangles + LANES);
        for leaf in leaves {
            for corner in 0..3 {
                for axis in 0..3 {
                    rows.extend(leaf.iter().map(|triangle| triangle[corner][axis]));
                }
            }
        }
        rows.extend([0.0; LANES]);
        rows.shrink_to_fit();
        Self { rows }
    }

    /// Memory in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.rows.len() * size_of::<f32>()
    }

    /// Which triangles of a leaf the ray meets at `0 < t <= t_max`, as bits, and where.
    #[inline]
    pub(super) fn test(&self, first: u32, count: u32, ray: &Shear, t_max: f32) -> (u32, Met) {
        let (start, count) = (ROWS * first as usize, count as usize);
        let rows = &self.rows[start..start + (ROWS - 1) * count + LANES];
        let row = |corner: usize, axis: usize| {
            let at = (3 * corner + axis) * count;
            let mut lanes = [0.0; LANES];
            lanes.copy_from_slice(&rows[at..at + LANES]);
            f32x8::new(lanes)
        };
        let [kx, ky, kz] = ray.axes;
        let sheared: [[f32x8; 3]; 3] = std::array::from_fn(|corner| {
            let z = row(corner, kz) - ray.origin[2];
            let x = (row(corner, kx) - ray.origin[0]) - ray.scale[0] * z;
            let y = (row(corner, ky) - ray.origin[1]) - ray.scale[1] * z;
            [x, y, ray.scale[2] * z]
        });
        meet(sheared, count, t_max)
    }
}

/// Where a ray meets triangles; lanes without a hit mean nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Met {
    /// Distances in units of the ray's direction.
    pub(super) t: f32x8,
    /// Weights of the second corner.
    pub(super) v: f32x8,
    /// Weights of the third corner.
    pub(super) w: f32x8,
}

/// The test on sheared corners: the ray is the z axis.
#[inline]
fn meet([a, b, c]: [[f32x8; 3]; 3], count: usize, t_max: f32) -> (u32, Met) {
    // The sign of an edge function is exact or zero, because a product difference rounds monotonically.
    let mut u = c[0] * b[1] - c[1] * b[0];
    let mut v = a[0] * c[1] - a[1] * c[0];
    let mut w = b[0] * a[1] - b[1] * a[0];
    let zero = f32x8::splat(0.0);
    let lanes = (1_u32 << count) - 1;
    let unsure = (u.simd_eq(zero) | v.simd_eq(zero) | w.simd_eq(zero)).to_bitmask() & lanes;
    if unsure != 0 {
        [u, v, w] = edges_in_double(&[a, b, c], [u, v, w], unsure);
    }
    let negative = u.simd_lt(zero) | v.simd_lt(zero) | w.simd_lt(zero);
    let positive = u.simd_gt(zero) | v.simd_gt(zero) | w.simd_gt(zero);
    let determinant = u + v + w;
    let inverse = f32x8::splat(1.0) / determinant;
    let t = (u * a[2] + v * b[2] + w * c[2]) * inverse;
    // A determinant of 0 makes no number, or an infinite one, which is beyond every finite end.
    let within = t.simd_gt(zero) & t.simd_le(f32x8::splat(t_max)) & !determinant.simd_eq(zero);
    let hit = (within & !(negative & positive)).to_bitmask() & lanes;
    (hit, Met { t, v: v * inverse, w: w * inverse })
}

/// The edge functions of some lanes again, where single precision cannot tell the side; products of floats are exact in
/// double.
#[cold]
fn edges_in_double(corners: &[[f32x8; 3]; 3], single: [f32x8; 3], lanes: u32) -> [f32x8; 3] {
    let [a, b, c] = corners.each_ref().map(|corner| corner.map(f32x8::to_array));
    let mut edges = single.map(f32x8::to_array);
    for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
        let edge = |p: &[[f32; LANES]; 3], q: &[[f32; LANES]; 3]| {
            let [px, py, qx, qy] = [p[0], p[1], q[0], q[1]].map(|row| f64::from(row[lane]));
            (px * qy - py * qx) as f32
        };
        for (row, value) in edges.iter_mut().zip([edge(&c, &b), edge(&a, &c), edge(&b, &a)]) {
            row[lane] = value;
        }
    }
    edges.map(f32x8::new)
}

/// A ray, with the shear that turns it into the z axis (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle
/// Intersection").
#[derive(Debug, Clone, Copy)]
pub(super) struct Shear {
    axes: [usize; 3],
    /// Origin, in the order of `axes`.
    origin: [f32x8; 3],
    scale: [f32x8; 3],
}

impl Shear {
    /// Prepares a ray.
    #[expect(clippy::inline_always, reason = "once a ray, by many callers: 1.5 percent of all instructions")]
    #[inline(always)]
    pub(super) fn new(o: Vec3, d: Vec3) -> Self {
        let a = d.abs();
        let kz = if a.x > a.y {
            if a.x > a.z { 0 } else { 2 }
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let sz = 1.0 / d[kz];
        let scale = [d[kx] * sz, d[ky] * sz, sz].map(f32x8::splat);
        Self { axes: [kx, ky, kz], origin: [o[kx], o[ky], o[kz]].map(f32x8::splat), scale }
    }
}
