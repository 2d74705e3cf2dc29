//! Owns axis-aligned boxes.

use glam::{DAffine3, Vec3};

/// An axis-aligned box; empty when `min > max` on some axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box that holds everything.
    pub const EVERYTHING: Self = Self { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };

    /// The largest box in both; empty where they do not meet.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// The box that is larger by a length on every side.
    #[must_use]
    pub fn grown(self, by: f32) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    /// The smallest box that holds both.
    #[inline]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The smallest box that holds this one and a point.
    #[inline]
    #[must_use]
    pub fn with_point(self, p: Vec3) -> Self {
        Self { min: self.min.min(p), max: self.max.max(p) }
    }

    /// Whether it holds no point at all.
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Whether every corner is finite.
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }

    /// Centre.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Lengths of the edges.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The box around the transformed corners, grown by one rounding step so that nothing pokes out.
    #[must_use]
    pub fn transformed(&self, m: &DAffine3) -> Self {
        let mut out = Self::EMPTY;
        for corner in self.corners() {
            out = out.with_point(m.transform_point3(corner.as_dvec3()).as_vec3());
        }
        let grow = (out.min.abs().max(out.max.abs())) * (2.0 * f32::EPSILON);
        Self { min: out.min - grow, max: out.max + grow }
    }
}
