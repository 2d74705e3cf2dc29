//! Owns the trees that rays walk: one over the triangles of most meshes together, where they stand in the world, and one
//! over that and all other objects.
//!
//! Meshes overlap: a floor, the walls around it and what stands on it each have boxes of the size of a room. A tree over
//! all their triangles does not care.

use super::object::{Hit, Object, PreparedMesh, Shape};
use crate::bvh::triangle::TriangleBvh;
use crate::bvh::{BuildError, Bvh, Cast, Costs};
use crate::math::{Aabb, Transform};
use std::sync::{Arc, Mutex, PoisonError};

/// The trees of a scene.
#[derive(Debug)]
pub(super) struct Trees {
    /// Over the boxes of what follows.
    pub(super) tree: Bvh,
    /// By primitive of that tree.
    pub(super) entries: Vec<Entry>,
    soup: Arc<Soup>,
}

/// What a ray is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Entry {
    /// The object with this number.
    Object(u32),
    /// All meshes that are in the [`Soup`].
    Soup,
}

/// An object is a tree of its own, or a march: worth some boxes.
const COSTS: Costs = Costs { leaf: 0.0, primitive: 2.0, most: 4 };

impl Trees {
    /// The trees over objects; `kept` holds the soup of the last time.
    ///
    /// # Errors
    /// Where an object's box is not finite.
    pub(super) fn new(objects: &[Object], kept: &Kept) -> Result<Self, BuildError> {
        let members = members(objects);
        let soup = kept.soup(objects, &members)?;
        let alone = |number: &u32| members.binary_search(number).is_err();
        let mut entries: Vec<Entry> = (0..objects.len() as u32).filter(alone).map(Entry::Object).collect();
        if !members.is_empty() {
            entries.push(Entry::Soup);
        }
        let bounds = |entry: &Entry| match *entry {
            Entry::Object(number) => objects[number as usize].bounds(),
            Entry::Soup => soup.tree.bounds(),
        };
        let boxes: Vec<Aabb> = entries.iter().map(bounds).collect();
        for entry in &entries {
            if let Entry::Object(number) = *entry {
                objects[number as usize].prepare();
            }
        }
        Ok(Self { tree: Bvh::build(&boxes, COSTS)?, entries, soup })
    }

    /// The nearest hit of a ray with the soup up to `t_max`.
    pub(super) fn in_soup(&self, cast: &Cast, t_max: f32) -> Option<Hit> {
        let hit = self.soup.tree.intersect(cast, t_max)?;
        let (object, first) = self.soup.owner(hit.triangle);
        Some(Hit { t: hit.t, object, primitive: hit.triangle - first, barycentric: hit.barycentric })
    }

    /// Whether a ray meets the soup up to `t_max`.
    pub(super) fn soup_occludes(&self, cast: &Cast, t_max: f32) -> bool {
        self.soup.tree.occluded(cast, t_max)
    }
}

/// Triangles of meshes in the world, in the order of the objects.
#[derive(Debug)]
struct Soup {
    tree: TriangleBvh,
    /// Number of each object, and of its first triangle.
    owners: Vec<(u32, u32)>,
    /// What it is made of.
    placed: Vec<Placed>,
}

impl Soup {
    /// The object that a triangle belongs to, and the number of its first triangle.
    fn owner(&self, triangle: u32) -> (u32, u32) {
        let after = self.owners.partition_point(|&(_, first)| first <= triangle);
        self.owners[after - 1]
    }
}

/// A mesh in its place.
#[derive(Debug, Clone)]
struct Placed {
    object: u32,
    mesh: Arc<PreparedMesh>,
    transform: Transform,
}

impl Placed {
    fn is(&self, other: &Self) -> bool {
        self.object == other.object
            && Arc::ptr_eq(&self.mesh, &other.mesh)
            && self.transform == other.transform
    }
}

/// The soup of the frame before, which that of the next frame often is.
#[derive(Debug, Default)]
pub(super) struct Kept(Mutex<Option<Arc<Soup>>>);

