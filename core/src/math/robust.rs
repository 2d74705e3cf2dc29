//! Owns error bounds of floating-point geometry and the offsets that keep rays off the surface they leave.

use glam::Vec3;

/// Bound of the relative error of `n` roundings, `nε/(1−nε)` with `ε = 2⁻²⁴` (pbrt-v4 section 6.8.1).
#[inline]
pub const fn gamma(n: u32) -> f32 {
    const HALF_ULP: f32 = f32::EPSILON * 0.5;
    let ne = n as f32 * HALF_ULP;
    ne / (1.0 - ne)
}

/// The error that a ray's start must be moved out of, from the bound of its coordinates' errors.
///
/// The ray-triangle test sums over all axes, so a coordinate that happens to be exact (a wall at 0) is as uncertain as
/// the largest one, and the test's own rounding of the distance, which is as large again, comes on top. The strict bound
/// of that rounding (pbrt-v4 section 6.8.7) is some thirty times larger and loses true hits in the corners of large
/// triangles.
#[inline]
pub fn even_error(error: Vec3) -> Vec3 {
    Vec3::splat(4.0 * error.max_element())
}

/// Moves a hit point off its surface to the side that `w` points to, by no more than its error bound asks for.
///
/// `error` bounds the absolute error of `p` per coordinate, `n` is the geometric normal
/// (pbrt-v4 section 6.8.6, `OffsetRayOrigin`).
#[inline]
pub fn offset_origin(p: Vec3, error: Vec3, n: Vec3, w: Vec3) -> Vec3 {
    let distance = n.abs().dot(error);
    let offset = n * distance.copysign(w.dot(n));
    let moved = p + offset;
    // Rounding took back half a step at most; where nothing is offset nothing was rounded.
    let away = (offset * 1e30).clamp(Vec3::NEG_ONE, Vec3::ONE);
    moved + moved.abs() * f32::EPSILON * away
}
