//! Owns the tree over a mesh's triangles and the watertight test at its leaves.

use super::{BuildError, Bvh, RayBoxes};
use crate::math::{Aabb, Ray};
use glam::Vec3;

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Triangle, as numbered when the tree was built.
    pub triangle: u32,
    /// Barycentric weights of the second and the third corner.
    pub barycentric: [f32; 2],
}

/// A tree over triangles, whose corners lie in the order of the leaves.
#[derive(Debug, Clone)]
pub struct TriangleBvh {
    bvh: Bvh,
    corners: Vec<[Vec3; 3]>,
}

impl TriangleBvh {
    /// Builds the tree.
    ///
    /// # Errors
    /// A corner is not finite, or there are too many triangles.
    pub fn build(triangles: impl Iterator<Item = [Vec3; 3]>) -> Result<Self, BuildError> {
        let triangles: Vec<[Vec3; 3]> = triangles.collect();
        // A corner that is no number would vanish in a minimum: such a triangle gets the empty box, which is refused.
        let bounds = |t: &[Vec3; 3]| {
            let finite = t.iter().all(|p| p.is_finite());
            if finite { t.iter().fold(Aabb::EMPTY, |b, p| b.with_point(*p)) } else { Aabb::EMPTY }
        };
        let boxes: Vec<Aabb> = triangles.iter().map(bounds).collect();
        let bvh = Bvh::build(&boxes)?;
        let corners = bvh.slots().iter().map(|&s| triangles[s as usize]).collect();
        Ok(Self { bvh, corners })
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        self.bvh.bytes() + self.corners.len() * size_of::<[Vec3; 3]>()
    }

    /// The nearest hit within the ray; of equal distances the triangle with the smaller number.
    pub fn intersect(&self, ray: &Ray) -> Option<TriangleHit> {
        let shear = Shear::new(ray.d);
        let mut best: Option<TriangleHit> = None;
        let mut t_max = ray.t_max;
        self.bvh.traverse(&RayBoxes::new(ray.o, ray.d), &mut t_max, |first, count, t_max| {
            for slot in first..first + count {
                let Some((t, barycentric)) = shear.intersect(ray.o, &self.corners[slot as usize], *t_max)
                else {
                    continue;
                };
                let triangle = self.bvh.slots()[slot as usize];
                if best.is_none_or(|b| t < b.t || (t == b.t && triangle < b.triangle)) {
                    best = Some(TriangleHit { t, triangle, barycentric });
                    *t_max = t;
                }
            }
            false
        });
        best
    }

    /// Whether anything lies within the ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let shear = Shear::new(ray.d);
        let mut t_max = ray.t_max;
        self.bvh.traverse(&RayBoxes::new(ray.o, ray.d), &mut t_max, |first, count, t_max| {
            (first..first + count)
                .any(|s| shear.intersect(ray.o, &self.corners[s as usize], *t_max).is_some())
        })
    }
}

/// The shear that turns a ray into the z axis (Woop, Benthin and Wald 2013, "Watertight Ray/Triangle Intersection").
struct Shear {
    axes: [usize; 3],
    scale: Vec3,
}

impl Shear {
    fn new(d: Vec3) -> Self {
        let a = d.abs();
        let kz = if a.x > a.y {
            if a.x > a.z { 0 } else { 2 }
        } else if a.y > a.z {
            1
        } else {
            2
        };
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        let sz = 1.0 / d[kz];
        Self { axes: [kx, ky, kz], scale: Vec3::new(d[kx] * sz, d[ky] * sz, sz) }
    }

    /// Distance and weights of the second and third corner, for `0 < t <= t_max`.
    #[inline]
    fn intersect(&self, o: Vec3, corners: &[Vec3; 3], t_max: f32) -> Option<(f32, [f32; 2])> {
        let [kx, ky, kz] = self.axes;
        let shear = |p: Vec3| {
            let v = p - o;
            Vec3::new(v[kx] - self.scale.x * v[kz], v[ky] - self.scale.y * v[kz], self.scale.z * v[kz])
        };
        let (a, b, c) = (shear(corners[0]), shear(corners[1]), shear(corners[2]));
        // The sign of an edge function is exact or zero, because a product difference rounds monotonically.
        let mut u = c.x * b.y - c.y * b.x;
        let mut v = a.x * c.y - a.y * c.x;
        let mut w = b.x * a.y - b.y * a.x;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            [u, v, w] = edges_in_double([a, b, c]);
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let t = (u * a.z + v * b.z + w * c.z) * inverse;
        (t > 0.0 && t <= t_max).then_some((t, [v * inverse, w * inverse]))
    }
}