impl Kept {
    fn soup(&self, objects: &[Object], members: &[u32]) -> Result<Arc<Soup>, BuildError> {
        let placed: Vec<Placed> = members
            .iter()
            .filter_map(|&object| match &objects[object as usize].shape {
                Shape::Mesh { mesh, transform, .. } => {
                    Some(Placed { object, mesh: Arc::clone(mesh), transform: *transform })
                }
                Shape::Sphere { .. } | Shape::Sdf { .. } => None,
            })
            .collect();
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let same = |soup: &&Arc<Soup>| {
            soup.placed.len() == placed.len() && soup.placed.iter().zip(&placed).all(|(a, b)| a.is(b))
        };
        if let Some(soup) = kept.as_ref().filter(same) {
            return Ok(Arc::clone(soup));
        }
        let mut first = 0;
        let owners = placed.iter().map(|placed| {
            let begin = first;
            first += placed.mesh.mesh.triangles.len() as u32;
            (placed.object, begin)
        });
        let owners = owners.collect();
        let corners = placed.iter().flat_map(|placed| {
            placed.mesh.corners().map(|corners| corners.map(|corner| placed.transform.point(corner)))
        });
        let soup = Arc::new(Soup { tree: TriangleBvh::build(corners)?, owners, placed });
        *kept = Some(Arc::clone(&soup));
        Ok(soup)
    }
}

/// Most triangles of all places of a mesh together for which they are all put into the soup, where there are several.
const REPEATED: usize = 1 << 16;

/// The objects whose triangles are put together, ascending: meshes without holes that stand in one place, or are small.
fn members(objects: &[Object]) -> Vec<u32> {
    let mesh = |object: &Object| match &object.shape {
        Shape::Mesh { mesh, .. } if !object.holes => Some(Arc::clone(mesh)),
        Shape::Mesh { .. } | Shape::Sphere { .. } | Shape::Sdf { .. } => None,
    };
    let mut places: Vec<*const PreparedMesh> =
        objects.iter().filter_map(mesh).map(|m| Arc::as_ptr(&m)).collect();
    places.sort_unstable();
    let belongs = |object: &Object| {
        mesh(object).is_some_and(|mesh| {
            let at = Arc::as_ptr(&mesh);
            let count = places.partition_point(|&p| p <= at) - places.partition_point(|&p| p < at);
            count == 1 || count.saturating_mul(mesh.mesh.triangles.len()) <= REPEATED
        })
    };
    (0..).zip(objects).filter(|(_, object)| belongs(object)).map(|(number, _)| number).collect()
}

#[cfg(test)]
mod tests {
    use super::{Entry, Kept, Trees};
    use crate::bvh::Cast;
    use crate::math::{Ray, Transform, offset_origin};
    use crate::mesh::Mesh;
    use crate::sampler::{Decision, Replicate, Sampler, Stream};
    use crate::scene::object::{Needs, Object, PreparedMesh, Shape};
    use crate::scene::tally::Tally;
    use crate::warp::sphere_uniform;
    use glam::{DAffine3, DQuat, DVec3, EulerRot, Vec3};
    use std::sync::Arc;

    /// A random direction, one of many.
    fn random(i: u32, decision: Decision) -> Vec3 {
        sphere_uniform(Sampler::new(Stream::new(7, 1), [i, 0], Replicate::A, 0).get_2d(decision))
    }

    fn object(mesh: &Arc<PreparedMesh>, transform: &Transform, holes: bool) -> Object {
        let shape = Shape::Mesh { mesh: Arc::clone(mesh), transform: *transform, flat: false, flip_v: false };
        let needs = Needs::default();
        Object { shape, material: 0, emitter: None, flip: false, needs, holes, interior: None }
    }

    /// An octahedron with long edges and a short one.
    fn mesh() -> Arc<PreparedMesh> {
        let positions =
            [Vec3::X * 3.0, Vec3::NEG_X * 3.0, Vec3::Y, Vec3::NEG_Y, Vec3::Z * 0.1, Vec3::NEG_Z * 0.1];
        let triangles: Vec<[u32; 3]> =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        let mesh = Mesh { positions: positions.to_vec(), triangles, ..Mesh::default() };
        Arc::new(PreparedMesh::new(mesh).expect("finite"))
    }

