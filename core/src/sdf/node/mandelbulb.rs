//! Owns the Mandelbulb.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `mandelbulb`, `mandelbulb_valley`, `mandelbulb_power_4`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::error::{SdfError, require};
use crate::sdf::real::{Point, Real};
use crate::sdf::traps::Traps;

/// The surface is where the distance estimate equals this, in the fractal's own units (it is about 1.1 in radius).
///
/// A fractal has no surface to converge to; a level of the estimate at a fixed number of iterations has one, the same
/// at every resolution.
pub(in crate::sdf) const LEVEL: f32 = 1.0 / 2048.0;

/// Derivatives are held below this, so that deep orbits stay finite in f32: the estimate there is far below
/// [`LEVEL`] anyway.
const MAX_DERIVATIVE: f32 = 1e30;

/// Mandelbulb of White and Nylander, `z <- zⁿ + p` in spherical coordinates around the z axis, as the level set
/// `DE(p) = LEVEL` of the scalar distance estimate `DE = ½ ln|z| |z| / dr`, `dr <- n |z|ⁿ⁻¹ dr + 1`.
///
/// `f(p) = c(p) (DE(p) - LEVEL)`, and `-c(p) LEVEL` where the orbit does not leave the bailout radius.
/// The Lipschitz bound 1 is **not proven**: the ball of radius DE holds points of the set for 0.08 % of exterior
/// points, and for 0.9 % near the polar axis, where the azimuth is stretched by up to `n` and the scalar derivative
/// does not see it. Hence `c`: 0.9 far from the axis, 0.25 within `1.2 / n` of it, continuous in between (a positive factor
/// moves no surface); and hence the march treats a sign change at the end of a supposedly free step as an overshoot
/// and goes back. Far away the estimate exceeds the distance, so beyond 1.5 escape radii the distance to the ball of
/// the escape radius caps it.
///
/// For whole `n` the powers are complex multiplications: with `ρ = hypot(x, y)`, `(z + iρ)ⁿ = rⁿ (cos nθ + i sin nθ)`
/// and `((x + iy) / ρ)ⁿ = cos nφ + i sin nφ`, so no trigonometry is needed.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Mandelbulb {
    power: f32,
    /// The power where it is whole, else 0.
    whole: u32,
    iterations: u32,
    bailout: f32,
    /// Outside this radius every orbit escapes.
    escape_radius: f32,
}

impl Mandelbulb {
    pub(in crate::sdf) fn new(power: f32, iterations: u32, bailout: f32) -> Result<Self, SdfError> {
        require((2.0..=64.0).contains(&power), "mandelbulb.power", power, "a number from 2 to 64")?;
        let count = iterations as f32;
        require((1..=256).contains(&iterations), "mandelbulb.iterations", count, "an integer from 1 to 256")?;
        require((2.0..=1e6).contains(&bailout), "mandelbulb.bailout", bailout, "a number from 2 to 1000000")?;
        // Orbit points reach bailout^power: keep that, and its product with the derivative, inside f32.
        let magnitude = power * libm::log2f(bailout);
        let allowed = "a bailout for which bailout^power stays below 2^100";
        require(magnitude < 100.0, "mandelbulb.bailout", bailout, allowed)?;
        let whole = if power == libm::floorf(power) { power as u32 } else { 0 };
        Ok(Self {
            power,
            whole,
            iterations,
            bailout,
            escape_radius: escape_radius(power, iterations, bailout),
        })
    }

    /// A cube around all places with values up to `margin`: every orbit from outside of the escape ball escapes with an
    /// estimate above [`LEVEL`]. Close to it the value may be less than the distance to it, and is at least that from
    /// 1.5 radii on.
    pub(in crate::sdf) fn bounds(self, margin: f32) -> Aabb {
        let radius = self.escape_radius;
        let radius = if margin > 0.0 { (1.5 * radius).max(radius + margin) } else { radius };
        Aabb { min: Vec3::splat(-radius), max: Vec3::splat(radius) }
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let (radius, derivative, inside) = self.orbit(p);
        let estimate = R::splat(0.5) * radius.ln() * radius / derivative;
        let level = R::splat(LEVEL);
        let value = R::select(inside, -level, estimate - level);
        // The step factor: 0.25 near the polar axis, where the azimuth is stretched over an angle of about 1/n, 0.9 away
        // from it.
        let axis = (p.x * p.x + p.y * p.y).sqrt();
        let near = 1.2 / self.power;
        let blend = ((axis - R::splat(near)) * R::splat(1.0 / near)).max(R::splat(0.0)).min(R::splat(1.0));
        let scaled = value * (R::splat(0.25) + R::splat(0.65) * blend);
        // Far away the distance to the escape ball is the better bound, and the only valid one.
        let far = p.length() - R::splat(self.escape_radius);
        R::select(R::splat(0.5 * self.escape_radius).less(far), scaled.min(far), scaled)
    }

