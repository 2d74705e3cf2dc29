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
    // Almost no facet turns away from such a view: the sum is 1 to the last bit.
    if tan < 1.0 / 6.0 { 1.0 } else { below(1.0 / tan, tan) }
}

/// Smith's share of the facets that are seen, exactly.
pub(super) fn unmasked(tan: f64) -> f64 {
    1.0 / whole(tan)
}

/// The slope at the part `u` of those that are seen: the root of an increasing function, by Halley's steps, and by halves
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
        let newton = off / ((1.0 - x * tan) * bell);
        // Half of the second derivative over the first.
        let bend = -0.5 * tan / (1.0 - x * tan) - x;
        let halley = x - newton / (1.0 - newton * bend);
        let next = if halley >= low && halley <= high { halley } else { 0.5 * (low + high) };
        // Halley's steps cube the error: the next one would be below what a sample can tell.
        if (next - x).abs() < 2e-4 {
            return next;
        }
        x = next;
    }
    x
}

/// About where the slope is: between what it is straight on, and what it is seen along the surface, where
/// exp(−x²) of the facets lie below a slope of −x. Near straight on, its series to the second order of `tan`.
fn guess(u: f64, tan: f64) -> f64 {
    if tan < 0.25 {
        let straight = straight(u);
        return straight - tan * (0.5 + 0.25 * tan * straight);
    }
    let along = -(-libm::log(u.clamp(1e-12, 1.0))).sqrt();
    let straight = straight(u);
    straight + (along - straight) * (tan / (1.0 + tan))
}

/// The slope straight on, and across every view: the root of the error function at 2u − 1, to 4e-7 of itself (Giles 2012,
/// "Approximating the erfinv Function", single precision).
fn straight(u: f64) -> f64 {
    const MIDDLE: [f64; 9] = [
        2.810_226_36e-8,
        3.432_739_39e-7,
        -3.523_387_7e-6,
        -4.391_506_54e-6,
        2.185_808_7e-4,
        -1.253_725_03e-3,
        -4.177_681_64e-3,
        2.466_407_27e-1,
        1.501_409_41,
    ];
    const TAIL: [f64; 9] = [
        -2.002_142_57e-4,
        1.009_505_58e-4,
        1.349_343_22e-3,
        -3.673_428_44e-3,
        5.739_507_73e-3,
        -7.622_461_3e-3,
        9.438_870_47e-3,
        1.001_674_06,
        2.832_976_82,
    ];
    let u = u.clamp(1e-12, 1.0 - 1e-12);
    let w = -libm::log(4.0 * u * (1.0 - u));
    let (series, w) = if w < 5.0 { (MIDDLE, w - 2.5) } else { (TAIL, w.sqrt() - 3.0) };
    series.into_iter().fold(0.0, |sum, factor| sum * w + factor) * (2.0 * u - 1.0)
}

/// Slopes along and across a view of slope `tan`, in units of the width, in proportion to how much of their facets is
/// seen; `u` in [0, 1)².
pub(super) fn visible_slopes(u: Vec2, tan: f64) -> DVec2 {
    DVec2::new(slope(f64::from(u.x), tan), straight(f64::from(u.y)))
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
    fn views_near_straight_on_see_all_facets() {
        for tan in [1e-3, 0.1, 1.0 / 6.0 - 1e-9, 1.0 / 6.0] {
            assert_eq!(below(1.0 / tan, tan), 1.0, "{tan}");
        }
    }

    #[test]
    fn what_is_seen_straight_on_is_the_distribution() {
        assert_eq!(unmasked(0.0), 1.0);
        let slopes = visible_slopes(Vec2::splat(0.5), 0.0);
        assert!(slopes.length() < 1e-8, "{slopes}");
    }
}
