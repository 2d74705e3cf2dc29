//! Owns the stages: loops over the paths that are alive.

use super::Wave;
use super::common::{
    add_emission, behind, cast_shadow, find_blocked, note_features, power_heuristic, scattered_weight,
    shadow_ray_from, survives,
};
use super::draws::{Draw, draw_all};
use super::media;
use super::paths::{Paths, ShadowRay};
use super::vertex::Vertex;
use crate::film::Counters;
use crate::light::{Glow, LightSample, Side};
use crate::math::{Ray, offset_origin};
use crate::sampler::{Decision, Sampler};
use crate::scene::{Hit, Interiors, Scene, Strategy};
use glam::{Vec2, Vec3};

/// Sends a ray through every sample of every pixel.
pub(super) fn camera(scene: &Scene, wave: &Wave<'_>, paths: &mut Paths) {
    let count = wave.samples.len() * wave.pixels.len();
    paths.reset(count, if scene.function_count() > 0 { count } else { 0 });
    for (path, &pixel) in wave.pixels.iter().enumerate().take(count) {
        paths.samplers[path] = Sampler::new(scene.stream(), pixel, wave.replicate, wave.samples.start);
    }
    for path in wave.pixels.len()..count {
        paths.samplers[path] = paths.samplers[path - wave.pixels.len()].next();
    }
    for first in (0..count).step_by(Sampler::LANES) {
        let samplers = std::array::from_fn(|lane| paths.samplers[(first + lane).min(count - 1)]);
        let offsets = Sampler::get_2d_of_all(&samplers, Decision::Filter);
        let lens = if scene.camera().has_lens() {
            Sampler::get_2d_of_all(&samplers, Decision::Lens)
        } else {
            [Vec2::ZERO; Sampler::LANES]
        };
        for (lane, path) in (first..count).take(Sampler::LANES).enumerate() {
            let pixel = wave.pixels[path % wave.pixels.len()];
            let center = Vec2::new(pixel[0] as f32, pixel[1] as f32) + 0.5;
            let position = center + scene.filter().sample(offsets[lane]);
            paths.rays[path] = scene.camera().ray(position, lens[lane]);
        }
    }
}

/// Finds the nearest hit of every path that stops it.
pub(super) fn intersect(scene: &Scene, bounce: u32, paths: &mut Paths, counters: &mut Counters) {
    nearest(scene, bounce, paths, counters);
    if scene.has_holes() {
        let spread = if bounce == 0 { scene.camera().pixel_spread() } else { 0.0 };
        for at in 0..paths.active.len() {
            let path = paths.active[at] as usize;
            let before = paths.marching.tally.evaluations();
            paths.hits[path] = cross(scene, bounce, paths, path, paths.hits[path], spread);
            paths.count_evaluations(path, before);
        }
    }
}

/// Finds the nearest hit of every path, there in whole or in part.
pub(super) fn nearest(scene: &Scene, bounce: u32, paths: &mut Paths, counters: &mut Counters) {
    counters.rays += paths.active.len() as u64;
    // Only camera rays have a footprint; scattered rays take the marcher's own resolution.
    let spread = if bounce == 0 { scene.camera().pixel_spread() } else { 0.0 };
    let Paths { rays, active, hits, marching, evaluations, .. } = paths;
    scene.intersect_all(rays, active, spread, hits, marching);
    if scene.function_count() > 0 {
        for &path in active.iter() {
            evaluations[path as usize] += marching.spent[path as usize];
        }
    }
}

/// Lets a path through surfaces that are there in part: the first hit that stops it.
fn cross(
    scene: &Scene,
    bounce: u32,
    paths: &mut Paths,
    path: usize,
    first: Option<Hit>,
    spread: f32,
) -> Option<Hit> {
    let mut found = first;
    paths.crossed[path] = 0.0;
    for crossing in 0..Scene::MAX_CROSSINGS {
        if !scene.may_be_crossed(&found?) {
            return found;
        }
        let ray = paths.rays[path];
        let surface = scene.surface(&ray, &found?);
        let opacity = scene.opacity(&surface);
        let stops = opacity > 0.0
            && (opacity >= 1.0 || paths.samplers[path].get_1d(Decision::Opacity(bounce, crossing)) < opacity);
        if stops {
            return found;
        }
        paths.crossed[path] += found?.t;
        paths.rays[path].o = offset_origin(surface.p, surface.error, surface.ng, ray.d);
        found = scene.intersect(&paths.rays[path], spread, &mut paths.marching.tally);
    }
    // Dark, as for shadow rays: what is behind so many surfaces is not the sky.
    paths.marching.tally.lost += 1;
    paths.beta[path] = Vec3::ZERO;
    None
}

