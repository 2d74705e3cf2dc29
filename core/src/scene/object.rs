//! Owns the objects of a compiled scene: what a ray meets, and the surface at a hit.

use super::PLAIN;
use super::media::Interior;
use super::tally::Tally;
use crate::bvh::triangle::TriangleBvh;
use crate::bvh::{BuildError, Cast};
use crate::math::{Aabb, Ray, Transform, acos, atan2, even_error, gamma};
use crate::mesh::{Mesh, side};
use crate::sdf::{MarchStats, Sdf, SdfRay, Traps};
use crate::texture::Place;
use glam::{Vec2, Vec3, Vec3Swizzles as _};
use std::borrow::Cow;
use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::{Arc, OnceLock};

/// A mesh and the tree over its triangles, shared by its instances and by all frames.
#[derive(Debug)]
pub struct PreparedMesh {
    /// Triangles in the units of the file.
    pub mesh: Mesh,
    bounds: Aabb,
    /// The tree over them, built when it is first asked for: by objects that are not in the tree of all ([`Object::prepare`]).
    tree: OnceLock<TriangleBvh>,
}

impl PreparedMesh {
    /// A mesh, ready to be placed.
    ///
    /// # Errors
    /// A corner is not finite, or there are too many triangles.
    pub(super) fn new(mesh: Mesh) -> Result<Self, BuildError> {
        let bounds = TriangleBvh::check(corners(&mesh))?;
        Ok(Self { mesh, bounds, tree: OnceLock::new() })
    }

    /// The corners of its triangles.
    pub(super) fn corners(&self) -> impl Iterator<Item = [Vec3; 3]> {
        corners(&self.mesh)
    }

    fn tree(&self) -> &TriangleBvh {
        // What could go wrong was checked at the start.
        self.tree.get_or_init(|| TriangleBvh::build(self.corners()).unwrap_or_default())
    }
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [Vec3; 3]> {
    mesh.triangles.iter().map(|corners| corners.map(|index| mesh.positions[index as usize]))
}

/// The shape of an object.
#[derive(Debug, Clone)]
pub(super) enum Shape {
    Mesh {
        mesh: Arc<PreparedMesh>,
        transform: Transform,
        flat: bool,
        flip_v: bool,
    },
    Sphere {
        center: Vec3,
        radius: f32,
    },
    /// `number` counts the objects made of distance functions.
    Sdf {
        sdf: Box<Sdf>,
        transform: Transform,
        number: u32,
    },
}

/// Something that a ray can meet.
#[derive(Debug, Clone)]
pub(super) struct Object {
    pub(super) shape: Shape,
    /// Index of the material.
    pub(super) material: u32,
    /// Where the numbers of the lights that its primitives are begin in the scene's list, if they shine.
    pub(super) emitter: Option<u32>,
    /// Turns front and back around.
    pub(super) flip: bool,
    /// What its material needs to know of a hit.
    pub(super) needs: Needs,
    /// Whether it may be there in part only, so that rays may cross it.
    pub(super) holes: bool,
    /// What fills it, if something does.
    pub(super) interior: Option<Interior>,
}

/// What materials need to know of a hit besides the place.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Needs {
    /// Where u and v point.
    pub(super) tangents: bool,
    /// The orbits of fractals.
    pub(super) traps: bool,
}

/// Where a ray meets the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Object, as numbered by the scene.
    pub object: u32,
    /// Triangle of a mesh; 0 elsewhere.
    pub primitive: u32,
    /// Barycentric weights of the triangle's second and third corner; 0 elsewhere.
    pub barycentric: [f32; 2],
}

