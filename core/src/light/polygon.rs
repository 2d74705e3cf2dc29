//! Owns sampling flat convex polygons by the solid angle that they fill, for triangles and rectangles.
//!
//! Near ones in f64 from the exact differences of f32 positions, and by half angles: nothing cancels, whether the polygon is
//! a speck, fills the hemisphere, or is seen along its plane.

use glam::{DVec3, Vec2, Vec3};

/// What of a polygon is the same from everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plate {
    /// Unit normal of the front.
    normal: DVec3,
    /// Length of the cross product of the edges at the first corner: twice the area of the fan's triangles.
    cross: f64,
    area: f64,
    /// Squared length of the longer of those edges.
    reach2: f64,
}

impl Plate {
    /// That of a polygon of `N` corners (3 or 4, a parallelogram), counter-clockwise from its front; `None` when it has no
    /// area.
    pub(super) fn new<const N: usize>(corners: [Vec3; N]) -> Option<Self> {
        let [first, last] = [1, N - 1].map(|k| corners[k].as_dvec3() - corners[0].as_dvec3());
        let product = first.cross(last);
        let (normal, cross) = (product.try_normalize()?, product.length());
        let reach2 = first.length_squared().max(last.length_squared());
        (cross as f32 > 0.0).then_some(Self { normal, cross, area: cross * 0.5 * (N - 2) as f64, reach2 })
    }

    /// Unit normal of the front.
    pub(super) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Area of the polygon.
    pub(super) fn area(&self) -> f64 {
        self.area
    }
}

/// A polygon as seen from a point in front of it. How it is sampled depends on the polygon and the point only.
#[derive(Debug, Clone, Copy)]
pub(super) enum Seen<const N: usize> {
    /// By area, because it is so small and far that the density per solid angle hardly varies.
    Far(Far),
    /// Uniformly over the solid angle.
    Near(Near<N>),
}

/// A polygon that is sampled by area.
#[derive(Debug, Clone, Copy)]
pub(super) struct Far {
    /// The first corner relative to the point, and the edges from there to the second and to the last.
    corner: Vec3,
    edges: [Vec3; 2],
    /// One over the height of the point above the plane and over the area.
    scale: f32,
}

/// A polygon that is sampled by solid angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near<const N: usize> {
    /// Corners relative to the point, counter-clockwise from its side.
    corners: [DVec3; N],
    normal: DVec3,
    /// Height of the point above the plane.
    height: f64,
    cross: f64,
    /// Solid angles of the fan's triangles up to each corner.
    angles: [f64; N],
}

impl<const N: usize> Seen<N> {
    /// Polygons whose edges are longer than this part of the distance are sampled by solid angle. By area the density
    /// per solid angle goes with the cube of the distance, so it varies smoothly, and by a factor of three at most.
    const FAR: f64 = 0.5;

    /// Points that are less high above the plane, in parts of the longest edge, count as within it. Positions in f32
    /// could not tell, and who lies on a light finds it by scattering.
    const IN_PLANE: f64 = 1e-9;

    /// The polygon with these corners seen from `p`; `None` from behind, from within its plane, and when it has no solid
    /// angle.
    pub(super) fn new(plate: &Plate, corners: [Vec3; N], p: Vec3) -> Option<Self> {
        let first = corners[0].as_dvec3() - p.as_dvec3();
        let height = -first.dot(plate.normal);
        if height.is_nan()
            || height <= 0.0
            || height * height <= Self::IN_PLANE * Self::IN_PLANE * plate.reach2
        {
            return None;
        }
        let seen = if plate.reach2 < Self::FAR * Self::FAR * first.length_squared() {
            let edges = [corners[1] - corners[0], corners[N - 1] - corners[0]];
            Self::Far(Far { corner: first.as_vec3(), edges, scale: (1.0 / (height * plate.area)) as f32 })
        } else {
            let corners = corners.map(|c| c.as_dvec3() - p.as_dvec3());
            let angles = solid_angles(&corners, height * plate.cross);
            Self::Near(Near { corners, normal: plate.normal, height, cross: plate.cross, angles })
        };
        let density = seen.pdf_at(first.as_vec3());
        (density > 0.0 && density.is_finite()).then_some(seen)
    }

    /// Density per solid angle of sampling the point at `towards` (relative to the receiver).
    fn pdf_at(&self, towards: Vec3) -> f32 {
        match self {
            Self::Far(far) => far.pdf_at(towards),
            Self::Near(near) => (1.0 / near.angles[N - 1]) as f32,
        }
    }

    /// Density per solid angle of sampling its point `q`, seen from `p`.
    pub(super) fn pdf(&self, p: Vec3, q: Vec3) -> f32 {
        self.pdf_at(q - p)
    }

