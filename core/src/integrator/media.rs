//! Owns the stages of scenes with media, beside those of all scenes.
//!
//! Every contribution has one owner:
//!
//! - light that a surface sends on directly from a light belongs to the surface behind the media on a path's way, whether the
//!   path is scattered before it or not ([`arriving`]);
//! - light that a medium scatters once more, directly from a light at a finite distance, belongs to the place chosen
//!   along the whole stretch ([`gather`]), wherever the path itself is scattered;
//! - the same from lights at infinity belongs to a place where the path might be scattered ([`gather_sky`]), and to the
//!   direction of the path where it is, weighed against each other (MIS);
//! - light that a path runs into belongs to the stretch before it, with the transmittance of all of it, whether the path
//!   is scattered there or not; but for lights at a finite distance after a place in a medium, which are gathered.
//!
//! Strategies other than [`Strategy::Both`] sample lights where paths are scattered instead, as surfaces do, and must give
//! the same pictures.

use super::common::{
    add_emission, cast_shadow, find_blocked, note_features, power_heuristic, scattered_weight,
    shadow_ray_from, survives,
};
use super::paths::{Paths, ShadowRay};
use super::stages::light_up;
use super::vertex::Vertex;
use crate::bsdf::BsdfSample;
use crate::film::Counters;
use crate::light::{Glow, Numbers, Receiver, Span};
use crate::math::{Ray, offset_origin};
use crate::medium::{Chances, Event, Medium};
use crate::sampler::Decision;
use crate::scene::{Hit, Interiors, Scene, Strategy, Surface};
use glam::{Vec2, Vec3};

/// A part of a path's way to its next surface in one medium.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    /// From where to where, by the ray that the path came with.
    span: Span,
    medium: Medium,
    interiors: Interiors,
    /// Transmittance of all pieces before.
    before: Vec3,
    /// What the path may do here, if it gets here.
    chances: Chances,
}

/// A place in a medium where a path is scattered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    path: u32,
    p: Vec3,
    /// Direction of the path that comes from the camera.
    along: Vec3,
    medium: Medium,
    interiors: Interiors,
}

/// Takes every path from its last place to the next: into a medium or to a surface, or out of the scene, and adds the
/// light on the way.
pub(super) fn advance(scene: &Scene, bounce: u32, paths: &mut Paths) {
    let last = bounce + 1 == scene.max_depth();
    paths.surfaces.clear();
    paths.shadows.clear();
    paths.places.clear();
    let mut alive = 0;
    for at in 0..paths.active.len() {
        let path = paths.active[at] as usize;
        let Some(arrival) = walk(scene, bounce, paths, path) else { continue };
        if last {
            continue;
        }
        gather(scene, bounce, paths, path);
        gather_sky(scene, bounce, paths, path);
        let arriving = arriving(scene, paths, path);
        let scattered = is_scattered(bounce, paths, path);
        let Some(surface) = arrival.surface else { continue };
        paths.interiors[path] = arrival.interiors;
        paths.arriving[path] = arriving.light;
        if scattered {
            let u = paths.samplers[path].get_1d(Decision::Behind(bounce));
            if u < arriving.share {
                see_light(scene, bounce, paths, path, &surface);
            }
            continue;
        }
        paths.scattered[path] = false;
        paths.surfaces.push(surface);
        paths.active[alive] = path as u32;
        alive += 1;
    }
    paths.active.truncate(alive);
}

/// What of a path arrives at the surface behind the media on its way.
struct Arriving {
    /// Its throughput there, over how often lights are sampled there.
    light: Vec3,
    /// How often that is done where the path was scattered before.
    share: f32,
}

/// Below this transmittance lights are sampled less and less often at surfaces behind places where paths are scattered.
const DIM: f32 = 0.25;

/// What arrives at the surface behind the pieces of a path's way.
///
/// The way to the surface is known, whether the path is scattered before or not. So lights are sampled there either way,
/// with the transmittance of the whole way: only the rest of the path depends on where it goes on.
fn arriving(scene: &Scene, paths: &Paths, path: usize) -> Arriving {
    let (mut beta, mut passes) = (paths.beta[path], 1.0);
    for piece in &paths.pieces {
        let (weight, pass) = piece.chances.pass();
        beta *= weight;
        passes *= pass;
    }
    let share = if scene.strategy() == Strategy::Both { (passes / DIM).min(1.0) } else { 0.0 };
    if passes <= 0.0 {
        return Arriving { light: Vec3::ZERO, share: 0.0 };
    }
    Arriving { light: beta * (passes / (passes + (1.0 - passes) * share)), share }
}

