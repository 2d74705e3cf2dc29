//! Owns the quaternion Julia set.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `julia`, `julia_close`, made by `scenes/sdf/`.

use glam::{Vec3, Vec4};

use crate::math::Aabb;
use crate::sdf::error::{SdfError, require};
use crate::sdf::real::{Point, Real};
use crate::sdf::traps::Traps;

/// The surface is where the distance estimate equals this, in the fractal's own units (it is 1 to 2 in radius).
pub(in crate::sdf) const LEVEL: f32 = 1.0 / 2048.0;

/// Squared radius at which an orbit counts as escaped: so far out that the estimate hardly jumps where the number of
/// iterations changes.
const BAILOUT2: f32 = 65_536.0;

/// Derivatives are held below this, so that deep orbits stay finite in f32: the estimate there is far below [`LEVEL`]
/// anyway.
const MAX_DERIVATIVE: f32 = 1e30;

/// The slice `w = 0` of the Julia set of `q <- q² + c` in the quaternions, as the level set `DE(p) = LEVEL` of the
/// distance estimate `DE = ½ |q| ln|q| / |q'|`, `q' <- 2 |q| q'` (Hart, Sandin, Kauffman 1989, "Ray tracing deterministic
/// 3-D fractals", where it is shown to be a lower bound of the distance for the exact potential).
///
/// With a bailout radius the estimate is off by a factor of `1 + O(1 / bailout)`, and it jumps by as much where the number
/// of iterations changes; so the march treats a sign change at the end of a supposedly free step as an overshoot.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Julia {
    c: Vec4,
    iterations: u32,
    /// Outside of this radius every orbit grows from the start.
    escape_radius: f32,
}

impl Julia {
    pub(in crate::sdf) fn new(c: Vec4, iterations: u32) -> Result<Self, SdfError> {
        let worst = c.to_array().into_iter().find(|part| part.is_nan() || part.abs() > 4.0);
        require(worst.is_none(), "julia.c", worst.unwrap_or(0.0), "four numbers from -4 to 4")?;
        let count = iterations as f32;
        require((1..=256).contains(&iterations), "julia.iterations", count, "an integer from 1 to 256")?;
        // |q² + c| >= |q|² - |c|, which is above |q| from here on.
        let escape_radius = 0.5 + (0.25 + c.length()).sqrt();
        Ok(Self { c, iterations, escape_radius })
    }

    /// A cube around all places with values up to `margin`: close to the escape radius the value may be less than the
    /// distance to it, and is at least that from 1.5 radii on.
    pub(in crate::sdf) fn bounds(self, margin: f32) -> Aabb {
        let radius = self.escape_radius * 1.02 + 8.0 * LEVEL;
        let radius = if margin > 0.0 { (1.5 * radius).max(radius + margin) } else { radius };
        Aabb { min: Vec3::splat(-radius), max: Vec3::splat(radius) }
    }

    /// The traps of the orbit of `p`: of its points after the first iteration, up to the one that leaves the bailout
    /// radius. Axes and planes are those of all four parts.
    pub(in crate::sdf) fn traps(self, p: Point<f32>) -> Traps {
        let (mut traps, mut q) = (Traps::NONE, Vec4::new(p.x, p.y, p.z, 0.0));
        for _ in 0..self.iterations {
            if q.length_squared() >= BAILOUT2 {
                break;
            }
            let real = q.x * q.x - q.y * q.y - q.z * q.z - q.w * q.w;
            q = Vec4::new(real, 2.0 * q.x * q.y, 2.0 * q.x * q.z, 2.0 * q.x * q.w) + self.c;
            traps.pass(&q.to_array());
        }
        traps
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let limit = R::splat(BAILOUT2);
        let [x, y, z, w] = self.c.to_array().map(R::splat);
        let two = R::splat(2.0);
        let (mut q, mut last) = (p, R::splat(0.0));
        let mut derivative = R::splat(1.0);
        // 2⁻ⁿ after n iterations.
        let mut share = R::splat(1.0);
        let mut square = q.length_squared();
        for _ in 0..self.iterations {
            let active = square.less(limit);
            if !R::any(active) {
                break;
            }
            let grown = (two * square.sqrt() * derivative).min(R::splat(MAX_DERIVATIVE));
            derivative = R::select(active, grown, derivative);
            share = R::select(active, share * R::splat(0.5), share);
            // (a + v)² = a² - v·v + 2 a v
            let real = q.x * q.x - q.y * q.y - q.z * q.z - last * last + x;
            let twice = two * q.x;
            let next = [twice * q.y + y, twice * q.z + z, twice * last + w];
            q = Point::new(
                R::select(active, real, q.x),
                R::select(active, next[0], q.y),
                R::select(active, next[1], q.z),
            );
            last = R::select(active, next[2], last);
            square = q.length_squared() + last * last;
        }
        let safe = square.max(R::splat(f32::MIN_POSITIVE));
        // |q| ln|q| = ½ |q| ln|q|², 2 G = 2⁻ⁿ ln|q|²
        let log = safe.ln().max(R::splat(0.0));
        let slope = derivative.max(R::splat(f32::MIN_POSITIVE)) * (R::splat(1.0) + share * log);
        let estimate = R::splat(0.25) * safe.sqrt() * log / slope;
        let level = R::splat(LEVEL);
        // Orbits that have not left the bailout radius yet go on smoothly, to 0 where they are within the unit ball.
        let value = estimate - level;
        // Far away the distance to the escape ball is the better bound.
        let far = p.length() - R::splat(self.escape_radius);
        R::select(R::splat(0.5 * self.escape_radius).less(far), value.min(far), value)
    }
}