/// Adds the light that paths have run into, and drops the paths that left the scene.
pub(super) fn emit(scene: &Scene, bounce: u32, paths: &mut Paths) {
    paths.surfaces.clear();
    let mut alive = 0;
    for at in 0..paths.active.len() {
        let path = paths.active[at] as usize;
        let ray = paths.rays[path];
        let Some(hit) = paths.hits[path] else {
            for (light, radiance, pdf) in scene.lights().infinite(ray.d) {
                let weight = scattered_weight(scene, paths, path, light, pdf);
                add_emission(paths, path, paths.beta[path] * radiance * weight);
            }
            continue;
        };
        let surface = scene.surface(&ray, &hit);
        if let Some((light, radiance, pdf)) = scene.emission(&surface, paths.receivers[path].p, ray.d) {
            let weight = scattered_weight(scene, paths, path, light, pdf);
            add_emission(paths, path, paths.beta[path] * radiance * weight);
        }
        if bounce == 0 {
            paths.features[path].depth = paths.crossed[path] + hit.t;
        }
        paths.surfaces.push(surface);
        paths.active[alive] = path as u32;
        alive += 1;
    }
    paths.active.truncate(alive);
}

/// Notes the features of surfaces that are not shaded any more: paths end there.
pub(super) fn observe(scene: &Scene, paths: &mut Paths) {
    let surfaces = std::mem::take(&mut paths.surfaces);
    for (at, surface) in surfaces.iter().enumerate() {
        let path = paths.active[at] as usize;
        if paths.unseen[path] {
            note_features(&Vertex::new(scene, surface, -paths.rays[path].d), paths, path);
        }
    }
    paths.surfaces = surfaces;
}

/// Samples a light and a direction at every surface: queues shadow rays, sends paths on or ends them.
pub(super) fn shade(scene: &Scene, bounce: u32, paths: &mut Paths) {
    paths.shadows.clear();
    scatter_all::<false>(scene, bounce, paths);
}

/// The same, after the shadow rays that are queued already. What only scenes with media need is not there without `MEDIA`.
pub(super) fn scatter_all<const MEDIA: bool>(scene: &Scene, bounce: u32, paths: &mut Paths) {
    let surfaces = std::mem::take(&mut paths.surfaces);
    let mut alive = 0;
    let mut draws = [Draw::default(); Sampler::LANES];
    for (at, surface) in surfaces.iter().enumerate() {
        let path = paths.active[at] as usize;
        if at % Sampler::LANES == 0 {
            draws = draw_all(scene, bounce, paths, at);
        }
        let draw = &draws[at % Sampler::LANES];
        let vertex = Vertex::new(scene, surface, -paths.rays[path].d);
        note_features(&vertex, paths, path);
        if vertex.is_black() {
            continue;
        }
        let glow = if MEDIA { media::glow_at(scene, &vertex, paths, path) } else { None };
        light_up::<MEDIA>(scene, &vertex, glow.as_ref(), paths, (path, bounce), (draw.choice, draw.light));
        if scatter::<MEDIA>(scene, &vertex, glow.as_ref(), paths, (path, bounce), draw) {
            paths.active[alive] = path as u32;
            alive += 1;
        }
    }
    paths.active.truncate(alive);
    paths.surfaces = surfaces;
}

/// Samples a light at a surface, or one of each kind, and queues the shadow rays.
#[inline]
pub(super) fn light_up<const MEDIA: bool>(
    scene: &Scene,
    vertex: &Vertex<'_>,
    glow: Option<&Glow<'_>>,
    paths: &mut Paths,
    (path, bounce): (usize, u32),
    draw: (f32, Vec2),
) {
    let sides: &[Option<Side>] =
        if scene.has_sides() { &[Some(Side::Near), Some(Side::Infinite)] } else { &[None] };
    for (number, &side) in sides.iter().enumerate() {
        let (u, point) = match side {
            None | Some(Side::Near) => draw,
            Some(Side::Infinite) => {
                let sampler = &paths.samplers[path];
                let point = sampler.get_2d(Decision::InfinitePoint(bounce));
                (sampler.get_1d(Decision::InfiniteChoice(bounce)), point)
            }
        };
        let Some((ray, light)) = sample_light(scene, vertex, glow, (u, point), side) else {
            continue;
        };
        let arriving = if MEDIA { paths.arriving[path] } else { paths.beta[path] };
        let contribution = arriving * light;
        let interiors = if MEDIA { behind(scene, vertex, paths, path, ray.d) } else { Interiors::OUTSIDE };
        let shadow = ShadowRay { path: path as u32, ray, contribution, interiors };
        if MEDIA || scene.function_count() > 0 {
            cast_shadow(paths, shadow, Decision::Shadow(bounce, number as u32));
        } else {
            paths.shadows.push(shadow);
        }
    }
}

