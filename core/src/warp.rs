//! Owns maps from the unit square to shapes, each beside its density; nothing else.

use crate::math::{sin_cos_eighth, sin_cos_turn};
use glam::{Vec2, Vec2Swizzles as _, Vec3};
use std::f32::consts::{FRAC_1_PI, PI};

/// A point of the unit disk, area-preserving and continuous (Shirley and Chiu 1997).
#[inline]
pub fn disk_concentric(u: Vec2) -> Vec2 {
    let o = u * 2.0 - Vec2::ONE;
    let is_wide = o.x.abs() > o.y.abs();
    let (r, along) = if is_wide { (o.x, o.y) } else { (o.y, o.x) };
    if r == 0.0 {
        return Vec2::ZERO;
    }
    let (sin, cos) = sin_cos_eighth(0.125 * (along / r));
    let p = Vec2::new(r * cos, r * sin);
    if is_wide { p } else { p.yx() }
}

/// A direction of the upper hemisphere with density [`hemisphere_cosine_pdf`].
#[inline]
pub fn hemisphere_cosine(u: Vec2) -> Vec3 {
    let d = disk_concentric(u);
    d.extend((1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`hemisphere_cosine`] per solid angle.
#[inline]
pub fn hemisphere_cosine_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// A direction of the sphere, uniform.
#[inline]
pub fn sphere_uniform(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (u.x * (1.0 - u.x)).max(0.0).sqrt() * 2.0;
    let (sin, cos) = sin_cos_turn(u.y);
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`sphere_uniform`] per solid angle.
#[inline]
pub const fn sphere_uniform_pdf() -> f32 {
    FRAC_1_PI * 0.25
}

/// A direction of the cone around +z, uniform; `one_minus_cos` is 1 − cos of its half angle.
///
/// Small angles keep their precision because 1 − cos is the argument, not cos.
#[inline]
pub fn cone_uniform(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let h = u.x * one_minus_cos;
    let r = (h * (2.0 - h)).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turn(u.y);
    Vec3::new(r * cos, r * sin, 1.0 - h)
}

/// Density of [`cone_uniform`] per solid angle.
#[inline]
pub fn cone_uniform_pdf(one_minus_cos: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos)
}

/// Barycentric coordinates of a uniform point of a triangle (Heitz 2019, low-distortion map).
#[inline]
pub fn triangle_uniform(u: Vec2) -> Vec3 {
    let (b0, b1) = if u.x < u.y { (u.x * 0.5, u.y - u.x * 0.5) } else { (u.x - u.y * 0.5, u.y * 0.5) };
    Vec3::new(b0, b1, 1.0 - b0 - b1)
}