/// The edge functions again where single precision cannot tell the side; products of floats are exact in double.
#[cold]
fn edges_in_double([a, b, c]: [Vec3; 3]) -> [f32; 3] {
    let edge = |p: Vec3, q: Vec3| f64::from(p.x) * f64::from(q.y) - f64::from(p.y) * f64::from(q.x);
    [edge(c, b) as f32, edge(a, c) as f32, edge(b, a) as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Decision, Replicate, Sampler, Stream};
    use crate::warp::sphere_uniform;

    fn random(i: u32, d: Decision) -> Vec3 {
        sphere_uniform(Sampler::new(Stream::new(1, 1), [i, 0], Replicate::A, 0).get_2d(d))
    }

    /// A closed bumpy sphere of shared vertices.
    fn closed_mesh(n: usize) -> Vec<[Vec3; 3]> {
        let point = |i: usize, j: usize| {
            let theta = std::f32::consts::PI * i as f32 / n as f32;
            let (s, c) = if i == 0 {
                (0.0, 1.0)
            } else if i == n {
                (0.0, -1.0)
            } else {
                crate::math::sin_cos(theta)
            };
            let (sp, cp) =
                crate::math::sin_cos(std::f32::consts::TAU * (j % (2 * n)) as f32 / (2 * n) as f32);
            Vec3::new(s * cp, s * sp, c)
                * (1.0 + 0.1 * ((i * 7 + (j % (2 * n)) * 13 * usize::from(i > 0 && i < n)) % 5) as f32)
        };
        let quad = |i, j| {
            [
                [point(i, j), point(i + 1, j), point(i + 1, j + 1)],
                [point(i, j), point(i + 1, j + 1), point(i, j + 1)],
            ]
        };
        (0..n)
            .flat_map(|i| (0..2 * n).flat_map(move |j| quad(i, j)))
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2])
            .collect()
    }

    #[test]
    fn nearest_hits_equal_brute_force() {
        let mesh = closed_mesh(20);
        let tree = TriangleBvh::build(mesh.iter().copied()).unwrap();
        for i in 0..2000 {
            let ray = Ray::new(random(i, Decision::Filter) * 3.0, random(i, Decision::Lens));
            let shear = Shear::new(ray.d);
            let want = mesh
                .iter()
                .enumerate()
                .filter_map(|(k, t)| shear.intersect(ray.o, t, f32::INFINITY).map(|(t, b)| (t, k as u32, b)))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let got = tree.intersect(&ray).map(|h| (h.t, h.triangle, h.barycentric));
            assert_eq!(got, want);
            assert_eq!(tree.occluded(&ray), want.is_some());
        }
    }

    /// Hard case 12: rays from inside aimed exactly at vertices and edges of a closed mesh never leave it.
    #[test]
    fn a_closed_mesh_does_not_leak_at_edges_and_vertices() {
        for scale in [1.0, 1e-3, 1e4] {
            let mesh: Vec<[Vec3; 3]> = closed_mesh(24).into_iter().map(|t| t.map(|p| p * scale)).collect();
            let tree = TriangleBvh::build(mesh.iter().copied()).unwrap();
            for (i, triangle) in mesh.iter().enumerate() {
                let o = random(i as u32, Decision::Filter) * (0.3 * scale);
                let edges = (0..3).map(|k| (triangle[k], triangle[(k + 1) % 3]));
                for target in edges.flat_map(|(p, q)| [p, (p + q) * 0.5, p + (q - p) * 0.3]) {
                    assert!(tree.intersect(&Ray::new(o, target - o)).is_some(), "leak at {target} from {o}");
                }
            }
        }
    }

    #[test]
    fn axis_parallel_rays_hit_walls_far_away() {
        let quad = |z: f32| {
            let p = |x: f32, y: f32| Vec3::new(x, y, z);
            [[p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)], [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)]]
        };
        for z in [10.0, 1e3, 1e5] {
            let tree = TriangleBvh::build(quad(z).into_iter()).unwrap();
            for i in 0..1000 {
                let o =
                    Vec3::new(random(i, Decision::Filter).x * 0.99, random(i, Decision::Lens).x * 0.99, 0.0);
                assert!(tree.intersect(&Ray::new(o, Vec3::Z)).is_some());
            }
        }
    }

    #[test]
    fn empty_and_bad_input() {
        let tree = TriangleBvh::build(std::iter::empty()).unwrap();
        assert!(tree.intersect(&Ray::new(Vec3::ZERO, Vec3::Z)).is_none());
        for bad in [f32::NAN, f32::INFINITY] {
            let triangle = [Vec3::ZERO, Vec3::X, Vec3::splat(bad)];
            assert_eq!(TriangleBvh::build([triangle].into_iter()).err(), Some(BuildError::BadBox(0)));
        }
    }
}