/// Chooses a light and a point of it: the shadow ray and what it brings, weighed against finding it by scattering.
#[expect(clippy::inline_always, reason = "two callers, each of them hot: 1 percent of all instructions")]
#[inline(always)]
fn sample_light(
    scene: &Scene,
    vertex: &Vertex<'_>,
    glow: Option<&Glow<'_>>,
    (u, point): (f32, Vec2),
    side: Option<Side>,
) -> Option<(Ray, Vec3)> {
    if vertex.bsdf.is_delta() {
        return None;
    }
    let receiver = vertex.receiver();
    let (light, choice) = match side {
        None => scene.choose_light(&receiver, u)?,
        Some(side) => scene.lights().choose_of(side, &receiver, u)?,
    };
    let sample = scene.lights().all()[light].sample(&receiver, point)?;
    let (f, scattered) = vertex.bsdf.scatter(vertex.wo, vertex.to_local(sample.wi)?);
    if f == Vec3::ZERO {
        return None;
    }
    let pdf = sample.pdf * choice;
    // No path finds a light without extent by itself.
    let weight = match scene.strategy() {
        _ if sample.delta => 1.0,
        Strategy::Both | Strategy::BlindChoice => {
            power_heuristic(pdf, glow.map_or(scattered, |glow| glow.mixed(sample.wi, scattered)))
        }
        Strategy::Scattering => return None,
        Strategy::Lights => 1.0,
    };
    Some((shadow_ray(vertex, &sample), f * sample.radiance * (weight / pdf)))
}

/// The ray between two offset ends, so that neither surface shadows itself.
fn shadow_ray(vertex: &Vertex<'_>, sample: &LightSample) -> Ray {
    shadow_ray_from(vertex.origin_towards(sample.wi), sample)
}

/// Chooses the next direction; false when the path ends.
#[inline]
fn scatter<const MEDIA: bool>(
    scene: &Scene,
    vertex: &Vertex<'_>,
    glow: Option<&Glow<'_>>,
    paths: &mut Paths,
    (path, bounce): (usize, u32),
    draw: &Draw,
) -> bool {
    debug_assert!(scene.has_lobes() || !vertex.bsdf.has_lobes(), "a lobe is chosen without a number");
    let chosen = match glow {
        Some(glow) => media::surface_direction(vertex, glow, draw.lobe, draw.direction),
        None => vertex.bsdf.sample(vertex.wo, draw.lobe, draw.direction),
    };
    let Some(sample) = chosen else { return false };
    let Some(wi) = vertex.to_world(sample.wi) else { return false };
    paths.beta[path] *= sample.weight;
    paths.eta2[path] *= sample.eta2;
    if !survives(scene, bounce, paths, path, || draw.roulette) || paths.beta[path] == Vec3::ZERO {
        return false;
    }
    paths.pdf[path] = sample.pdf;
    paths.receivers[path] = vertex.receiver();
    paths.rays[path] = Ray::new(vertex.origin_towards(wi), wi);
    if MEDIA {
        paths.interiors[path] = behind(scene, vertex, paths, path, wi);
    }
    true
}

/// Traces the queued shadow rays and adds what arrives.
pub(super) fn shadow(scene: &Scene, paths: &mut Paths, counters: &mut Counters) {
    find_blocked(scene, paths, counters);
    for at in 0..paths.shadows.len() {
        if paths.blocked[at] {
            continue;
        }
        let ShadowRay { path, ray, contribution, .. } = paths.shadows[at];
        let before = paths.marching.tally.evaluations();
        let through = scene.transmittance(&ray, &mut paths.marching.tally);
        paths.count_evaluations(path as usize, before);
        paths.radiance[path as usize] += contribution * through;
    }
}