impl Hit {
    /// Whether it comes before another hit of the same ray: of equal distances the smaller object does.
    pub(super) fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.object < other.object)
    }

    /// The first of two hits of a ray, where there are any.
    pub(super) fn nearer(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        match (a, b) {
            (Some(a), Some(b)) => Some(if b.is_before(&a) { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

/// The surface at a hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Position in the world.
    pub p: Vec3,
    /// Bound of the position's error by coordinate.
    pub error: Vec3,
    /// Unit geometric normal of the front side.
    pub ng: Vec3,
    /// Unit shading normal, on the side of `ng`.
    pub ns: Vec3,
    /// Texture coordinates, v upwards.
    pub uv: Vec2,
    /// Position in the space of the object: that of a mesh's file, of a tree of distance functions, or around the centre of
    /// a sphere.
    pub solid: Vec3,
    /// Orbit traps, where the material needs them and the object has them.
    pub traps: Traps,
    /// Change of position by u and by v, where the material needs it and the surface has it.
    pub tangents: Option<[Vec3; 2]>,
    /// Object, as numbered by the scene.
    pub object: u32,
    /// Triangle of a mesh; 0 elsewhere.
    pub primitive: u32,
}

impl Object {
    /// The box around it in the world.
    pub(super) fn bounds(&self) -> Aabb {
        match &self.shape {
            Shape::Mesh { mesh, transform, .. } => mesh.bounds.transformed(transform.to_world()),
            Shape::Sphere { center, radius } => {
                // One rounding step more than the radius, so that the poles lie inside.
                let reach = Vec3::splat(*radius) + (center.abs() + *radius) * (2.0 * f32::EPSILON);
                Aabb { min: *center - reach, max: *center + reach }
            }
            Shape::Sdf { sdf, transform, .. } => sdf.bounds().transformed(transform.to_world()),
        }
    }

    /// Builds what rays would have to wait for: the tree of a mesh that stands by itself.
    pub(super) fn prepare(&self) {
        if let Shape::Mesh { mesh, .. } = &self.shape {
            mesh.tree();
        }
    }

    /// The nearest hit within the ray as (t, primitive, barycentric); `cast` is the ray, prepared.
    pub(super) fn intersect(
        &self,
        ray: &Ray,
        cast: &Cast,
        spread: f32,
        tally: &mut Tally,
    ) -> Option<(f32, u32, [f32; 2])> {
        match &self.shape {
            Shape::Mesh { mesh, transform, .. } => {
                let hit = mesh.tree().intersect(&cast_to_local(ray, cast, transform), ray.t_max);
                hit.map(|h| (h.t, h.triangle, h.barycentric))
            }
            Shape::Sphere { center, radius } => {
                intersect_sphere(ray, *center, *radius).map(|t| (t, 0, [0.0; 2]))
            }
            Shape::Sdf { sdf, transform, number } => {
                let mut stats = MarchStats::default();
                let hit = sdf.intersect(&to_march(ray, transform, spread), &mut stats);
                tally.add(*number, &stats);
                hit.map(|t| (t, 0, [0.0; 2]))
            }
        }
    }

    /// The distance function that it is made of, if it is.
    pub(super) fn distance_function(&self) -> Option<&Sdf> {
        match &self.shape {
            Shape::Sdf { sdf, .. } => Some(sdf),
            Shape::Mesh { .. } | Shape::Sphere { .. } => None,
        }
    }

    /// Whether rays are marched to it, which is done for many at a time.
    pub(super) fn is_marched(&self) -> bool {
        !PLAIN && self.distance_function().is_some_and(|sdf| !sdf.is_closed())
    }

    /// The hits of many rays with a distance function: `ended` gets the name of a ray, its `t` if it hit, and the
    /// evaluations that took; rays that do not come near are left out.
    pub(super) fn march_all<N: Copy>(
        &self,
        rays: &[(N, Ray)],
        spread: f32,
        tally: &mut Tally,
        ended: impl FnMut(N, Option<f32>, u32),
    ) {
        let Shape::Sdf { sdf, transform, number } = &self.shape else { return };
        let mut stats = MarchStats::default();
        let local = rays.iter().map(|(name, ray)| (*name, to_march(ray, transform, spread)));
        sdf.intersect_all(local, &mut stats, ended);
        tally.add(*number, &stats);
    }

    /// Marches many rays to it: `ended` gets whether each has a hit, and its evaluations, as above.
    pub(super) fn march_any<N: Copy>(
        &self,
        rays: &[(N, Ray)],
        tally: &mut Tally,
        ended: impl FnMut(N, bool, u32),
    ) {
        let Shape::Sdf { sdf, transform, number } = &self.shape else { return };
        let mut stats = MarchStats::default();
        let local = rays.iter().map(|(name, ray)| (*name, to_march(ray, transform, 0.0)));
        sdf.occluded_all(local, &mut stats, ended);
        tally.add(*number, &stats);
    }

    /// Whether anything of it lies within the ray; `cast` is the ray, prepared.
    pub(super) fn occluded(&self, ray: &Ray, cast: &Cast, tally: &mut Tally) -> bool {
        match &self.shape {
            Shape::Mesh { mesh, transform, .. } => {
                mesh.tree().occluded(&cast_to_local(ray, cast, transform), ray.t_max)
            }
            Shape::Sphere { .. } | Shape::Sdf { .. } => self.intersect(ray, cast, 0.0, tally).is_some(),
        }
    }

    /// The surface at a hit of the ray.
    pub(super) fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let mut surface = match &self.shape {
            Shape::Mesh { mesh, transform, flat, flip_v } => {
                let mut surface = mesh_surface(&mesh.mesh, transform, *flat, hit);
                if self.needs.tangents {
                    surface.tangents = mesh_tangents(&mesh.mesh, transform, hit);
                }
                if *flip_v {
                    surface.uv.y = 1.0 - surface.uv.y;
                    surface.tangents = surface.tangents.map(|[du, dv]| [du, -dv]);
                }
                surface
            }
            Shape::Sphere { center, radius } => {
                let mut surface = sphere_surface(*center, *radius, ray.at(hit.t), hit);
                if self.needs.tangents {
                    surface.tangents = Some(sphere_tangents(surface.ns * *radius));
                }
                surface
            }
            Shape::Sdf { sdf, transform, .. } => {
                let local = to_local(ray, transform);
                let p = local.at(hit.t);
                let n = transform.normal(sdf.normal(p));
                let world = transform.point(p);
                let error = even_error(transform.error(Vec3::splat(sdf.offset(p))) + world.abs() * gamma(2));
                let traps = if self.needs.traps { sdf.traps(p) } else { Traps::NONE };
                Surface { p: world, error, ng: n, ns: n, solid: p, traps, ..Surface::at(hit) }
            }
        };
        if self.flip {
            surface.ng = -surface.ng;
            surface.ns = -surface.ns;
        }
        surface
    }
}

fn to_local(ray: &Ray, transform: &Transform) -> Ray {
    Ray { o: transform.local_point(ray.o), d: transform.local_vector(ray.d), t_max: ray.t_max }
}

/// The prepared ray in the space of an object: as it is where that is the world.
#[inline]
fn cast_to_local<'a>(ray: &Ray, cast: &'a Cast, transform: &Transform) -> Cow<'a, Cast> {
    if transform.is_identity() {
        return Cow::Borrowed(cast);
    }
    let local = to_local(ray, transform);
    Cow::Owned(Cast::new(local.o, local.d))
}