/// Samples a light at a surface behind a place where the path is scattered.
fn see_light(scene: &Scene, bounce: u32, paths: &mut Paths, path: usize, surface: &Surface) {
    let vertex = Vertex::new(scene, surface, -paths.rays[path].d);
    if !vertex.is_black() {
        let glow = glow_at(scene, &vertex, paths, path);
        let sampler = paths.samplers[path];
        let choice =
            if scene.lights().is_alone() { 0.0 } else { sampler.get_1d(Decision::LightChoice(bounce)) };
        let point = sampler.get_2d(Decision::LightPoint(bounce));
        light_up::<true>(scene, &vertex, glow.as_ref(), paths, (path, bounce), (choice, point));
    }
}

/// Where a path gets to if no medium scatters it.
struct Arrival {
    surface: Option<Surface>,
    interiors: Interiors,
}

/// Follows a path to the surface that stops it, noting the media on its way, and adds the light there. `None` where it is
/// lost.
fn walk(scene: &Scene, bounce: u32, paths: &mut Paths, path: usize) -> Option<Arrival> {
    let first = paths.rays[path];
    let spread = if bounce == 0 { scene.camera().pixel_spread() } else { 0.0 };
    let (mut ray, mut interiors, mut found) = (first, paths.interiors[path], paths.hits[path]);
    let (mut travelled, mut through, mut arriving) = (0.0, Vec3::ONE, paths.beta[path]);
    paths.pieces.clear();
    for crossing in 0..Scene::MAX_CROSSINGS {
        if let Some(stretch) = scene.medium(&ray, interiors) {
            let length = found.map_or(f32::INFINITY, |hit| hit.t).min(stretch.end);
            let span = Span { o: first.o, d: first.d, near: travelled, far: travelled + length };
            let chances = stretch.medium.chances(arriving, length);
            paths.pieces.push(Piece { span, medium: *stretch.medium, interiors, before: through, chances });
            through *= chances.through();
            arriving *= chances.pass().0;
        }
        let Some(hit) = found else {
            leave(scene, paths, path, through);
            return Some(Arrival { surface: None, interiors });
        };
        let surface = scene.surface(&ray, &hit);
        if stops(scene, bounce, crossing, paths, (path, &hit, &surface)) {
            arrive(scene, bounce, paths, (path, &surface), (travelled + hit.t, through));
            return Some(Arrival { surface: Some(surface), interiors });
        }
        travelled += hit.t;
        interiors = scene.beyond(interiors, &surface, ray.d);
        ray = Ray::new(offset_origin(surface.p, surface.error, surface.ng, ray.d), ray.d);
        let before = paths.marching.tally.evaluations();
        found = scene.intersect(&ray, spread, &mut paths.marching.tally);
        paths.count_evaluations(path, before);
    }
    // Dark, as for shadow rays: what is behind so many surfaces is not the sky.
    paths.marching.tally.lost += 1;
    None
}

/// Whether a surface stops a path that meets it.
fn stops(
    scene: &Scene,
    bounce: u32,
    crossing: u32,
    paths: &Paths,
    (path, hit, surface): (usize, &Hit, &Surface),
) -> bool {
    if !scene.may_be_crossed(hit) {
        return true;
    }
    let opacity = scene.opacity(surface);
    opacity > 0.0
        && (opacity >= 1.0 || paths.samplers[path].get_1d(Decision::Opacity(bounce, crossing)) < opacity)
}

/// Adds the light of a surface that a path has come to, dimmed by the media before it, and notes its features.
fn arrive(
    scene: &Scene,
    bounce: u32,
    paths: &mut Paths,
    (path, surface): (usize, &Surface),
    (distance, through): (f32, Vec3),
) {
    let d = paths.rays[path].d;
    if let Some((light, radiance, pdf)) = scene.emission(surface, paths.receivers[path].p, d) {
        let weight = weight_of_finite(scene, paths, path, light, pdf);
        add_emission(paths, path, paths.beta[path] * through * radiance * weight);
    }
    if bounce == 0 {
        paths.features[path].depth = distance;
    }
    if paths.unseen[path] {
        note_features(&Vertex::new(scene, surface, -d), paths, path);
    }
}

