//! Owns the compiled scene of one frame: immutable, shared by all threads, asked by rays.

use super::PLAIN;
use super::document::Sampling;
use super::material::Material;
use super::media::{Interiors, Media, Stretch};
use super::object::{Hit, Object, Surface};
use super::tally::Tally;
use super::trees::{Entry, Trees};
use crate::bsdf::Bsdf;
use crate::bvh::Cast;
use crate::camera::Camera;
use crate::color::View;
use crate::film::{FrameSize, PixelFilter, Region};
use crate::light::{Glow, Lights, Receiver};
use crate::math::{Aabb, Frame, Ray, offset_origin};
use crate::sampler::Stream;
use crate::sdf::Sdf;
use glam::Vec3;
use std::borrow::Cow;

/// How paths find light: pictures are made by both ways weighed against each other, and each way alone must agree.
#[doc(hidden)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Strategy {
    /// By both, weighed (MIS).
    #[default]
    Both,
    /// By scattering alone, but for lights without extent.
    Scattering,
    /// By sampling lights alone, but for what mirrors and cameras see.
    Lights,
    /// By both, every light chosen as often as any other.
    BlindChoice,
}

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
    pub(super) trees: Trees,
    pub(super) materials: Vec<Material>,
    pub(super) lights: Lights,
    /// Whether there are lights at a finite distance and at infinity.
    pub(super) sides: bool,
    /// Numbers of the lights that primitives of objects are; `u32::MAX` for those that are none.
    pub(super) emitters: Vec<u32>,
    /// Whether some surface is there in part only, so that rays may have to cross it.
    pub(super) has_holes: bool,
    /// Whether a direction may be one of several lobes somewhere, of a material or of the glow of fog.
    pub(super) has_lobes: bool,
    /// What fills space, if anything does.
    pub(super) media: Option<Media>,
    /// Names of the objects made of distance functions.
    pub(super) function_names: Vec<String>,
    pub(super) stream: Stream,
    pub(super) strategy: Strategy,
}

impl Scene {
    /// The same scene, its light found in another way.
    #[doc(hidden)]
    #[must_use]
    pub fn with_strategy(self, strategy: Strategy) -> Self {
        Self { strategy, ..self }
    }

