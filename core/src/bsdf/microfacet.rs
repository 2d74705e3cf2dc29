//! Owns distributions of microfacets: density, masking, and the choice of a facet that can be seen.

use super::beckmann;
use crate::math::{exp, sin_cos_turn};
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::PI;

/// Which distribution the slopes of facets have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Distribution {
    /// Trowbridge and Reitz 1975, known as GGX.
    #[default]
    Ggx,
    /// Beckmann and Spizzichino 1963.
    Beckmann,
}

/// A distribution of microfacets of some width, with Smith's separable masking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Microfacets {
    /// Kind.
    pub distribution: Distribution,
    /// Widths along x and y, at least [`Microfacets::MIN_ALPHA`].
    pub alpha: Vec2,
}

impl Microfacets {
    /// Narrower distributions are mirrors: f32 directions cannot tell their facets apart.
    pub const MIN_ALPHA: f32 = 1.0e-4;

    /// Facets of these widths.
    pub fn new(distribution: Distribution, alpha: Vec2) -> Self {
        Self { distribution, alpha: alpha.max(Vec2::splat(Self::MIN_ALPHA)) }
    }

    /// Density of facets with unit normal `h`, z ≥ 0, per projected area and solid angle.
    #[inline]
    pub fn density(&self, h: Vec3) -> f32 {
        let Vec2 { x: ax, y: ay } = self.alpha;
        let (x, y) = (h.x / ax, h.y / ay);
        match self.distribution {
            // The form in x and y does not cancel near the peak, as 1 + (α² − 1) cos² does.
            Distribution::Ggx => {
                let s = x * x + y * y + h.z * h.z;
                1.0 / (PI * ax * ay * s * s)
            }
            Distribution::Beckmann => {
                let z2 = h.z * h.z;
                if z2 == 0.0 {
                    return 0.0;
                }
                exp(-(x * x + y * y) / z2) / (PI * ax * ay * z2 * z2)
            }
        }
    }

    /// Smith's share of the facets that are seen from `w`: of those facing it, whatever the facet.
    #[inline]
    pub fn unmasked(&self, w: Vec3) -> f32 {
        // α² tan² θ, the squared slope of w in units of the distribution's.
        let slope2 = (w.x * self.alpha.x).powi(2) + (w.y * self.alpha.y).powi(2);
        let z2 = w.z * w.z;
        if z2 == 0.0 {
            return 0.0;
        }
        let tan2 = slope2 / z2;
        match self.distribution {
            Distribution::Ggx => 2.0 / (1.0 + (1.0 + tan2).sqrt()),
            // The rational fit of Walter et al. 2007, equation 27.
            Distribution::Beckmann => {
                let a = 1.0 / tan2.sqrt();
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
        }
    }

    /// Chooses a facet's normal among those that `wo` sees, z > 0; `wo` may be on either side. Weights are then at most
    /// the share of facets that the other direction sees: a path that goes on for long inside of something must not gain.
    #[inline]
    pub fn sample_visible(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let wo = wo * 1.0_f32.copysign(wo.z);
        match self.distribution {
            Distribution::Ggx => self.sample_cap(wo, u, 1.0),
            Distribution::Beckmann => self.sample_slopes(wo, u),
        }
    }

    /// Density of [`Microfacets::sample_visible`] per solid angle of `h`, z > 0.
    #[inline]
    pub fn visible_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        let cos = (wo.dot(h) * 1.0_f32.copysign(wo.z)).max(0.0);
        let unmasked = match self.distribution {
            Distribution::Ggx => self.unmasked(wo),
            // The fit is off by up to 0.4 %.
            Distribution::Beckmann => beckmann::unmasked(self.tan(wo)) as f32,
        };
        unmasked * cos * self.density(h) / wo.z.abs()
    }

    /// Slope of a view in units of the width, as the facets are stretched.
    fn tan(&self, w: Vec3) -> f64 {
        f64::from((w.truncate() * self.alpha).length()) / f64::from(w.z.abs().max(f32::MIN_POSITIVE))
    }

    /// Chooses a facet by its slopes along and across the view.
    fn sample_slopes(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let slopes = beckmann::visible_slopes(u, self.tan(wo)).as_vec2();
        let along = (wo.truncate() * self.alpha).try_normalize().unwrap_or(Vec2::X);
        let slope = (along * slopes.x + along.perp() * slopes.y) * self.alpha;
        (-slope).extend(1.0).normalize()
    }

