//! Owns walking the tree, nearest child first.

use super::{Bvh, LEAF, LEAF_SIZE_SHIFT, LEAF_START};
use crate::math::gamma;
use glam::Vec3;
use wide::f32x8;

/// A ray prepared for box tests.
#[derive(Debug, Clone, Copy)]
pub struct RayBoxes {
    origin: [f32x8; 3],
    inverse: [f32x8; 3],
    /// For each axis the row of a node's bounds that the ray meets first; the other is `row ^ 1`.
    near: [usize; 3],
}

impl RayBoxes {
    /// Prepares a ray.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let inverse = direction.to_array().map(reciprocal);
        Self {
            origin: origin.to_array().map(f32x8::splat),
            inverse: inverse.map(f32x8::splat),
            near: std::array::from_fn(|axis| 2 * axis + usize::from(inverse[axis].is_sign_negative())),
        }
    }
}

/// 1/d, finite for d = ±0 so that 0 · (1/d) never makes NaN.
fn reciprocal(d: f32) -> f32 {
    let r = 1.0 / d;
    if r.is_finite() { r } else { f32::MAX.copysign(d) }
}

/// Entries that can wait on the stack: seven a level of the wide tree, on any level that 2²⁸ primitives reach.
const STACK: usize = 256;

impl Bvh {
    /// Calls `leaf(first_slot, count, t_max)` for the leaves that the ray meets within `t_max`, nearer boxes first.
    ///
    /// `leaf` may lower `t_max`; returning true ends the walk, which then returns true.
    /// Boxes at exactly `t_max` are still visited, so that equal hits can be told apart by their number.
    #[inline]
    pub fn traverse(
        &self,
        ray: &RayBoxes,
        t_max: &mut f32,
        mut leaf: impl FnMut(u32, u32, &mut f32) -> bool,
    ) -> bool {
        let mut stack = [(0.0_f32, 0_u32); STACK];
        let mut depth = 1;
        stack[0] = (0.0, self.root);
        while depth > 0 {
            depth -= 1;
            let (t, code) = stack[depth];
            if t > *t_max {
                continue;
            }
            if code & LEAF != 0 {
                if leaf(code & LEAF_START, (code >> LEAF_SIZE_SHIFT & 7) + 1, t_max) {
                    return true;
                }
                continue;
            }
            let (mut mask, entry) = self.hit_children(code, ray, *t_max);
            let bottom = depth;
            let children = &self.nodes[code as usize].child;
            while mask != 0 {
                let i = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                // Insert so that the nearest lies on top.
                let mut at = depth;
                while at > bottom && stack[at - 1].0 < entry[i] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (entry[i], children[i]);
                depth += 1;
            }
        }
        false
    }

    /// Which children the ray enters before `t_max`, and where.
    #[inline]
    fn hit_children(&self, node: u32, ray: &RayBoxes, t_max: f32) -> (u32, [f32; 8]) {
        let bounds = &self.nodes[node as usize].bounds;
        let slab =
            |axis: usize, row: usize| (f32x8::from(bounds[row]) - ray.origin[axis]) * ray.inverse[axis];
        let near = |axis: usize| slab(axis, ray.near[axis]);
        let far = |axis: usize| slab(axis, ray.near[axis] ^ 1);
        let enter = near(0).fast_max(near(1)).fast_max(near(2)).fast_max(f32x8::splat(0.0));
        let widen = f32x8::splat(1.0 + 2.0 * gamma(3));
        let leave = (far(0).fast_min(far(1)).fast_min(far(2)) * widen).fast_min(f32x8::splat(t_max));
        (enter.simd_le(leave).to_bitmask(), enter.to_array())
    }
}