    /// Turned, stretched, mirrored, near and far away.
    fn objects() -> Vec<Object> {
        let place = |scale: DVec3, turn: f64, shift: DVec3| {
            let turn = DQuat::from_euler(EulerRot::XYZ, turn, 0.7 * turn, 2.0 * turn);
            Transform::new(DAffine3::from_scale_rotation_translation(scale, turn, shift))
                .expect("can be undone")
        };
        let far = DVec3::new(3000.0, -1000.0, 500.0);
        vec![
            object(&mesh(), &Transform::IDENTITY, false),
            object(&mesh(), &place(DVec3::new(1.0, 2.0, 0.5), 1.0, DVec3::new(2.0, 0.3, -1.0)), false),
            object(&mesh(), &place(DVec3::new(-1.0, 1.0, 1.0), 0.4, DVec3::new(-2.0, 1.3, 1.0)), true),
            object(&mesh(), &place(DVec3::splat(40.0), 2.2, far), false),
            object(&mesh(), &place(DVec3::splat(0.01), 0.9, DVec3::new(0.0, 2.0, 0.0)), false),
        ]
    }

    #[test]
    fn the_soup_is_met_where_its_meshes_are() {
        let objects = objects();
        let trees = Trees::new(&objects, &Kept::default()).expect("a tree");
        assert_eq!(trees.entries, [Entry::Object(2), Entry::Soup], "what has holes stands alone");
        let mut hits = [0; 5];
        for i in 0..40_000 {
            let target = &objects[i as usize % 5].bounds();
            let size = 0.5 * target.size().length();
            let d = random(i, Decision::Lens);
            let from = target.center() + d * (2.0 * size) + random(i, Decision::Filter) * (0.4 * size);
            let ray = Ray::new(from, -d);
            let cast = Cast::new(ray.o, ray.d);
            let found = trees.in_soup(&cast, ray.t_max);
            let alone = (0..5).filter(|&number| number != 2).filter_map(|number| {
                let hit = objects[number].intersect(&ray, &cast, 0.0, &mut Tally::default());
                hit.map(|(t, primitive, _)| (t, number as u32, primitive))
            });
            let expected = alone.min_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(trees.soup_occludes(&cast, ray.t_max), found.is_some());
            let (Some(found), Some(expected)) = (found, expected) else {
                assert_eq!(found.is_some(), expected.is_some(), "{ray:?}");
                continue;
            };
            hits[found.object as usize] += 1;
            // Both are on the plane, as well as numbers of that size tell.
            let ng = objects[found.object as usize].surface(&ray, &found).ng;
            let apart = ((found.t - expected.0) * ng.dot(ray.d)).abs();
            assert!(apart <= 1e-6 * from.abs().max_element().max(size), "{found:?} {expected:?}");
            assert_eq!(found.object, expected.1);
        }
        assert!(hits.iter().enumerate().all(|(number, &count)| count > 1500 || number == 2), "{hits:?}");
    }

    #[test]
    fn surfaces_of_the_soup_do_not_shadow_themselves() {
        let objects = objects();
        let trees = Trees::new(&objects, &Kept::default()).expect("a tree");
        for i in 0..40_000 {
            let target = &objects[[0, 1, 3, 4][i as usize % 4]].bounds();
            let size = 0.5 * target.size().length();
            let d = random(i, Decision::Lens);
            let from = target.center() + d * (2.0 * size) + random(i, Decision::Filter) * (0.4 * size);
            let ray = Ray::new(from, -d);
            let Some(hit) = trees.in_soup(&Cast::new(ray.o, ray.d), ray.t_max) else { continue };
            let surface = objects[hit.object as usize].surface(&ray, &hit);
            // Octahedra are convex: nothing is above a face, even close to it.
            let above = surface.ng * 1e-3_f32.copysign(surface.ng.dot(d)) + random(i, Decision::Filter);
            let above = above * 1.0_f32.copysign(above.dot(surface.ng) * surface.ng.dot(d));
            let o = offset_origin(surface.p, surface.error, surface.ng, above);
            let other = trees.in_soup(&Cast::new(o, above), f32::INFINITY);
            assert!(other.is_none_or(|other| other.object != hit.object), "{hit:?} {other:?}");
        }
    }

    #[test]
    fn the_soup_of_the_frame_before_is_kept_unless_something_has_moved() {
        let (mut objects, kept) = (objects(), Kept::default());
        let first = Trees::new(&objects, &kept).expect("a tree");
        let second = Trees::new(&objects, &kept).expect("a tree");
        assert!(Arc::ptr_eq(&first.soup, &second.soup));
        let moved = Transform::new(DAffine3::from_translation(DVec3::Y)).expect("can be undone");
        objects[0] = object(&mesh(), &moved, false);
        let third = Trees::new(&objects, &kept).expect("a tree");
        assert!(!Arc::ptr_eq(&first.soup, &third.soup));
    }
}