    /// How its light is found.
    #[doc(hidden)]
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }

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

    /// Chooses a light for a receiver by `u` in [0, 1): its number and the probability of the choice. `None` where no
    /// light would bring anything.
    pub(crate) fn choose_light(&self, from: &Receiver, u: f32) -> Option<(usize, f32)> {
        if self.strategy != Strategy::BlindChoice {
            return self.lights.choose(from, u);
        }
        let count = self.lights.all().len();
        (count > 0).then(|| (((u * count as f32) as usize).min(count - 1), 1.0 / count as f32))
    }

    /// Whether lights at a finite distance and lights at infinity are sampled side by side ([`Lights::choose_of`]).
    pub(crate) fn has_sides(&self) -> bool {
        !PLAIN && self.sides && self.strategy == Strategy::Both
    }

    /// Probability with which [`Scene::choose_light`] takes a light, or with sides [`Lights::choose_of`].
    pub(crate) fn light_choice_pdf(&self, from: &Receiver, index: usize) -> f32 {
        if self.strategy == Strategy::BlindChoice {
            return 1.0 / self.lights.all().len() as f32;
        }
        if self.has_sides() {
            return self.lights.choice_of_pdf(from, index);
        }
        self.lights.choice_pdf(from, index)
    }

    /// All lights.
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Whether a direction may be one of several lobes somewhere, of a material or of the glow of fog.
    pub fn has_lobes(&self) -> bool {
        self.has_lobes
    }

    /// Whether some surface is there in part only: then shadow rays ask for [`Scene::transmittance`].
    pub fn has_holes(&self) -> bool {
        !PLAIN && self.has_holes
    }

    /// The objects made of distance functions, in the order of the document.
    pub fn distance_functions(&self) -> impl Iterator<Item = &Sdf> {
        self.objects.iter().filter_map(Object::distance_function)
    }

    /// Number of objects made of distance functions.
    pub fn function_count(&self) -> usize {
        if PLAIN { 0 } else { self.function_names.len() }
    }

    /// Their names, in the order of the document.
    pub fn function_names(&self) -> &[String] {
        &self.function_names
    }

    /// The box around all objects.
    pub fn bounds(&self) -> Aabb {
        self.trees.tree.bounds()
    }

    /// The nearest hit within the ray; of equal distances the object, then the triangle, with the smaller number.
    ///
    /// `spread` is the half width of the ray's pixel per unit of distance, 0 where unknown.
    pub fn intersect(&self, ray: &Ray, spread: f32, tally: &mut Tally) -> Option<Hit> {
        self.nearest(ray, spread, tally, true, |_, _| true)
    }

    /// The nearest hit among the objects that `counts` takes, and with `soup` those in the tree of all.
    pub(super) fn nearest(
        &self,
        ray: &Ray,
        spread: f32,
        tally: &mut Tally,
        soup: bool,
        mut counts: impl FnMut(u32, &Object) -> bool,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut t_max = ray.t_max;
        let cast = Cast::new(ray.o, ray.d);
        let tree = &self.trees.tree;
        tree.traverse(cast.boxes(), &mut t_max, |first, count, t_max| {
            for &slot in &tree.slots()[first as usize..(first + count) as usize] {
                let hit = match self.trees.entries[slot as usize] {
                    Entry::Soup if soup => self.trees.in_soup(&cast, *t_max),
                    Entry::Object(object) if counts(object, &self.objects[object as usize]) => {
                        let within = Ray { t_max: *t_max, ..*ray };
                        self.hit_of(object, &within, &cast, spread, tally)
                    }
                    Entry::Soup | Entry::Object(_) => None,
                };
                let Some(hit) = hit else { continue };
                if best.is_none_or(|best| hit.is_before(&best)) {
                    best = Some(hit);
                    *t_max = hit.t;
                }
            }
            false
        });
        best
    }

    /// The nearest hit of what may be there in part only.
    fn nearest_with_holes(&self, ray: &Ray, tally: &mut Tally) -> Option<Hit> {
        self.nearest(ray, 0.0, tally, false, |_, object| object.holes)
    }

    /// The nearest hit of one object.
    fn hit_of(&self, object: u32, ray: &Ray, cast: &Cast, spread: f32, tally: &mut Tally) -> Option<Hit> {
        let hit = self.objects[object as usize].intersect(ray, cast, spread, tally);
        hit.map(|(t, primitive, barycentric)| Hit { t, object, primitive, barycentric })
    }

    /// The surface at a hit of the ray.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        self.objects[hit.object as usize].surface(ray, hit)
    }

    fn material(&self, surface: &Surface) -> &Material {
        &self.materials[self.objects[surface.object as usize].material as usize]
    }

    /// How the surface scatters, its textures looked up.
    pub fn bsdf(&self, surface: &Surface) -> Cow<'_, Bsdf> {
        self.material(surface).model.at(&surface.place())
    }

    /// The frame that its scattering refers to: z is the normal of the front side with all bumps, x runs along u where
    /// that matters.
    pub fn frame(&self, surface: &Surface) -> Frame {
        self.material(surface).frame(surface)
    }

    /// Whether its back side is like its front side.
    pub fn is_two_sided(&self, surface: &Surface) -> bool {
        self.material(surface).two_sided
    }

    /// Share of the surface that is there, 0..1: rays pass the rest.
    pub fn opacity(&self, surface: &Surface) -> f32 {
        self.material(surface).opacity_at(&surface.place())
    }

    /// Whether what is hit may be there in part only; otherwise its opacity is 1.
    pub fn may_be_crossed(&self, hit: &Hit) -> bool {
        self.objects[hit.object as usize].holes
    }

    /// Most surfaces that a ray crosses because they are there in part only.
    pub const MAX_CROSSINGS: u32 = 1024;

    /// Whether something fills space.
    pub fn has_media(&self) -> bool {
        !PLAIN && self.media.is_some()
    }

    /// Inside of what the camera is.
    pub fn camera_interiors(&self) -> Interiors {
        self.media.as_ref().map_or(Interiors::OUTSIDE, Media::camera)
    }

    /// What fills the space that a ray begins in; `None` where nothing does.
    pub fn medium(&self, ray: &Ray, interiors: Interiors) -> Option<Stretch<'_>> {
        self.media.as_ref()?.at(ray, interiors)
    }

    /// The glow of lights around a ray, in the medium that it begins in; `None` where nothing glows.
    pub fn glow(&self, ray: &Ray, interiors: Interiors, beta: Vec3) -> Option<Glow<'_>> {
        let media = self.media.as_ref()?;
        if self.strategy != Strategy::Both || !media.at(ray, interiors)?.medium.scatters() {
            return None;
        }
        self.lights.glow(ray.o, beta, |light| media.is_with(light, interiors))
    }

    /// Inside of what a ray is that has passed a surface along `d`.
    pub fn beyond(&self, interiors: Interiors, surface: &Surface, d: Vec3) -> Interiors {
        match self.objects[surface.object as usize].interior {
            Some(interior) => interior.after(interiors, surface, d),
            None => interiors,
        }
    }

    /// Share of light that gets through media, and what is there in part, within the ray.
    pub fn transmittance_through(&self, ray: &Ray, mut interiors: Interiors, tally: &mut Tally) -> Vec3 {
        let end = ray.at(1.0);
        let (mut rest, mut through) = (*ray, Vec3::ONE);
        for _ in 0..Self::MAX_CROSSINGS {
            let found = if self.has_holes { self.nearest_with_holes(&rest, tally) } else { None };
            if let Some(stretch) = self.medium(&rest, interiors) {
                let until = found.map_or(rest.t_max, |hit| hit.t).min(stretch.end);
                through *= stretch.medium.transmittance(until * rest.d.length());
            }
            let Some(hit) = found else { return through };
            let surface = self.surface(&rest, &hit);
            through *= 1.0 - self.opacity(&surface);
            if through == Vec3::ZERO {
                return through;
            }
            interiors = self.beyond(interiors, &surface, rest.d);
            rest.o = offset_origin(surface.p, surface.error, surface.ng, rest.d);
            if ray.t_max.is_finite() {
                rest.d = end - rest.o;
            }
        }
        tally.lost += 1;
        Vec3::ZERO
    }

    /// Share of light that gets through what is there in part within the ray, 0..1.
    pub fn transmittance(&self, ray: &Ray, tally: &mut Tally) -> f32 {
        if !self.has_holes {
            return 1.0;
        }
        let end = ray.at(1.0);
        let (mut rest, mut through) = (*ray, 1.0);
        for _ in 0..Self::MAX_CROSSINGS {
            let Some(hit) = self.nearest_with_holes(&rest, tally) else { return through };
            let surface = self.surface(&rest, &hit);
            through *= 1.0 - self.opacity(&surface);
            if through <= 0.0 {
                return 0.0;
            }
            rest.o = offset_origin(surface.p, surface.error, surface.ng, rest.d);
            if ray.t_max.is_finite() {
                rest.d = end - rest.o;
            }
        }
        tally.lost += 1;
        0.0
    }

    /// The light that a primitive is: its number, what its front side sends back along `d` to `from`, and the density per
    /// solid angle of having sampled it from there; the choice of the light is not in it.
    pub fn emission(&self, surface: &Surface, from: Vec3, d: Vec3) -> Option<(usize, Vec3, f32)> {
        let first = self.objects[surface.object as usize].emitter?;
        let light = self.emitters[(first + surface.primitive) as usize];
        let (radiance, pdf) = self.lights.emitted(light as usize, from, surface.p, surface.ng, d)?;
        Some((light as usize, radiance, pdf))
    }
}
