//! Owns the compiled scene of one frame: immutable, shared by all threads, asked by rays.

use super::document::Sampling;
use super::object::{Hit, Object, Surface};
use crate::bsdf::{Bsdf, Diffuse};
use crate::bvh::{Bvh, RayBoxes};
use crate::camera::Camera;
use crate::color::View;
use crate::film::{FrameSize, PixelFilter, Region};
use crate::light::{Light, Lights};
use crate::math::{Aabb, Ray};
use crate::sampler::Stream;
use crate::sdf::MarchStats;
use crate::texture::{ColorSpace, Image};
use glam::Vec3;
use std::sync::Arc;

/// One frame of a scene, ready to be rendered.
#[derive(Debug)]
pub struct Scene {
    pub(super) size: FrameSize,
    pub(super) window: Region,
    pub(super) sampling: Sampling,
    pub(super) exposure: f32,
    pub(super) view: View,
    pub(super) camera: Camera,
    pub(super) filter: PixelFilter,
    pub(super) max_depth: u32,
    pub(super) roulette_depth: u32,
    pub(super) objects: Vec<Object>,
    pub(super) tree: Bvh,
    pub(super) materials: Vec<Material>,
    pub(super) lights: Lights,
    pub(super) environments: Vec<u32>,
    pub(super) stream: Stream,
}

/// A material whose textures are loaded.
#[derive(Debug, Clone)]
pub(super) enum Material {
    Diffuse { reflectance: Color },
}

/// A colour that may vary over a surface.
#[derive(Debug, Clone)]
pub(super) enum Color {
    Constant(Vec3),
    Image(Arc<Image>, ColorSpace),
}

impl Color {
    fn at(&self, surface: &Surface) -> Vec3 {
        match self {
            Self::Constant(c) => *c,
            Self::Image(image, space) => image.lookup(surface.uv, *space),
        }
    }
}

impl Scene {
    /// The full frame.
    pub fn size(&self) -> FrameSize {
        self.size
    }

    /// The part of the frame that is rendered.
    pub fn window(&self) -> Region {
        self.window
    }

    /// How many samples pixels get.
    pub fn sampling(&self) -> &Sampling {
        &self.sampling
    }

    /// Exposure in stops.
    pub fn exposure(&self) -> f32 {
        self.exposure
    }

    /// The view transform of 8-bit pictures.
    pub fn view(&self) -> View {
        self.view
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The pixel filter.
    pub fn filter(&self) -> &PixelFilter {
        &self.filter
    }

    /// Most surfaces that a path meets.
    pub fn max_depth(&self) -> u32 {
        self.max_depth
    }

    /// The surface from which on paths may end at random.
    pub fn roulette_depth(&self) -> u32 {
        self.roulette_depth
    }

    /// The random numbers of the frame.
    pub fn stream(&self) -> Stream {
        self.stream
    }

    /// All lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// The lights at infinity: number, radiance, and the density per solid angle of having sampled a direction.
    pub fn environment(&self) -> impl Iterator<Item = (usize, Vec3, f32)> {
        self.environments.iter().filter_map(|&i| match &self.lights.all()[i as usize] {
            Light::Environment(e) => Some((i as usize, e.radiance, e.pdf())),
            Light::Mesh(_) | Light::Sphere(_) => None,
        })
    }

    /// The box around all objects.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// The nearest hit within the ray; of equal distances the object, then the triangle, with the smaller number.
    ///
    /// `spread` is the half width of the ray's pixel per unit of distance, 0 where unknown.
    pub fn intersect(&self, ray: &Ray, spread: f32, stats: &mut MarchStats) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut t_max = ray.t_max;
        self.tree.traverse(&RayBoxes::new(ray.o, ray.d), &mut t_max, |first, count, t_max| {
            for &object in &self.tree.slots()[first as usize..(first + count) as usize] {
                let within = Ray { t_max: *t_max, ..*ray };
                let Some((t, primitive, barycentric)) =
                    self.objects[object as usize].intersect(&within, spread, stats)
                else {
                    continue;
                };
                if best.is_none_or(|b| t < b.t || (t == b.t && object < b.object)) {
                    best = Some(Hit { t, object, primitive, barycentric });
                    *t_max = t;
                }
            }
            false
        });
        best
    }

    /// Whether anything lies within the ray.
    pub fn occluded(&self, ray: &Ray, stats: &mut MarchStats) -> bool {
        let mut t_max = ray.t_max;
        self.tree.traverse(&RayBoxes::new(ray.o, ray.d), &mut t_max, |first, count, _| {
            let slots = &self.tree.slots()[first as usize..(first + count) as usize];
            slots.iter().any(|&object| self.objects[object as usize].occluded(ray, stats))
        })
    }

    /// The surface at a hit of the ray.
    pub fn surface(&self, ray: &Ray, hit: &Hit, spread: f32) -> Surface {
        self.objects[hit.object as usize].surface(ray, hit, spread)
    }

    /// The material at a surface, its textures looked up.
    pub fn bsdf(&self, surface: &Surface) -> Bsdf {
        match &self.materials[self.objects[surface.object as usize].material as usize] {
            Material::Diffuse { reflectance } => {
                Bsdf::Diffuse(Diffuse { reflectance: reflectance.at(surface) })
            }
        }
    }

    /// The light that an object is: its number, what its front side sends out, and the density per solid angle of
    /// having sampled the surface from `p`; the choice of the light is not in it.
    pub fn emission(&self, surface: &Surface, p: Vec3, wi: Vec3) -> Option<(usize, Vec3, f32)> {
        let index = self.objects[surface.object as usize].light? as usize;
        let cos = -wi.dot(surface.ng);
        if cos <= 0.0 {
            return None;
        }
        Some(match &self.lights.all()[index] {
            Light::Mesh(l) => (index, l.radiance(), l.pdf((surface.p - p).length_squared(), cos)),
            Light::Sphere(l) => (index, l.radiance, l.pdf(p)),
            Light::Environment(_) => return None,
        })
    }
}