    /// A point: the direction to it, its coordinates along the edges from the first to the second and to the last
    /// corner, and its density.
    pub(super) fn sample(&self, u: Vec2, uniform: impl FnOnce(Vec2) -> Vec2) -> (Vec3, Vec2, f32) {
        match self {
            Self::Far(far) => far.sample(uniform(u)),
            Self::Near(near) => near.sample(u),
        }
    }
}

impl Far {
    /// Squared distance over cosine and area; the cosine is height over distance.
    fn pdf_at(&self, towards: Vec3) -> f32 {
        let d2 = towards.length_squared();
        d2 * d2.sqrt() * self.scale
    }

    fn sample(&self, at: Vec2) -> (Vec3, Vec2, f32) {
        let towards = self.corner + self.edges[0] * at.x + self.edges[1] * at.y;
        (towards.normalize(), at, self.pdf_at(towards))
    }
}

impl<const N: usize> Near<N> {
    fn sample(&self, u: Vec2) -> (Vec3, Vec2, f32) {
        let [first, last] = [self.corners[1] - self.corners[0], self.corners[N - 1] - self.corners[0]];
        let whole = self.angles[N - 1];
        let target = f64::from(u.x) * whole;
        let k = (1..N - 2).take_while(|&k| target >= self.angles[k + 1]).count() + 1;
        let triangle = [self.corners[0], self.corners[k], self.corners[k + 1]];
        let wi = sample_triangle(triangle, self.height * self.cross, target - self.angles[k], u.y);
        let hit = wi * (self.height / -wi.dot(self.normal).min(-f64::MIN_POSITIVE)) - self.corners[0];
        // Coordinates of the hit on the (oblique) axes of the two edges.
        let along = |v: DVec3, w: DVec3| (v.cross(w).dot(self.normal) / self.cross).clamp(0.0, 1.0) as f32;
        let at = Vec2::new(along(hit, last), along(first, hit));
        (wi.as_vec3(), at, (1.0 / whole) as f32)
    }
}

/// Solid angles of the triangles fanned out from the first corner, summed up to each corner (Van Oosterom and
/// Strackee 1983). `triple` is the triple product of each triangle's corners.
fn solid_angles<const N: usize>(corners: &[DVec3; N], triple: f64) -> [f64; N] {
    let l = corners.map(DVec3::length);
    let mut sums = [0.0; N];
    for k in 1..N - 1 {
        let [a, b, c] = [corners[0], corners[k], corners[k + 1]];
        let denominator = l[0] * l[k] * l[k + 1] + a.dot(b) * l[k + 1] + b.dot(c) * l[0] + a.dot(c) * l[k];
        sums[k + 1] = sums[k] + 2.0 * libm::atan2(triple, denominator);
    }
    sums
}

/// A direction into the triangle with corners b, a, c: uniform over its solid angle (Arvo 1995, "Stratified Sampling
/// of Spherical Triangles", in half angles).
///
/// The side from a to c is cut at the point up to which the triangle has the solid angle `part`; then the arc from b
/// to there at the share `v` of 1 − cos. With E the solid angle, α the angle at a, and b, c the sides there,
/// tan(b/2) tan(c/2) = sin(E/2) / sin(α − E/2).
fn sample_triangle([b, a, c]: [DVec3; 3], triple: f64, part: f64, v: f32) -> DVec3 {
    let scale = a.length() * b.length() * c.length();
    let [a, b, c] = [a.normalize(), b.normalize(), c.normalize()];
    // Sine and cosine of α, both times the sines of the adjoining sides.
    let (sin, cos) = (triple / scale, a.cross(b).dot(a.cross(c)));
    let (sin_part, cos_part) = libm::sincos(0.5 * part);
    let sides = (sin * sin + cos * cos).sqrt();
    let num = sin_part * (a + b).length() * sides;
    let den = ((sin * cos_part - cos * sin_part) * (a - b).length()).max(0.0);
    let h2 = num * num + den * den;
    let (sin_cut, cos_cut) = (2.0 * num * den / h2, (den - num) * (den + num) / h2);
    let cut = a * cos_cut + perpendicular(c - a, a) * sin_cut;
    let chord = cut - b;
    let h = f64::from(v) * 0.5 * chord.length_squared();
    let wi = b * (1.0 - h) + perpendicular(chord, b) * (h * (2.0 - h)).max(0.0).sqrt();
    wi.normalize_or(b)
}

/// The unit vector along the part of `v` that is perpendicular to the unit vector `axis`.
fn perpendicular(v: DVec3, axis: DVec3) -> DVec3 {
    (v - axis * axis.dot(v)).normalize_or_zero()
}