/// Adds the light of what is behind the scene.
fn leave(scene: &Scene, paths: &mut Paths, path: usize, through: Vec3) {
    let d = paths.rays[path].d;
    for (light, radiance, pdf) in scene.lights().infinite(d) {
        let weight = weight_of_infinite(scene, paths, path, light, pdf);
        add_emission(paths, path, paths.beta[path] * through * radiance * weight);
    }
}

/// Weight of having run into a light at a finite distance.
fn weight_of_finite(scene: &Scene, paths: &Paths, path: usize, light: usize, pdf: f32) -> f32 {
    if paths.scattered[path] && scene.strategy() == Strategy::Both {
        // Gathered, unless it is a light that is never sampled.
        return if pdf > 0.0 { 0.0 } else { 1.0 };
    }
    scattered_weight(scene, paths, path, light, pdf)
}

/// Weight of having left towards a light at infinity.
fn weight_of_infinite(scene: &Scene, paths: &Paths, path: usize, light: usize, pdf: f32) -> f32 {
    if paths.scattered[path] && scene.strategy() == Strategy::Both {
        let chosen = scene.lights().infinite_pdf(&paths.receivers[path], light);
        return power_heuristic(paths.pdf[path], pdf * chosen);
    }
    scattered_weight(scene, paths, path, light, pdf)
}

/// Sends a shadow ray from a place on every piece of a path's way to a light at a finite distance.
fn gather(scene: &Scene, bounce: u32, paths: &mut Paths, path: usize) {
    if scene.strategy() != Strategy::Both || !scene.lights().has_beacons() {
        return;
    }
    for number in 0..paths.pieces.len() {
        let Piece { span, medium, interiors, before, .. } = paths.pieces[number];
        if !medium.scatters() {
            continue;
        }
        let (sampler, piece) = (paths.samplers[path], number as u32);
        let beta = paths.beta[path] * before;
        let choice = sampler.get_2d(Decision::GatherPlace(bounce, piece));
        let view = sampler.get_1d(Decision::GatherView(bounce, piece));
        let numbers = Numbers { light: choice.x, place: choice.y, view };
        let Some(along) = scene.lights().along(span, &medium, beta, numbers) else { continue };
        let p = span.o + span.d * along.t;
        let u = sampler.get_2d(Decision::GatherPoint(bounce, piece));
        let from = Receiver { p, n: Vec3::ZERO };
        let Some(sample) = scene.lights().all()[along.light].sample(&from, u) else { continue };
        let here = medium.transmittance((along.t - span.near).max(0.0));
        let phase = medium.phase().value(span.d, sample.wi);
        let weight = phase / (sample.pdf * along.pdf);
        let contribution = beta * here * medium.sigma_s() * sample.radiance * weight;
        let ray = shadow_ray_from(p, &sample);
        let shadow = ShadowRay { path: path as u32, ray, contribution, interiors };
        cast_shadow(paths, shadow, Decision::Shadow(bounce, 2 + 2 * piece));
    }
}

/// Below this probability of being scattered on a piece lights at infinity are gathered there less and less often.
const THIN: f32 = 0.1;

/// Sends a shadow ray from a place on every piece of a path's way to a light at infinity, weighed against finding it by
/// scattering there.
///
/// The place is one where the path might be scattered, whether it is or not: in thin mist it seldom is.
fn gather_sky(scene: &Scene, bounce: u32, paths: &mut Paths, path: usize) {
    if scene.strategy() != Strategy::Both || !scene.lights().has_infinite() {
        return;
    }
    for number in 0..paths.pieces.len() {
        let Piece { span, medium, interiors, before, .. } = paths.pieces[number];
        let (sampler, piece) = (paths.samplers[path], number as u32);
        let u = sampler.get_2d(Decision::GatherSky(bounce, piece));
        let v = sampler.get_2d(Decision::GatherSkyPoint(bounce, piece));
        let beta = paths.beta[path] * before;
        let sky = Sky { span, medium: &medium, interiors, beta };
        if let Some((ray, contribution)) =
            sky.gather(scene, [u, v], sampler.get_1d(Decision::Distance(bounce, piece)))
        {
            let shadow = ShadowRay { path: path as u32, ray, contribution, interiors };
            cast_shadow(paths, shadow, Decision::Shadow(bounce, 3 + 2 * piece));
        }
    }
}

