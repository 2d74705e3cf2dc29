//! Owns straight lines through solids, and the pieces of them that are inside.

use glam::DVec3;

/// A straight line in the space of a solid. Lengths along it are counted from `foot`.
///
/// The foot is close to the solid wherever the ray began, so that an origin far away costs no precision, and
/// discriminants are differences of a radius and a perpendicular distance instead of `b² - 4 a c`.
#[derive(Debug, Clone, Copy)]
pub(in crate::sdf) struct Line {
    /// The point of the line that is closest to the origin.
    pub(in crate::sdf) foot: DVec3,
    /// Unit vector.
    pub(in crate::sdf) dir: DVec3,
}

/// The piece of a line between two lengths, which may be infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::sdf) struct Span {
    pub(in crate::sdf) start: f64,
    pub(in crate::sdf) end: f64,
}

impl Line {
    /// The piece within `half` of the plane `y = 0`, faces included.
    #[inline]
    pub(in crate::sdf) fn between_caps(&self, half: f64) -> Option<Span> {
        Span::slab(self.foot.y, self.dir.y, half)
    }

    /// The piece within `radius` of the y axis.
    #[inline]
    pub(in crate::sdf) fn in_tube(&self, radius: f64) -> Option<Span> {
        let (foot, dir) = (self.foot, self.dir);
        let across = dir.x * dir.x + dir.z * dir.z;
        if across == 0.0 {
            let within = foot.x * foot.x + foot.z * foot.z <= radius * radius;
            return within.then_some(Span::WHOLE);
        }
        let cross = foot.x * dir.z - foot.z * dir.x;
        let middle = -(foot.x * dir.x + foot.z * dir.z) / across;
        Span::around(middle, (radius * radius - cross * cross / across) / across)
    }

    /// The piece within `radius` of the place `y` on the y axis.
    #[inline]
    pub(in crate::sdf) fn in_ball(&self, y: f64, radius: f64) -> Option<Span> {
        let to_middle = DVec3::new(-self.foot.x, y - self.foot.y, -self.foot.z);
        let middle = to_middle.dot(self.dir);
        let gap = to_middle - self.dir * middle;
        Span::around(middle, radius * radius - gap.length_squared())
    }
}

impl Span {
    /// All of a line.
    pub(in crate::sdf) const WHOLE: Self = Self { start: f64::NEG_INFINITY, end: f64::INFINITY };

    /// What is less than the root of `square` away from `middle`; `None` where that is nothing.
    #[inline]
    pub(in crate::sdf) fn around(middle: f64, square: f64) -> Option<Self> {
        // NaN is nothing, too.
        (square > 0.0).then(|| {
            let half = square.sqrt();
            Self { start: middle - half, end: middle + half }
        })
    }

    /// Where `|at + slope s| <= half`.
    #[inline]
    pub(in crate::sdf) fn slab(at: f64, slope: f64, half: f64) -> Option<Self> {
        if slope == 0.0 {
            return (at.abs() <= half).then_some(Self::WHOLE);
        }
        let (a, b) = ((-half - at) / slope, (half - at) / slope);
        Some(Self { start: a.min(b), end: a.max(b) })
    }

    /// What is in both; `None` where that has no length.
    #[inline]
    pub(in crate::sdf) fn common(self, other: Self) -> Option<Self> {
        let both = Self { start: self.start.max(other.start), end: self.end.min(other.end) };
        (both.start < both.end).then_some(both)
    }

    /// From the first start to the last end: of pieces of one convex solid that is what is in any.
    #[inline]
    pub(in crate::sdf) fn hull(self, other: Self) -> Self {
        Self { start: self.start.min(other.start), end: self.end.max(other.end) }
    }
}
