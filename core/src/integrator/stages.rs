//! Owns the stages: loops over the paths that are alive.

use super::Wave;
use super::paths::{Feature, Paths, ShadowRay};
use crate::bsdf::Bsdf;
use crate::film::Counters;
use crate::light::{LightSample, Receiver, Target};
use crate::math::{Frame, Ray, offset_origin};
use crate::sampler::{Decision, Sampler};
use crate::scene::{Scene, Surface};
use glam::{Vec2, Vec3};

/// Sends a ray through every sample of every pixel.
pub(super) fn camera(scene: &Scene, wave: &Wave<'_>, paths: &mut Paths) {
    paths.reset(wave.samples.len() * wave.pixels.len());
    let mut path = 0;
    for sample in wave.samples.clone() {
        for &pixel in wave.pixels {
            let sampler = Sampler::new(scene.stream(), pixel, wave.replicate, sample);
            let center = Vec2::new(pixel[0] as f32, pixel[1] as f32) + 0.5;
            let position = center + scene.filter().sample(sampler.get_2d(Decision::Filter));
            paths.rays[path] = scene.camera().ray(position, sampler.get_2d(Decision::Lens));
            paths.samplers[path] = sampler;
            path += 1;
        }
    }
}

/// Finds the nearest hit of every path.
pub(super) fn intersect(scene: &Scene, bounce: u32, paths: &mut Paths, counters: &mut Counters) {
    counters.rays += paths.active.len() as u64;
    // Only camera rays have a footprint; scattered rays take the marcher's own resolution.
    let spread = if bounce == 0 { scene.camera().pixel_spread() } else { 0.0 };
    for &path in &paths.active {
        let path = path as usize;
        paths.hits[path] = scene.intersect(&paths.rays[path], spread, &mut paths.march);
    }
}

/// Adds the light that paths have run into, and drops the paths that left the scene.
pub(super) fn emit(scene: &Scene, bounce: u32, paths: &mut Paths) {
    paths.surfaces.clear();
    let spread = scene.camera().pixel_spread();
    let mut alive = 0;
    for at in 0..paths.active.len() {
        let path = paths.active[at] as usize;
        let ray = paths.rays[path];
        let Some(hit) = paths.hits[path] else {
            for (light, radiance, pdf) in scene.environment() {
                let weight = scattered_weight(scene, paths, path, light, pdf);
                paths.radiance[path] += paths.beta[path] * radiance * weight;
            }
            continue;
        };
        let surface = scene.surface(&ray, &hit, spread);
        if let Some((light, radiance, pdf)) = scene.emission(&surface, paths.receivers[path].p, ray.d) {
            let weight = scattered_weight(scene, paths, path, light, pdf);
            paths.radiance[path] += paths.beta[path] * radiance * weight;
        }
        if bounce == 0 {
            let normal = if ray.d.dot(surface.ng) > 0.0 { -surface.ns } else { surface.ns };
            let albedo = scene.bsdf(&surface).albedo();
            paths.features[path] = Feature { albedo, normal, depth: hit.t };
        }
        paths.surfaces.push(surface);
        paths.active[alive] = path as u32;
        alive += 1;
    }
    paths.active.truncate(alive);
}

/// Weight of having found a light by scattering; 1 for camera rays, which no light sampling competes with.
fn scattered_weight(scene: &Scene, paths: &Paths, path: usize, light: usize, light_pdf: f32) -> f32 {
    let pdf = paths.pdf[path];
    if pdf.is_infinite() {
        return 1.0;
    }
    power_heuristic(pdf, light_pdf * scene.lights().choice_pdf(&paths.receivers[path], light))
}

/// The power heuristic with exponent 2, written so that large densities give 0 or 1 and never NaN.
fn power_heuristic(this: f32, other: f32) -> f32 {
    let ratio = other / this;
    1.0 / (1.0 + ratio * ratio)
}

/// A surface seen from where the path came: the frame and the sides that its directions refer to.
struct Vertex<'a> {
    surface: &'a Surface,
    frame: Frame,
    /// Geometric normal on the side of `wo`.
    ng: Vec3,
    wo: Vec3,
    bsdf: Bsdf,
}

impl<'a> Vertex<'a> {
    fn new(scene: &Scene, surface: &'a Surface, towards: Vec3) -> Self {
        let side = if towards.dot(surface.ng) < 0.0 { -1.0 } else { 1.0 };
        let (ng, ns) = (surface.ng * side, surface.ns * side);
        // Interpolated normals may turn away from the viewer at a silhouette; the true normal never does.
        let frame = Frame::new(if towards.dot(ns) > 0.0 { ns } else { ng });
        Self { surface, frame, ng, wo: frame.to_local(towards), bsdf: scene.bsdf(surface) }
    }