/// A piece of a path's way as light from infinity sees it.
struct Sky<'a> {
    span: Span,
    medium: &'a Medium,
    interiors: Interiors,
    /// Throughput of the path where the piece begins.
    beta: Vec3,
}

impl Sky<'_> {
    /// A shadow ray and what it brings, by random numbers for the light and the place, and for the point of the light and
    /// the channel.
    fn gather(&self, scene: &Scene, [u, v]: [Vec2; 2], channel: f32) -> Option<(Ray, Vec3)> {
        let &Self { span, medium, interiors, beta } = self;
        if !medium.scatters() {
            return None;
        }
        let length = span.far - span.near;
        let often = (medium.scattered(beta, length) / THIN).min(1.0);
        if u.y >= often {
            return None;
        }
        let (distance, density) = medium.place(beta, length, [channel, u.y / often])?;
        let p = span.o + span.d * (span.near + distance);
        let from = Receiver { p, n: Vec3::ZERO };
        let (light, choice) = scene.lights().choose_infinite(&from, u.x)?;
        let sample = scene.lights().all()[light].sample(&from, v)?;
        let scattered = medium.phase().value(span.d, sample.wi);
        let here = beta * medium.transmittance(distance) * medium.sigma_s();
        let pdf = sample.pdf * choice;
        let weight = if sample.delta {
            1.0
        } else {
            let glow = scene.glow(&Ray::new(p, span.d), interiors, here);
            power_heuristic(pdf, glow.map_or(scattered, |glow| glow.mixed(sample.wi, scattered)))
        };
        let contribution = here * sample.radiance * (scattered * weight / (pdf * density * often));
        Some((shadow_ray_from(p, &sample), contribution))
    }
}

/// Decides whether a path is scattered on its way, and notes where.
fn is_scattered(bounce: u32, paths: &mut Paths, path: usize) -> bool {
    for number in 0..paths.pieces.len() {
        let Piece { span, medium, interiors, chances, .. } = paths.pieces[number];
        let u = paths.samplers[path].get_2d(Decision::Distance(bounce, number as u32));
        match medium.decide(&chances, span.far - span.near, u.to_array()) {
            Event::Pass(weight) => paths.beta[path] *= weight,
            Event::Scatter(distance, weight) => {
                paths.beta[path] *= weight;
                let p = span.o + span.d * (span.near + distance);
                paths.places.push(Place { path: path as u32, p, along: span.d, medium, interiors });
                return true;
            }
        }
    }
    false
}

/// Samples lights and a direction at every place in a medium where a path is scattered: queues shadow rays, sends paths on
/// or ends them.
pub(super) fn scatter(scene: &Scene, bounce: u32, paths: &mut Paths) {
    let places = std::mem::take(&mut paths.places);
    for place in &places {
        let path = place.path as usize;
        if paths.beta[path] == Vec3::ZERO {
            continue;
        }
        let ray = Ray::new(place.p, place.along);
        let glow = scene.glow(&ray, place.interiors, paths.beta[path]);
        sample_light(scene, bounce, paths, place, glow.as_ref());
        if go_on(scene, bounce, paths, place, glow.as_ref()) {
            paths.active.push(place.path);
        }
    }
    // Paths that meet surfaces, and those that do not, in their own order again.
    paths.active.sort_unstable();
    paths.places = places;
}

/// Sends a shadow ray to a light, where all are not gathered.
fn sample_light(scene: &Scene, bounce: u32, paths: &mut Paths, place: &Place, glow: Option<&Glow<'_>>) {
    let strategy = scene.strategy();
    if matches!(strategy, Strategy::Both | Strategy::Scattering) {
        return;
    }
    let path = place.path as usize;
    let from = Receiver { p: place.p, n: Vec3::ZERO };
    let sampler = paths.samplers[path];
    let u = sampler.get_1d(Decision::LightChoice(bounce));
    let Some((light, choice)) = scene.choose_light(&from, u) else { return };
    let u = sampler.get_2d(Decision::LightPoint(bounce));
    let Some(sample) = scene.lights().all()[light].sample(&from, u) else { return };
    let scattered = place.medium.phase().value(place.along, sample.wi);
    let pdf = sample.pdf * choice;
    let weight = match strategy {
        Strategy::BlindChoice if !sample.delta => {
            power_heuristic(pdf, glow.map_or(scattered, |glow| glow.mixed(sample.wi, scattered)))
        }
        Strategy::BlindChoice | Strategy::Lights | Strategy::Both | Strategy::Scattering => 1.0,
    };
    let contribution = paths.beta[path] * sample.radiance * (scattered * weight / pdf);
    let ray = shadow_ray_from(place.p, &sample);
    paths.shadows.push(ShadowRay { path: place.path, ray, contribution, interiors: place.interiors });
}