    /// Chooses the direction into which a visible facet mirrors `wo`, z > 0; for GGX from a cap that leaves out most
    /// facets that mirror below the horizon (Tokuyoshi and Eto 2023). The direction may still be below.
    #[inline]
    pub fn sample_reflection(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let h = match self.distribution {
            Distribution::Ggx => self.sample_cap(wo, u, self.cap(wo)),
            Distribution::Beckmann => self.sample_slopes(wo, u),
        };
        reflect(wo, h)
    }

    /// Density of [`Microfacets::sample_reflection`] per solid angle of `wi`, for the half vector `h` of `wo` and `wi`.
    #[inline]
    pub fn reflection_pdf(&self, wo: Vec3, h: Vec3) -> f32 {
        match self.distribution {
            Distribution::Ggx => {
                let slope2 = (wo.x * self.alpha.x).powi(2) + (wo.y * self.alpha.y).powi(2);
                let length = (slope2 + wo.z * wo.z).sqrt();
                self.density(h) / (2.0 * (self.cap(wo) * wo.z + length))
            }
            Distribution::Beckmann => {
                let cos = wo.dot(h);
                if cos > 0.0 { self.visible_pdf(wo, h) / (4.0 * cos) } else { 0.0 }
            }
        }
    }

    /// What the facets reflect from `wi` to `wo` on one side, `h` between them, times the cosine of `wi`: D G / (4 cos),
    /// without Fresnel's term.
    #[inline]
    pub(super) fn reflected(&self, wo: Vec3, wi: Vec3, h: Vec3) -> f32 {
        self.density(h) * self.unmasked(wo) * self.unmasked(wi) / (4.0 * wo.z.abs())
    }

    /// Share of the unit sphere's lower cap that reflections need: Tokuyoshi and Eto's k.
    #[inline]
    fn cap(&self, wo: Vec3) -> f32 {
        let a = self.alpha.min_element().min(1.0);
        let s = 1.0 + wo.truncate().length();
        let (a2, s2) = (a * a, s * s);
        (1.0 - a2) * s2 / (s2 + a2 * wo.z * wo.z)
    }

    /// Chooses a facet of GGX (Dupuy and Benyoub 2023) from the part `k` of the sphere's lower cap.
    fn sample_cap(&self, wo: Vec3, u: Vec2, k: f32) -> Vec3 {
        let stretched = (wo * self.alpha.extend(1.0)).normalize();
        let (sin, cos) = sin_cos_turn(u.x);
        let bound = k * stretched.z;
        let z = (1.0 - u.y) * (1.0 + bound) - bound;
        let r = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
        let h = Vec3::new(r * cos, r * sin, z) + stretched;
        // Below 0 only by rounding.
        (h * self.alpha.extend(1.0)).with_z(h.z.max(0.0)).try_normalize().unwrap_or(Vec3::Z)
    }
}

/// The mirror image of a direction at a facet.
#[inline]
pub(super) fn reflect(w: Vec3, h: Vec3) -> Vec3 {
    (h * (2.0 * w.dot(h)) - w).normalize()
}

/// The mirror image of a direction at the surface.
#[inline]
pub(super) fn mirrored(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, -w.y, w.z)
}

/// The direction behind a facet into which `w` refracts; `eta` is the index of refraction there, in units of that of the
/// side of `w`, and `cos_t` the cosine there, as `fresnel::dielectric` returns it.
#[inline]
pub(super) fn refract(w: Vec3, h: Vec3, eta: f32, cos_t: f32) -> Vec3 {
    let cos = w.dot(h);
    let facing = 1.0_f32.copysign(cos);
    (h * (cos / eta - cos_t * facing) - w / eta).normalize()
}

/// A half vector and how long it was, from f64 sums: nearly opposite directions cancel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Half {
    /// Unit length, z ≥ 0.
    pub(super) h: Vec3,
    /// Length of the sum that it is the direction of.
    pub(super) length: f32,
}

impl Half {
    /// The facet that mirrors `wo` to `wi` (`eta` 1), or refracts it there: the direction of `wo + eta · wi`, `eta` being
    /// the index of refraction of the side of `wi` in units of that of the side of `wo`. `None` when they cancel out.
    #[inline]
    pub(super) fn new(wo: Vec3, wi: Vec3, eta: f32) -> Option<Self> {
        let sum: DVec3 = wo.as_dvec3() + wi.as_dvec3() * f64::from(eta);
        let length = sum.length();
        if length < 1.0e-9 {
            return None;
        }
        let h = sum * (1.0_f64.copysign(sum.z) / length);
        Some(Self { h: h.as_vec3(), length: length as f32 })
    }
}
