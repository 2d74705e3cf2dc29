//! Owns the tree over a mesh's triangles and the watertight test at its leaves.

use super::leaf::{self, Leaves};
use super::{BuildError, Bvh, Cast, Costs};
use crate::math::Aabb;
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
    leaves: Leaves,
}

/// The box around a triangle.
fn around(triangle: &[Vec3; 3]) -> Aabb {
    // A corner that is no number would vanish in a minimum: such a triangle gets the empty box, which is refused.
    let finite = triangle.iter().all(|p| p.is_finite());
    if finite { triangle.iter().fold(Aabb::EMPTY, |b, p| b.with_point(*p)) } else { Aabb::EMPTY }
}

/// Eight triangles are tested at the price of one.
const COSTS: Costs = Costs { leaf: 0.8, primitive: 0.06, most: leaf::LANES as u32 };

impl Default for TriangleBvh {
    /// Of no triangles.
    fn default() -> Self {
        Self { bvh: Bvh::empty(), leaves: Leaves::new(0, std::iter::empty()) }
    }
}

impl TriangleBvh {
    /// Builds the tree.
    ///
    /// # Errors
    /// A corner is not finite, or there are too many triangles.
    pub fn build(triangles: impl Iterator<Item = [Vec3; 3]>) -> Result<Self, BuildError> {
        let triangles: Vec<[Vec3; 3]> = triangles.collect();
        let boxes: Vec<Aabb> = triangles.iter().map(around).collect();
        let bvh = Bvh::build(&boxes, COSTS)?;
        let corners: Vec<[Vec3; 3]> = bvh.slots().iter().map(|&s| triangles[s as usize]).collect();
        let ranges = bvh.leaves();
        let leaves = ranges.iter().map(|&(first, count)| &corners[first as usize..(first + count) as usize]);
        let leaves = Leaves::new(corners.len(), leaves);
        Ok(Self { bvh, leaves })
    }

    /// The box around triangles of which a tree can be built.
    ///
    /// # Errors
    /// As [`TriangleBvh::build`].
    pub fn check(triangles: impl Iterator<Item = [Vec3; 3]>) -> Result<Aabb, BuildError> {
        let mut bounds = Aabb::EMPTY;
        for (number, triangle) in triangles.enumerate() {
            let it = around(&triangle);
            Bvh::check(number, &it)?;
            bounds = bounds.union(it);
        }
        Ok(bounds)
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        self.bvh.bytes() + self.leaves.bytes()
    }

    /// The nearest hit of a ray up to `t_max`; of equal distances the triangle with the smaller number.
    pub fn intersect(&self, cast: &Cast, mut t_max: f32) -> Option<TriangleHit> {
        let mut best: Option<TriangleHit> = None;
        self.bvh.traverse(&cast.boxes, &mut t_max, |first, count, t_max| {
            let (mut hits, met) = self.leaves.test(first, count, &cast.shear, *t_max);
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize;
                hits &= hits - 1;
                let t = met.t.to_array()[lane];
                let triangle = self.bvh.slots()[first as usize + lane];
                if best.is_none_or(|b| t < b.t || (t == b.t && triangle < b.triangle)) {
                    let barycentric = [met.v.to_array()[lane], met.w.to_array()[lane]];
                    best = Some(TriangleHit { t, triangle, barycentric });
                    *t_max = t;
                }
            }
            false
        });
        best
    }

    /// Whether a ray meets anything up to `t_max`.
    pub fn occluded(&self, cast: &Cast, t_max: f32) -> bool {
        self.bvh
            .any(&cast.boxes, t_max, |first, count| self.leaves.test(first, count, &cast.shear, t_max).0 != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::leaf::Shear;
    use crate::math::Ray;
    use crate::sampler::{Decision, Replicate, Sampler, Stream};
    use crate::warp::sphere_uniform;

    fn nearest(tree: &TriangleBvh, ray: &Ray) -> Option<TriangleHit> {
        tree.intersect(&Cast::new(ray.o, ray.d), ray.t_max)
    }

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
            // Each triangle in a leaf of its own.
            let shear = Shear::new(ray.o, ray.d);
            let alone = |t: &[Vec3; 3]| {
                let (hit, met) = Leaves::new(1, [&[*t][..]].into_iter()).test(0, 1, &shear, f32::INFINITY);
                (hit != 0).then(|| (met.t.to_array()[0], [met.v.to_array()[0], met.w.to_array()[0]]))
            };
            let want = mesh
                .iter()
                .enumerate()
                .filter_map(|(k, t)| alone(t).map(|(t, b)| (t, k as u32, b)))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let got = nearest(&tree, &ray).map(|h| (h.t, h.triangle, h.barycentric));
            assert_eq!(got, want);
            assert_eq!(tree.occluded(&Cast::new(ray.o, ray.d), ray.t_max), want.is_some());
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
                    assert!(nearest(&tree, &Ray::new(o, target - o)).is_some(), "leak at {target} from {o}");
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
                assert!(nearest(&tree, &Ray::new(o, Vec3::Z)).is_some());
            }
        }
    }

    #[test]
    fn empty_and_bad_input() {
        let tree = TriangleBvh::build(std::iter::empty()).unwrap();
        assert!(nearest(&tree, &Ray::new(Vec3::ZERO, Vec3::Z)).is_none());
        for bad in [f32::NAN, f32::INFINITY] {
            let triangle = [Vec3::ZERO, Vec3::X, Vec3::splat(bad)];
            assert_eq!(TriangleBvh::build([triangle].into_iter()).err(), Some(BuildError::BadBox(0)));
        }
    }
}