    /// Final radius and derivative of the orbit of `p`, and whether it stayed inside the bailout radius.
    #[inline]
    fn orbit<R: Real>(self, p: Point<R>) -> (R, R, R::Mask) {
        let limit = R::splat(self.bailout * self.bailout);
        let mut z = p;
        let mut derivative = R::splat(1.0);
        let mut square = z.length_squared();
        for _ in 0..self.iterations {
            let active = square.less(limit);
            if !R::any(active) {
                break;
            }
            let r = square.sqrt();
            let (next, slope) = if self.whole == 0 { self.power_any(z, r) } else { self.power_whole(z, r) };
            let grown = (slope * derivative + R::splat(1.0)).min(R::splat(MAX_DERIVATIVE));
            derivative = R::select(active, grown, derivative);
            z.x = R::select(active, next.x + p.x, z.x);
            z.y = R::select(active, next.y + p.y, z.y);
            z.z = R::select(active, next.z + p.z, z.z);
            square = z.length_squared();
        }
        (square.max(R::splat(f32::MIN_POSITIVE)).sqrt(), derivative, square.less(limit))
    }

    /// The traps of the orbit of `p`: of its points after the first iteration, up to the one that leaves the bailout
    /// radius.
    pub(in crate::sdf) fn traps(self, p: Point<f32>) -> Traps {
        let (mut traps, mut z) = (Traps::NONE, p);
        for _ in 0..self.iterations {
            let square = z.length_squared();
            if square >= self.bailout * self.bailout {
                break;
            }
            let r = square.sqrt();
            let (next, _) = if self.whole == 0 { self.power_any(z, r) } else { self.power_whole(z, r) };
            z = Point::new(next.x + p.x, next.y + p.y, next.z + p.z);
            traps.pass(&[z.x, z.y, z.z]);
        }
        traps
    }

    /// `zⁿ` and `n |z|ⁿ⁻¹` for whole `n`.
    #[inline]
    fn power_whole<R: Real>(self, z: Point<R>, r: R) -> (Point<R>, R) {
        let axis = (z.x * z.x + z.y * z.y).sqrt();
        let on_axis = axis.less(R::splat(1e-30));
        let inverse = R::splat(1.0) / R::select(on_axis, R::splat(1.0), axis);
        let azimuth = (R::select(on_axis, R::splat(1.0), z.x * inverse), z.y * inverse);
        let (cos_theta, sin_theta) = complex_power((z.z, axis), self.whole);
        let (cos_phi, sin_phi) = complex_power(azimuth, self.whole);
        let slope = R::splat(self.power) * real_power(r, self.whole - 1);
        (Point::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta), slope)
    }

    /// `zⁿ` and `n |z|ⁿ⁻¹` for any `n`.
    #[inline]
    fn power_any<R: Real>(self, z: Point<R>, r: R) -> (Point<R>, R) {
        let safe = r.max(R::splat(1e-30));
        let cosine = (z.z / safe).max(R::splat(-1.0)).min(R::splat(1.0));
        let n = R::splat(self.power);
        let (sin_theta, cos_theta) = (cosine.acos() * n).sin_cos();
        let (sin_phi, cos_phi) = (z.y.atan2(z.x) * n).sin_cos();
        let below = safe.powf(self.power - 1.0);
        let length = below * r;
        let across = length * sin_theta;
        (Point::new(across * cos_phi, across * sin_phi, length * cos_theta), n * below)
    }
}

/// `(a + ib)ⁿ` by repeated squaring, n >= 1.
#[inline]
fn complex_power<R: Real>(base: (R, R), n: u32) -> (R, R) {
    let product = |a: (R, R), b: (R, R)| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let square = |a: (R, R)| (a.0 * a.0 - a.1 * a.1, R::splat(2.0) * (a.0 * a.1));
    let mut factor = base;
    for _ in 0..n.trailing_zeros() {
        factor = square(factor);
    }
    let mut result = factor;
    let mut rest = n >> n.trailing_zeros() >> 1;
    while rest > 0 {
        factor = square(factor);
        if rest & 1 == 1 {
            result = product(result, factor);
        }
        rest >>= 1;
    }
    result
}

/// `rⁿ` by repeated squaring, n >= 1.
#[inline]
fn real_power<R: Real>(r: R, n: u32) -> R {
    let mut factor = r;
    let mut result = if n & 1 == 1 { r } else { R::splat(1.0) };
    let mut rest = n >> 1;
    while rest > 0 {
        factor = factor * factor;
        if rest & 1 == 1 {
            result = result * factor;
        }
        rest >>= 1;
    }
    result
}

/// A radius outside of which every orbit escapes within `iterations`, with a margin for the level set.
///
/// `|zⁿ + p| >= |z|ⁿ - |p|`, so the orbit of a point at radius `r` is at least as large as `s <- sⁿ - r` from `s = r`;
/// above `2^(1/(n-1))` that sequence grows. Bisection finds where it just escapes.
fn escape_radius(power: f32, iterations: u32, bailout: f32) -> f32 {
    let n = f64::from(power);
    let escapes = |r: f64| {
        let mut s = r;
        for _ in 0..iterations {
            if s >= f64::from(bailout) {
                return true;
            }
            s = libm::pow(s, n) - r;
        }
        s >= f64::from(bailout)
    };
    let (mut low, mut high) = (libm::pow(2.0, 1.0 / (n - 1.0)), f64::from(bailout));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if escapes(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    (high * 1.02 + 8.0 * f64::from(LEVEL)) as f32
}
