//! Owns the visible facets of the Beckmann distribution: their exact masking and the choice of one
//! (Heitz and d'Eon 2014, "Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals").

use glam::{DVec2, Vec2};
use std::f64::consts::FRAC_2_SQRT_PI;

/// Steeper slopes, in units of the width, have a probability below the resolution of a sample.
const STEEPEST: f64 = 5.5;

/// What lies below a slope of `x` among those seen under a view of slope `tan` across it, not yet divided by the whole:
/// the integral of (1 − t tan) exp(−t²) / √π up to x.
fn below(x: f64, tan: f64) -> f64 {
    0.5 * libm::erfc(-x) + 0.25 * FRAC_2_SQRT_PI * tan * libm::exp(-x * x)
}

/// 1 + Λ of Smith's masking for a view whose angle off the normal has this tangent, in units of the width.
fn whole(tan: f64) -> f64 {
    below(1.0 / tan, tan)
}

/// Smith's share of the facets that are seen, exactly.
pub(super) fn unmasked(tan: f64) -> f64 {
    1.0 / whole(tan)
}

/// The slope at the part `u` of those that are seen: the root of an increasing function, by Newton's steps, and by halves
/// where these leave the bracket.
fn slope(u: f64, tan: f64) -> f64 {
    let target = u * whole(tan);
    let (mut low, mut high) = (-STEEPEST, (1.0 / tan).min(STEEPEST));
    let mut x = guess(u, tan).clamp(low, high);
    for _ in 0..60 {
        let bell = 0.5 * FRAC_2_SQRT_PI * libm::exp(-x * x);
        let off = 0.5 * libm::erfc(-x) + 0.5 * tan * bell - target;
        if off > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - off / ((1.0 - x * tan) * bell);
        let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
        // Newton's steps square the error: the next one would be below what a sample can tell.
        if (next - x).abs() < 1e-5 {
            return next;
        }
        x = next;
    }
    x
}

/// About where the slope is: between what it is straight on, and what it is seen along the surface, where
/// exp(−x²) of the facets lie below a slope of −x.
fn guess(u: f64, tan: f64) -> f64 {
    let u = u.clamp(1e-12, 1.0 - 1e-12);
    // The root of the error function to 0.2 %, by its logarithm (Winitzki 2008).
    let centred = 2.0 * u - 1.0;
    let log = libm::log(4.0 * u * (1.0 - u));
    let half = 4.330_75 + 0.5 * log;
    let straight = ((half * half - log / 0.147).sqrt() - half).sqrt().copysign(centred);
    if tan == 0.0 {
        return straight;
    }
    let along = -(-libm::log(u)).sqrt();
    let share = tan / (1.0 + tan);
    straight + (along - straight) * share
}

/// Slopes along and across a view of slope `tan`, in units of the width, in proportion to how much of their facets is
/// seen; `u` in [0, 1)².
pub(super) fn visible_slopes(u: Vec2, tan: f64) -> DVec2 {
    DVec2::new(slope(f64::from(u.x), tan), slope(f64::from(u.y), 0.0))
}

#[cfg(test)]
mod tests {
    use super::{below, slope, unmasked, visible_slopes};
    use glam::Vec2;

    #[test]
    fn slopes_are_roots() {
        for tan in [0.0, 1e-6, 0.3, 1.0, 20.0, 1e6, 1e12] {
            for u in [0.0, 1e-9, 0.01, 0.3, 0.5, 0.77, 0.999, 1.0 - 1e-7] {
                let x = slope(u, tan);
                assert!(x.is_finite());
                let reached = below(x, tan) * unmasked(tan);
                assert!((reached - u).abs() < 1e-8, "tan {tan}, u {u}: {x} reaches {reached}");
            }
        }
    }

    #[test]
    fn what_is_seen_straight_on_is_the_distribution() {
        assert_eq!(unmasked(0.0), 1.0);
        let slopes = visible_slopes(Vec2::splat(0.5), 0.0);
        assert!(slopes.length() < 1e-8, "{slopes}");
    }
}
