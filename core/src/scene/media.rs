//! Owns which medium is where: inside of which objects a ray is, and what fills the space between all of them.

use super::object::{Object, Shape, Surface};
use super::tally::Tally;
use crate::bvh::Cast;
use crate::math::{Aabb, Ray};
use crate::medium::Medium;
use glam::{DVec3, Vec3};

/// The media of a scene.
#[derive(Debug, Clone)]
pub(super) struct Media {
    /// By rank of the objects that they fill.
    inside: Vec<Medium>,
    /// What is wherever no object's interior is.
    around: Option<Medium>,
    /// Where that ends: centre and radius of a ball around everything. `None` where it does not, because no light comes
    /// from infinity.
    ball: Option<(DVec3, f64)>,
    /// Where the camera is.
    camera: Interiors,
    /// Where each light is, by the rank of the innermost object; empty where there are too many.
    lights: Vec<u16>,
}

/// What an object that is filled with a medium needs for it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interior {
    /// Place among all filled objects by size, the smallest first.
    pub(super) rank: u16,
    /// Whether its front side is its outside.
    pub(super) outward: bool,
}

/// The filled objects that a point is inside of, at most eight. The smallest one's medium is what is there: where objects
/// are nested that is the innermost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interiors([u16; NESTED]);

/// Most objects that a point is known to be inside of.
const NESTED: usize = 8;

impl Interiors {
    const NONE: u16 = u16::MAX;

    /// Outside of all.
    pub const OUTSIDE: Self = Self([Self::NONE; NESTED]);

    /// The same, inside of one more. Of more than eight the largest is forgotten.
    fn with(mut self, rank: u16) -> Self {
        if self.0.contains(&rank) {
            return self;
        }
        let mut next = rank;
        for slot in &mut self.0 {
            if next < *slot {
                std::mem::swap(slot, &mut next);
            }
        }
        self
    }

    /// The same, outside of one.
    fn without(mut self, rank: u16) -> Self {
        if let Some(at) = self.0.iter().position(|&slot| slot == rank) {
            self.0.copy_within(at + 1.., at);
            self.0[NESTED - 1] = Self::NONE;
        }
        self
    }

    fn innermost(self) -> Option<u16> {
        Some(self.0[0]).filter(|&rank| rank != Self::NONE)
    }
}

/// A medium and how far along a ray it is certain to be what is there.
#[derive(Debug, Clone, Copy)]
pub struct Stretch<'a> {
    /// What is there.
    pub medium: &'a Medium,
    /// Where it ends at the latest, in units of the ray's direction.
    pub end: f32,
}

impl Media {
    /// The media of objects, of which `fillings` has one by object: ranks are given to the objects here. What is around them
    /// ends where the ball around `bounds` and camera does, or nowhere.
    pub(super) fn new(
        objects: &mut [Object],
        fillings: &[Option<Medium>],
        around: Option<Medium>,
        (bounds, camera): (Option<Aabb>, Vec3),
        lights: &[Vec3],
    ) -> Option<Self> {
        let mut filled: Vec<usize> = (0..objects.len()).filter(|&i| fillings[i].is_some()).collect();
        if filled.is_empty() && around.is_none() {
            return None;
        }
        let volume = |i: usize| objects[i].bounds().size().as_dvec3().element_product();
        filled.sort_by(|&a, &b| volume(a).total_cmp(&volume(b)));
        let inside = filled.iter().filter_map(|&i| fillings[i]).collect();
        for (rank, &i) in filled.iter().enumerate() {
            objects[i].interior = Some(Interior { rank: rank as u16, outward: objects[i].is_outward() });
        }
        let ball = bounds.map(|bounds| {
            let all = bounds.with_point(camera);
            let (center, size) = (all.center().as_dvec3(), all.size().as_dvec3().length());
            (center, (0.5 * size * (1.0 + 1e-5)).max(1e-6))
        });
        let lights = lights.iter().map(|&place| innermost(objects, &filled, place).0[0]).collect();
        Some(Self { inside, around, ball, camera: innermost(objects, &filled, camera), lights })
    }

    /// Whether a light is in the same medium as a ray.
    pub(super) fn is_with(&self, light: usize, interiors: Interiors) -> bool {
        self.lights.get(light).is_some_and(|&rank| rank == interiors.0[0])
    }

