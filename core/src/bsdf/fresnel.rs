//! Owns how much light an interface reflects.

use glam::Vec3;

/// Fresnel's equations for unpolarised light at an interface of two dielectrics.
///
/// `cos` is the cosine between the direction and the normal, of either sign; `eta` the index of refraction of the side
/// that the light refracts to, in units of that of the side where `cos` is measured. Returns the share that is reflected,
/// 1 under total reflection, and the cosine on the other side (positive; 0 under total reflection).
#[inline]
pub(super) fn dielectric(cos: f32, eta: f32) -> (f32, f32) {
    let cos = cos.abs().min(1.0);
    // 1 − sin²θt; of a grazing direction the sine keeps its precision as 1 − cos².
    let sin2 = (1.0 - cos) * (1.0 + cos);
    let cos2_t = 1.0 - sin2 / (eta * eta);
    if cos2_t <= 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = cos2_t.sqrt();
    let s = (cos - eta * cos_t) / (cos + eta * cos_t);
    let p = (eta * cos - cos_t) / (eta * cos + cos_t);
    (0.5 * (s * s + p * p), cos_t)
}

/// Fresnel's equations for unpolarised light on a conductor with indices `eta` and `k` by colour, from a vacuum
/// (Lagarde 2013).
#[inline]
pub(super) fn conductor(cos: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cos = cos.abs().min(1.0);
    let (cos2, sin2) = (cos * cos, (1.0 - cos) * (1.0 + cos));
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - sin2;
    let a2b2 = (t0 * t0 + 4.0 * eta2 * k2).map(f32::sqrt);
    let a = (0.5 * (a2b2 + t0)).max(Vec3::ZERO).map(f32::sqrt);
    let (t1, t2) = (a2b2 + cos2, 2.0 * cos * a);
    // Without an index both sums may vanish.
    let sum = |a: Vec3, b: Vec3| (a + b).max(Vec3::splat(f32::MIN_POSITIVE));
    let s = (t1 - t2) / sum(t1, t2);
    let (t3, t4) = (cos2 * a2b2 + sin2 * sin2, t2 * sin2);
    0.5 * (s + s * (t3 - t4) / sum(t3, t4))
}

/// Schlick's approximation: from `c0` at normal incidence to 1 at grazing, `c0 + (1 − c0)(1 − cos)⁵`.
#[inline]
pub(super) fn schlick(c0: Vec3, cos: f32) -> Vec3 {
    c0 + (Vec3::ONE - c0) * grazing(cos)
}

/// `(1 − cos)⁵`.
#[inline]
pub(super) fn grazing(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Reflectance at normal incidence of an index of refraction.
#[inline]
pub(super) fn normal_incidence(eta: f32) -> f32 {
    let r = (eta - 1.0) / (eta + 1.0);
    r * r
}