fn to_march(ray: &Ray, transform: &Transform, spread: f32) -> SdfRay {
    let local = to_local(ray, transform);
    SdfRay { origin: local.o, dir: local.d, t_min: 0.0, t_max: local.t_max, footprint: spread }
}

/// The smallest root in (0, `t_max`], in double precision: the discriminant comes from the distance of the centre to
/// the ray, which does not cancel (Haines et al. 2019, Ray Tracing Gems chapter 7).
fn intersect_sphere(ray: &Ray, center: Vec3, radius: f32) -> Option<f32> {
    let (d, f) = (ray.d.as_dvec3(), ray.o.as_dvec3() - center.as_dvec3());
    let a = d.length_squared();
    let nearest = -f.dot(d) / a;
    let discriminant = f64::from(radius).powi(2) - (f + d * nearest).length_squared();
    if discriminant < 0.0 {
        return None;
    }
    let half = (discriminant / a).sqrt();
    let within = |t: f64| t > 0.0 && t <= f64::from(ray.t_max);
    [nearest - half, nearest + half].into_iter().find(|t| within(*t)).map(|t| t as f32)
}

impl Surface {
    /// Where textures are looked up.
    pub fn place(&self) -> Place {
        Place { uv: self.uv, solid: self.solid, traps: self.traps }
    }