    fn receiver(&self) -> Receiver {
        Receiver { p: self.surface.p, n: self.frame.n }
    }

    fn origin_towards(&self, w: Vec3) -> Vec3 {
        offset_origin(self.surface.p, self.surface.error, self.ng, w)
    }
}

/// Samples a light and a direction at every surface: queues shadow rays, sends paths on or ends them.
pub(super) fn shade(scene: &Scene, bounce: u32, paths: &mut Paths) {
    paths.shadows.clear();
    let surfaces = std::mem::take(&mut paths.surfaces);
    let mut alive = 0;
    for (at, surface) in surfaces.iter().enumerate() {
        let path = paths.active[at] as usize;
        let vertex = Vertex::new(scene, surface, -paths.rays[path].d);
        let sampler = paths.samplers[path];
        if let Some((ray, light)) = sample_light(scene, &vertex, &sampler, bounce) {
            let contribution = paths.beta[path] * light;
            paths.shadows.push(ShadowRay { path: path as u32, ray, contribution });
        }
        if scatter(scene, &vertex, paths, path, bounce) {
            paths.active[alive] = path as u32;
            alive += 1;
        }
    }
    paths.active.truncate(alive);
    paths.surfaces = surfaces;
}

/// Chooses a light and a point of it: the shadow ray and what it brings, weighed against finding it by scattering.
fn sample_light(scene: &Scene, vertex: &Vertex<'_>, sampler: &Sampler, bounce: u32) -> Option<(Ray, Vec3)> {
    let receiver = vertex.receiver();
    let (light, choice) = scene.lights().choose(&receiver, sampler.get_1d(Decision::LightChoice(bounce)))?;
    let part = sampler.get_1d(Decision::LightPart(bounce));
    let point = sampler.get_2d(Decision::LightPoint(bounce));
    let sample = scene.lights().all()[light].sample(&receiver, part, point)?;
    if sample.wi.dot(vertex.ng) <= 0.0 {
        return None;
    }
    let wi = vertex.frame.to_local(sample.wi);
    let f = vertex.bsdf.eval(vertex.wo, wi);
    if f == Vec3::ZERO {
        return None;
    }
    let pdf = sample.pdf * choice;
    let weight = power_heuristic(pdf, vertex.bsdf.pdf(vertex.wo, wi));
    Some((shadow_ray(vertex, &sample), f * sample.radiance * (weight / pdf)))
}

/// The ray between two offset ends, so that neither surface shadows itself.
fn shadow_ray(vertex: &Vertex<'_>, sample: &LightSample) -> Ray {
    let origin = vertex.origin_towards(sample.wi);
    match sample.target {
        Target::Infinity => Ray::new(origin, sample.wi),
        Target::Point(p, error, n) => {
            let end = offset_origin(p, error, n, -sample.wi);
            // A few roundings short of the end, which is the surface that shines.
            Ray { o: origin, d: end - origin, t_max: 1.0 - 4.0 * f32::EPSILON }
        }
    }
}

/// Chooses the next direction; false when the path ends.
fn scatter(scene: &Scene, vertex: &Vertex<'_>, paths: &mut Paths, path: usize, bounce: u32) -> bool {
    let sampler = paths.samplers[path];
    let Some(sample) = vertex.bsdf.sample(vertex.wo, sampler.get_2d(Decision::Direction(bounce))) else {
        return false;
    };
    let wi = vertex.frame.to_world(sample.wi);
    if wi.dot(vertex.ng) <= 0.0 {
        return false;
    }
    let mut beta = paths.beta[path] * sample.weight;
    // Russian roulette: dim paths end early, the others are raised by as much as they risked.
    if bounce + 1 >= scene.roulette_depth() {
        let survive = beta.max_element().min(0.95);
        if sampler.get_1d(Decision::Roulette(bounce)) >= survive {
            return false;
        }
        beta /= survive;
    }
    if beta == Vec3::ZERO {
        return false;
    }
    paths.beta[path] = beta;
    paths.pdf[path] = sample.pdf;
    paths.receivers[path] = vertex.receiver();
    paths.rays[path] = Ray::new(vertex.origin_towards(wi), wi);
    true
}

/// Traces the queued shadow rays and adds what arrives.
pub(super) fn shadow(scene: &Scene, paths: &mut Paths, counters: &mut Counters) {
    counters.shadow_rays += paths.shadows.len() as u64;
    for shadow in &paths.shadows {
        if !scene.occluded(&shadow.ray, &mut paths.march) {
            paths.radiance[shadow.path as usize] += shadow.contribution;
        }
    }
}
