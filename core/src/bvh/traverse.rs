//! Owns walking the tree, nearest child first.

use super::leaf::Shear;
use super::{Bvh, LEAF, range};
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
    #[expect(clippy::inline_always, reason = "once a ray, by many callers: 1.5 percent of all instructions")]
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let inverse = direction.to_array().map(reciprocal);
        Self {
            origin: origin.to_array().map(f32x8::splat),
            inverse: inverse.map(f32x8::splat),
            near: std::array::from_fn(|axis| 2 * axis + usize::from(inverse[axis].is_sign_negative())),
        }
    }
}

/// A ray prepared for trees: once for all that are in the same space.
#[derive(Debug, Clone, Copy)]
pub struct Cast {
    pub(super) boxes: RayBoxes,
    pub(super) shear: Shear,
}

impl Cast {
    /// Prepares a ray.
    #[expect(clippy::inline_always, reason = "once a ray, by many callers: 1.5 percent of all instructions")]
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { boxes: RayBoxes::new(origin, direction), shear: Shear::new(origin, direction) }
    }

    /// What the boxes of a tree are tested with.
    pub fn boxes(&self) -> &RayBoxes {
        &self.boxes
    }
}

/// 1/d, finite for d = ±0 so that 0 · (1/d) never makes NaN.
fn reciprocal(d: f32) -> f32 {
    let r = 1.0 / d;
    if r.is_finite() { r } else { f32::MAX.copysign(d) }
}

/// Entries for which there is room at once. Clearing that room takes time with every ray, so trees that need less get less.
const SHALLOW: usize = 40;
/// Seven a level of the wide tree, on any level that 2²⁸ primitives reach.
const DEEP: usize = 256;

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
        leaf: impl FnMut(u32, u32, &mut f32) -> bool,
    ) -> bool {
        if self.waiting + 1 < SHALLOW {
            self.walk::<SHALLOW>(ray, t_max, leaf)
        } else {
            self.walk::<DEEP>(ray, t_max, leaf)
        }
    }

    /// Whether `leaf(first_slot, count)` is true for any of the leaves that the ray meets before `t_max`, in no order: where
    /// one hit is as good as another, sorting costs more than it spares.
    #[inline]
    pub fn any(&self, ray: &RayBoxes, t_max: f32, leaf: impl FnMut(u32, u32) -> bool) -> bool {
        if self.waiting + 1 < SHALLOW {
            self.seek::<SHALLOW>(ray, t_max, leaf)
        } else {
            self.seek::<DEEP>(ray, t_max, leaf)
        }
    }

    #[inline]
    fn seek<const ROOM: usize>(
        &self,
        ray: &RayBoxes,
        t_max: f32,
        mut leaf: impl FnMut(u32, u32) -> bool,
    ) -> bool {
        let mut stack = [0_u32; ROOM];
        let mut depth = 0;
        let mut code = self.root;
        loop {
            if code & LEAF != 0 {
                let (first, count) = range(code);
                if leaf(first, count) {
                    return true;
                }
            } else {
                let (mut mask, _) = self.hit_children(code, ray, t_max);
                let children = &self.nodes[code as usize].child;
                while mask != 0 {
                    stack[depth] = children[mask.trailing_zeros() as usize & 7];
                    depth += 1;
                    mask &= mask - 1;
                }
            }
            if depth == 0 {
                return false;
            }
            depth -= 1;
            code = stack[depth];
        }
    }

    #[inline]
    fn walk<const ROOM: usize>(
        &self,
        ray: &RayBoxes,
        t_max: &mut f32,
        mut leaf: impl FnMut(u32, u32, &mut f32) -> bool,
    ) -> bool {
        let mut stack = [0_u64; ROOM];
        let mut depth = 0;
        let mut next = u64::from(self.root);
        loop {
            let (t, code) = (f32::from_bits((next >> 32) as u32), next as u32);
            let mut nearest = None;
            if t > *t_max {
                // Something nearer was hit since.
            } else if code & LEAF != 0 {
                let (first, count) = range(code);
                if leaf(first, count, t_max) {
                    return true;
                }
            } else {
                nearest = self.descend(code, ray, *t_max, (&mut stack, &mut depth));
            }
            if let Some(nearest) = nearest {
                next = nearest;
            } else if depth == 0 {
                return false;
            } else {
                depth -= 1;
                next = stack[depth];
            }
        }
    }

    /// Puts the children of a node that the ray enters on the stack, the nearest on top; `Some` is the nearest that need not
    /// go there.
    #[inline]
    fn descend(
        &self,
        node: u32,
        ray: &RayBoxes,
        t_max: f32,
        (stack, depth): (&mut [u64], &mut usize),
    ) -> Option<u64> {
        let (mut mask, entry) = self.hit_children(node, ray, t_max);
        let children = &self.nodes[node as usize].child;
        let bottom = *depth;
        let mut last = None;
        while mask != 0 {
            let i = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            if let Some(child) = last.replace(waiting(entry[i], children[i])) {
                *depth += insert(stack, bottom, *depth, child);
            }
        }
        let child = last?;
        if *depth > bottom && stack[*depth - 1] < child {
            // Not the nearest after all.
            *depth += insert(stack, bottom, *depth, child);
            return None;
        }
        Some(child)
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

/// A child as it waits: above its code the bits of the distance where the ray enters it, which is not negative, so that numbers
/// compare like distances.
#[inline]
fn waiting(t: f32, code: u32) -> u64 {
    u64::from(t.to_bits()) << 32 | u64::from(code)
}

/// Puts a child on the stack above `bottom`, where the nearest lies on top; 1, by which the stack has grown.
#[inline]
fn insert(stack: &mut [u64], bottom: usize, depth: usize, child: u64) -> usize {
    let mut at = depth;
    while at > bottom && stack[at - 1] < child {
        stack[at] = stack[at - 1];
        at -= 1;
    }
    stack[at] = child;
    1
}
