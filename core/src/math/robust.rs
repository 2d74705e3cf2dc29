//! Owns error bounds of floating-point geometry and the offsets that keep rays off the surface they leave.

use glam::Vec3;

/// Bound of the relative error of `n` roundings, `nε/(1−nε)` with `ε = 2⁻²⁴` (pbrt-v4 section 6.8.1).
#[inline]
pub const fn gamma(n: u32) -> f32 {
    const HALF_ULP: f32 = f32::EPSILON * 0.5;
    let ne = n as f32 * HALF_ULP;
    ne / (1.0 - ne)
}

/// The next float of `x` in the direction of the sign of `toward`.
#[inline]
pub fn next_away(x: f32, toward: f32) -> f32 {
    if toward > 0.0 {
        x.next_up()
    } else if toward < 0.0 {
        x.next_down()
    } else {
        x
    }
}

/// The bound of a coordinate's error is never below that of the largest coordinate: a coordinate that happens to be
/// exact, 0 say, takes part in sums with the others where the point is used.
#[inline]
pub fn even_error(error: Vec3) -> Vec3 {
    Vec3::splat(error.max_element())
}

/// Moves a hit point off its surface to the side that `w` points to, by no more than its error bound asks for.
///
/// `error` bounds the absolute error of `p` per coordinate, `n` is the geometric normal
/// (pbrt-v4 section 6.8.6, `OffsetRayOrigin`).
#[inline]
pub fn offset_origin(p: Vec3, error: Vec3, n: Vec3, w: Vec3) -> Vec3 {
    let distance = n.abs().dot(error);
    let offset = n * if w.dot(n) < 0.0 { -distance } else { distance };
    let moved = p + offset;
    Vec3::new(next_away(moved.x, offset.x), next_away(moved.y, offset.y), next_away(moved.z, offset.z))
}
