//! Owns orthonormal frames around a normal.

use glam::Vec3;

/// A right-handed orthonormal frame; local z is the normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// A frame around a unit normal (Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3).
    #[inline]
    pub fn new(n: Vec3) -> Self {
        let sign = 1.0_f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// A frame around a unit normal whose first tangent points as nearly along `u` as it can; any frame where `u` is
    /// along the normal.
    #[inline]
    pub fn with_tangent(n: Vec3, u: Vec3) -> Self {
        match (u - n * n.dot(u)).try_normalize() {
            Some(s) => Self { s, t: n.cross(s), n },
            None => Self::new(n),
        }
    }

    /// World to local.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::Frame;
    use glam::Vec3;

    #[test]
    fn frames_are_orthonormal_even_at_the_poles() {
        for n in
            [Vec3::Z, -Vec3::Z, Vec3::X, Vec3::new(1e-8, -1e-8, -1.0).normalize(), Vec3::splat(0.577_350_3)]
        {
            let f = Frame::new(n);
            for (a, b, want) in
                [(f.s, f.s, 1.0), (f.t, f.t, 1.0), (f.s, f.t, 0.0), (f.s, f.n, 0.0), (f.t, f.n, 0.0)]
            {
                assert!((a.dot(b) - want).abs() < 1e-6, "{n} {f:?}");
            }
            assert!((f.s.cross(f.t) - n).length() < 1e-6);
        }
    }
}