/// Chooses the next direction; false when the path ends.
fn go_on(scene: &Scene, bounce: u32, paths: &mut Paths, place: &Place, glow: Option<&Glow<'_>>) -> bool {
    let path = place.path as usize;
    let sampler = paths.samplers[path];
    if !survives(scene, bounce, paths, path, || sampler.get_1d(Decision::Roulette(bounce))) {
        return false;
    }
    let u = sampler.get_2d(Decision::Direction(bounce));
    let phase = place.medium.phase();
    let (wi, pdf) = match glow {
        None => phase.sample(place.along, u),
        Some(glow) => {
            let lobe = sampler.get_1d(Decision::Lobe(bounce));
            let chosen = if lobe < Glow::SHARE {
                glow.sample(lobe / Glow::SHARE, u)
            } else {
                Some(phase.sample(place.along, u).0)
            };
            let Some(wi) = chosen else { return false };
            let value = phase.value(place.along, wi);
            let pdf = glow.mixed(wi, value);
            paths.beta[path] *= value / pdf;
            (wi, pdf)
        }
    };
    paths.pdf[path] = pdf;
    paths.receivers[path] = Receiver { p: place.p, n: Vec3::ZERO };
    paths.rays[path] = Ray::new(place.p, wi);
    paths.interiors[path] = place.interiors;
    paths.scattered[path] = true;
    true
}

/// Traces the queued shadow rays and adds what arrives through media.
pub(super) fn shadow(scene: &Scene, paths: &mut Paths, counters: &mut Counters) {
    find_blocked(scene, paths, counters);
    for at in 0..paths.shadows.len() {
        if paths.blocked[at] {
            continue;
        }
        let ShadowRay { path, ray, contribution, interiors } = paths.shadows[at];
        let before = paths.marching.tally.evaluations();
        let through = scene.transmittance_through(&ray, interiors, &mut paths.marching.tally);
        paths.count_evaluations(path as usize, before);
        paths.radiance[path as usize] += contribution * through;
    }
}

/// The glow of lights in the medium before a surface; `None` without one, and for surfaces that let light through or
/// mirror it.
pub(super) fn glow_at<'a>(
    scene: &'a Scene,
    vertex: &Vertex<'_>,
    paths: &Paths,
    path: usize,
) -> Option<Glow<'a>> {
    let interiors = paths.interiors[path];
    if vertex.bsdf.is_delta() || vertex.bsdf.transmits() {
        return None;
    }
    // From where the path goes on: beside a lamp, the offset from the surface matters.
    let ray = Ray::new(vertex.origin_towards(-paths.rays[path].d), paths.rays[path].d);
    scene.glow(&ray, interiors, paths.arriving[path])
}

/// Chooses the direction in which a surface scatters, sometimes towards a glow.
pub(super) fn surface_direction(
    vertex: &Vertex<'_>,
    glow: &Glow<'_>,
    lobe: f32,
    u: Vec2,
) -> Option<BsdfSample> {
    if lobe < Glow::SHARE {
        let towards = glow.sample(lobe / Glow::SHARE, u)?;
        let wi = vertex.frame.to_local(towards);
        let (f, scattered) = vertex.bsdf.scatter(vertex.wo, wi);
        let pdf = glow.mixed(towards, scattered);
        return (f != Vec3::ZERO).then(|| BsdfSample { wi, weight: f / pdf, pdf, eta2: 1.0 });
    }
    let rest = (lobe - Glow::SHARE) / (1.0 - Glow::SHARE);
    let sample = vertex.bsdf.sample(vertex.wo, rest, u)?;
    if sample.pdf.is_infinite() {
        return Some(BsdfSample { weight: sample.weight / (1.0 - Glow::SHARE), ..sample });
    }
    let pdf = glow.mixed(vertex.frame.to_world(sample.wi), sample.pdf);
    Some(BsdfSample { weight: sample.weight * (sample.pdf / pdf), pdf, ..sample })
}