    /// Where the camera is.
    pub(super) fn camera(&self) -> Interiors {
        self.camera
    }

    /// What a ray is in, and where that ends at the latest; `None` where nothing fills space.
    pub(super) fn at(&self, ray: &Ray, interiors: Interiors) -> Option<Stretch<'_>> {
        if let Some(rank) = interiors.innermost() {
            let medium = &self.inside[usize::from(rank)];
            return Some(Stretch { medium, end: f32::INFINITY });
        }
        let medium = self.around.as_ref()?;
        let Some((center, radius)) = self.ball else { return Some(Stretch { medium, end: f32::INFINITY }) };
        // From inside of the ball a line leaves it once.
        let (o, d) = (ray.o.as_dvec3() - center, ray.d.as_dvec3());
        let (a, b) = (d.length_squared(), o.dot(d));
        let c = o.length_squared() - radius * radius;
        let root = (b * b - a * c).max(0.0).sqrt();
        let end = if b > 0.0 { -c / (b + root) } else { (root - b) / a };
        Some(Stretch { medium, end: end.max(0.0) as f32 })
    }
}

/// Inside of which of the filled objects a point is.
fn innermost(objects: &[Object], filled: &[usize], p: Vec3) -> Interiors {
    let holders = filled.iter().filter(|&&i| objects[i].holds(p));
    let ranks = holders.filter_map(|&i| objects[i].interior.map(|interior| interior.rank));
    ranks.fold(Interiors::OUTSIDE, Interiors::with)
}

impl Object {
    /// Whether the front side is the outside.
    fn is_outward(&self) -> bool {
        let outward = match &self.shape {
            Shape::Mesh { mesh, flat, .. } => mesh.mesh.volume(*flat) >= 0.0,
            Shape::Sphere { .. } | Shape::Sdf { .. } => true,
        };
        outward != self.flip
    }

    /// Whether a point is inside: whether a ray from it meets the object from there.
    fn holds(&self, p: Vec3) -> bool {
        // No direction that anything is likely to be aligned with; two of three decide.
        let directions =
            [Vec3::new(0.36, 0.48, 0.8), Vec3::new(-0.77, 0.21, 0.6), Vec3::new(0.1, -0.93, -0.35)];
        let from_inside = |d: Vec3| {
            let ray = Ray::new(p, d.normalize());
            let cast = Cast::new(ray.o, ray.d);
            let Some((t, primitive, barycentric)) = self.intersect(&ray, &cast, 0.0, &mut Tally::default())
            else {
                return false;
            };
            let hit = super::Hit { t, object: 0, primitive, barycentric };
            let outward = self.interior.is_none_or(|interior| interior.outward);
            (self.surface(&ray, &hit).ng.dot(ray.d) > 0.0) == outward
        };
        directions.into_iter().filter(|&d| from_inside(d)).count() >= 2
    }
}

impl Interior {
    /// Where a ray is that has passed the surface of its object along `d`.
    pub(super) fn after(self, before: Interiors, surface: &Surface, d: Vec3) -> Interiors {
        let enters = (surface.ng.dot(d) < 0.0) == self.outward;
        if enters { before.with(self.rank) } else { before.without(self.rank) }
    }
}

#[cfg(test)]
mod tests {
    use super::Interiors;

    #[test]
    fn the_innermost_is_the_smallest_whatever_the_order() {
        let [small, middle, large] = [1, 5, 9];
        for order in [[small, middle, large], [large, small, middle], [middle, large, small]] {
            let all = order.into_iter().fold(Interiors::OUTSIDE, Interiors::with);
            assert_eq!(all.innermost(), Some(small));
            assert_eq!(all.without(small).innermost(), Some(middle));
            assert_eq!(all.without(middle).without(small).innermost(), Some(large));
            let left = order.into_iter().fold(all, Interiors::without);
            assert_eq!((left, left.innermost()), (Interiors::OUTSIDE, None));
        }
        let twice = Interiors::OUTSIDE.with(3).with(3).without(3);
        assert_eq!(twice, Interiors::OUTSIDE);
        assert_eq!(Interiors::OUTSIDE.without(3), Interiors::OUTSIDE);
        let many = (0..20).rev().fold(Interiors::OUTSIDE, Interiors::with);
        assert_eq!(many.innermost(), Some(0), "of too many the smallest are kept");
    }
}