    /// A surface of which nothing is known but what was hit.
    fn at(hit: &Hit) -> Self {
        Self {
            p: Vec3::ZERO,
            error: Vec3::ZERO,
            ng: Vec3::Z,
            ns: Vec3::Z,
            uv: Vec2::ZERO,
            solid: Vec3::ZERO,
            traps: Traps::NONE,
            tangents: None,
            object: hit.object,
            primitive: hit.primitive,
        }
    }
}

/// The front is the side of the mesh's normals where it has any, else the side that winding tells; `flat` leaves the
/// normals aside.
fn mesh_surface(mesh: &Mesh, transform: &Transform, flat: bool, hit: &Hit) -> Surface {
    let corners = mesh.triangles[hit.primitive as usize].map(|i| i as usize);
    let [b, c] = hit.barycentric;
    let weights = [1.0 - b - c, b, c];
    let [p0, p1, p2] = corners.map(|i| mesh.positions[i]);
    let blend = |v: [Vec3; 3]| v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
    let solid = blend([p0, p1, p2]);
    let p = transform.point(solid);
    // Corners may have been rounded to their places in the world (gamma(1)) before the ray met them.
    let local_error = blend([p0.abs(), p1.abs(), p2.abs()]) * gamma(8);
    let moved = p.abs() + transform.shift().abs();
    let error = even_error(transform.error(local_error) + moved * gamma(2));
    let winding = (p1 - p0).cross(p2 - p0);
    let (ng, ns) = if flat || mesh.normals.is_empty() {
        let ng = transform.normal(winding);
        (ng, ng)
    } else {
        let normals = corners.map(|i| mesh.normals[i]);
        let ng = transform.normal(winding) * side(winding, normals);
        let n = transform.normal(blend(normals));
        (ng, if n == Vec3::ZERO { ng } else { n * 1.0_f32.copysign(n.dot(ng)) })
    };
    let uv = if mesh.uvs.is_empty() {
        Vec2::new(b, c)
    } else {
        let [u0, u1, u2] = corners.map(|i| mesh.uvs[i]);
        u0 * weights[0] + u1 * weights[1] + u2 * weights[2]
    };
    Surface { p, error, ng, ns, uv, solid, ..Surface::at(hit) }
}

/// How the position on a triangle changes with u and v; `None` where they do not tell.
fn mesh_tangents(mesh: &Mesh, transform: &Transform, hit: &Hit) -> Option<[Vec3; 2]> {
    let corners = mesh.triangles[hit.primitive as usize].map(|i| i as usize);
    let [p0, p1, p2] = corners.map(|i| mesh.positions[i]);
    let [u0, u1, u2] =
        if mesh.uvs.is_empty() { [Vec2::ZERO, Vec2::X, Vec2::Y] } else { corners.map(|i| mesh.uvs[i]) };
    let (e1, e2, d1, d2) = (p1 - p0, p2 - p0, u1 - u0, u2 - u0);
    let determinant = d1.perp_dot(d2);
    let du = (e1 * d2.y - e2 * d1.y) / determinant;
    let dv = (e2 * d1.x - e1 * d2.x) / determinant;
    let tangents = [transform.vector(du), transform.vector(dv)];
    tangents.iter().all(|t| t.is_finite()).then_some(tangents)
}

fn sphere_surface(center: Vec3, radius: f32, at: Vec3, hit: &Hit) -> Surface {
    // Back onto the sphere: the ray's own rounding must not stay in the position.
    let n = (at - center).normalize_or(Vec3::Y);
    let p = center + n * radius;
    let error = even_error((n.abs() * radius + center.abs()) * gamma(5));
    let uv = Vec2::new(atan2(n.z, n.x) / TAU + 0.5, 1.0 - acos(n.y.clamp(-1.0, 1.0)) * FRAC_1_PI);
    Surface { p, error, ng: n, ns: n, uv, solid: n * radius, ..Surface::at(hit) }
}

/// How the position on a sphere, relative to its centre, changes with u and v.
fn sphere_tangents(p: Vec3) -> [Vec3; 2] {
    let around = p.xz().length();
    let du = Vec3::new(-p.z, 0.0, p.x) * TAU;
    // At the poles u goes nowhere, and any frame will do.
    let dv = if around > 0.0 {
        Vec3::new(-p.x * p.y / around, around, -p.z * p.y / around) * PI
    } else {
        Vec3::ZERO
    };
    [du, dv]
}
