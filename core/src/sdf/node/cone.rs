//! Owns the cone around the y axis, with its tip or without.
//!
//! On the sheet `docs/images/sdf-nodes.png`: `cone`, made by `scenes/sdf/`.

use glam::Vec3;

use crate::math::Aabb;
use crate::sdf::closed::{Line, Span};
use crate::sdf::error::{A_LENGTH, LENGTHS, SdfError, require};
use crate::sdf::real::{Point, Real};

/// Cone around the y axis: radius `r1` at `y = -h`, `r2` at `y = h`, flat ends.
///
/// In the half-plane of `q = (hypot(p.x, p.z), p.y)` the nearest point is on the nearer end, a distance of
/// `(max(q.x - r, 0), |q.y| - h)` away, or on the slant from `(r1, -h)` to `(r2, h)`: as far away as its line where `q`
/// is projected onto it, else one of its ends. The least of both lengths is the exact distance, negative where `q` is
/// behind the line of the slant and between the ends; bound 1.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Cone {
    bottom: f32,
    top: f32,
    half: f32,
    /// One over the length of the slant.
    per_slant: f32,
}

impl Cone {
    /// A cone of a full height; the radius at the top may be 0, which is a tip.
    pub(in crate::sdf) fn new(radius: f32, top_radius: f32, height: f32) -> Result<Self, SdfError> {
        require(LENGTHS.contains(&radius), "cone.radius", radius, A_LENGTH)?;
        let allowed = "0 or a number from 1e-12 to 1e12";
        let fits = top_radius == 0.0 || LENGTHS.contains(&top_radius);
        require(fits, "cone.top_radius", top_radius, allowed)?;
        require(LENGTHS.contains(&height), "cone.height", height, A_LENGTH)?;
        let (across, along) = (f64::from(top_radius) - f64::from(radius), f64::from(height));
        let per_slant = (1.0 / (across * across + along * along).sqrt()) as f32;
        Ok(Self { bottom: radius, top: top_radius, half: 0.5 * height, per_slant })
    }

    #[inline]
    pub(in crate::sdf) fn distance<R: Real>(self, p: Point<R>) -> R {
        let zero = R::splat(0.0);
        let across = (p.x * p.x + p.z * p.z).sqrt();
        // From the nearer end.
        let below = p.y.less(zero);
        let end = R::select(below, R::splat(self.bottom), R::splat(self.top));
        let (end_x, end_y) = ((across - end).max(zero), p.y.abs() - R::splat(self.half));
        // From the slant.
        let (run, rise) = (R::splat(self.top - self.bottom), R::splat(2.0 * self.half));
        let (x, y) = (across - R::splat(self.bottom), p.y + R::splat(self.half));
        let (one, per_slant) = (R::splat(1.0), R::splat(self.per_slant));
        let part = (x * run + y * rise) * per_slant * per_slant;
        let nearest = part.max(zero).min(one);
        let (slant_x, slant_y) = (x - run * nearest, y - rise * nearest);
        // Between its ends the distance from the line of the slant keeps its sign: what rounding leaves of the way to
        // the nearest point along the line would be the least value next to the surface.
        let beside = (x * rise - y * run) * per_slant;
        let corner = slant_x * slant_x + slant_y * slant_y;
        let on_slant = R::select(zero.less(part), R::select(part.less(one), beside * beside, corner), corner);
        let square = (end_x * end_x + end_y * end_y).min(on_slant);
        let within = R::select(end_y.less(zero), -one, one);
        square.sqrt() * R::select(beside.less(zero), within, one)
    }

    /// The piece of a line between the ends and within the slant.
    ///
    /// Between the ends the radius `w + k s` is not negative, so that of the double cone `|q + s u|² <= (w + k s)²`
    /// (all across the axis) only the nappe that is meant is there. `|u|² - k²` tells whether the line is flatter
    /// than the slant, and then inside between both roots, or steeper: then it is inside from the root on the nappe
    /// onwards, to where the cone widens. The discriminant is `|w u - k q|² - (q × u)²`.
    #[inline]
    pub(in crate::sdf) fn span(self, line: &Line) -> Option<Span> {
        let caps = line.between_caps(f64::from(self.half))?;
        let (foot, dir, half) = (line.foot, line.dir, f64::from(self.half));
        let widening = f64::from(self.top - self.bottom) / (2.0 * half);
        let (w, k) = (f64::from(self.bottom) + widening * (foot.y + half), widening * dir.y);
        let across = dir.x * dir.x + dir.z * dir.z;
        // Along the slant the line counts as steeper: its first root has gone to one end of the line.
        let a = if across == k * k { -0.0 } else { across - k * k };
        let b = foot.x * dir.x + foot.z * dir.z - w * k;
        let cross = foot.x * dir.z - foot.z * dir.x;
        let (x, z) = (w * dir.x - k * foot.x, w * dir.z - k * foot.z);
        let discriminant = x * x + z * z - cross * cross;
        if a > 0.0 && discriminant <= 0.0 {
            return None;
        }
        // A steep line always crosses; through the tip both roots are one.
        let root = discriminant.max(0.0).sqrt();
        let away = (foot.x * foot.x + foot.z * foot.z).sqrt();
        let c = (away - w) * (away + w);
        // Neither sum cancels: the other root is what the product of both leaves.
        let sum = if b < 0.0 { root - b } else { -root - b };
        let (one, other) = if sum == 0.0 { (0.0, 0.0) } else { (sum / a, c / sum) };
        let (low, high) = (one.min(other), one.max(other));
        let slant = if a > 0.0 {
            Span { start: low, end: high }
        } else if a == 0.0 && sum == 0.0 {
            // It neither comes closer nor goes away.
            return (c <= 0.0).then_some(caps);
        } else if k > 0.0 {
            Span { start: high, ..Span::WHOLE }
        } else {
            Span { end: low, ..Span::WHOLE }
        };
        caps.common(slant)
    }

    pub(in crate::sdf) fn bounds(self) -> Aabb {
        let radius = self.bottom.max(self.top);
        let corner = Vec3::new(radius, self.half, radius);
        Aabb { min: -corner, max: corner }
    }
}
