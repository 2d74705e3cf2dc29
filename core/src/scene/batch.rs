//! Owns asking many rays at a time, so that distance functions are marched eight rays at a time.

use super::compiled::Scene;
use super::object::Hit;
use super::tally::Tally;
use super::trees::Entry;
use crate::bvh::Cast;
use crate::math::Ray;

/// What marching many rays needs, kept from batch to batch for its memory, and what it counts.
#[derive(Debug, Default)]
pub struct Marching {
    waiting: Waiting,
    /// What was counted so far.
    pub tally: Tally,
    /// Evaluations of distance functions by ray of the last batch; empty in scenes without such functions.
    pub spent: Vec<u32>,
}

impl Marching {
    /// Starts a batch of rays whose evaluations are counted.
    fn start(&mut self, counted: usize) {
        self.waiting.clear();
        self.spent.clear();
        self.spent.resize(counted, 0);
    }
}

/// Rays and the objects whose boxes they enter and that they must be marched to.
#[derive(Debug, Default)]
struct Waiting {
    /// Objects, those of a ray together, nearer boxes first.
    objects: Vec<u32>,
    /// Rays that have objects left, and which.
    rays: Vec<Visits>,
    /// Pairs of an object and a ray for one march, sorted.
    turn: Vec<(u32, u32)>,
}

/// Objects that a ray has still to be held against: a range of [`Waiting::objects`].
#[derive(Debug, Clone, Copy)]
struct Visits {
    ray: u32,
    next: u32,
    end: u32,
}

impl Waiting {
    fn clear(&mut self) {
        self.objects.clear();
        self.rays.clear();
    }

    /// Ends the list of objects of a ray, which began at `first`.
    fn close(&mut self, ray: u32, first: usize) {
        if first < self.objects.len() {
            self.rays.push(Visits { ray, next: first as u32, end: self.objects.len() as u32 });
        }
    }

    /// The next object of every ray that `wants` one, by object; false when there is none.
    fn next_turn(&mut self, wants: impl Fn(u32) -> bool) -> bool {
        self.turn.clear();
        for visits in &mut self.rays {
            if wants(visits.ray) {
                self.turn.push((self.objects[visits.next as usize], visits.ray));
                visits.next += 1;
            } else {
                visits.next = visits.end;
            }
        }
        self.rays.retain(|visits| visits.next < visits.end);
        self.turn.sort_unstable();
        !self.turn.is_empty()
    }

    /// The turn, cut where the object changes.
    fn groups(&self) -> impl Iterator<Item = (u32, &[(u32, u32)])> {
        self.turn.chunk_by(|a, b| a.0 == b.0).map(|group| (group[0].0, group))
    }
}

impl Scene {
    /// [`Scene::intersect`] of the `active` ones of many rays, into the `hits` with the same numbers.
    pub fn intersect_all(
        &self,
        rays: &[Ray],
        active: &[u32],
        spread: f32,
        hits: &mut [Option<Hit>],
        marching: &mut Marching,
    ) {
        marching.start(if self.function_count() > 0 { rays.len() } else { 0 });
        let Marching { waiting, tally, spent } = marching;
        for &ray in active {
            let (first, before) = (waiting.objects.len(), tally.evaluations());
            hits[ray as usize] = self.nearest(&rays[ray as usize], spread, tally, true, |number, object| {
                let marched = object.is_marched();
                if marched {
                    waiting.objects.push(number);
                }
                !marched
            });
            waiting.close(ray, first);
            if let Some(spent) = spent.get_mut(ray as usize) {
                *spent = (tally.evaluations() - before) as u32;
            }
        }
        while waiting.next_turn(|_| true) {
            for (number, group) in waiting.groups() {
                let within = |&(_, ray): &(u32, u32)| {
                    let t_max = hits[ray as usize].map_or(rays[ray as usize].t_max, |hit| hit.t);
                    (ray, Ray { t_max, ..rays[ray as usize] })
                };
                let wave: Vec<_> = group.iter().map(within).collect();
                self.objects[number as usize].march_all(&wave, spread, tally, |ray, t, evaluations| {
                    spent[ray as usize] += evaluations;
                    let hit = t.map(|t| Hit { t, object: number, primitive: 0, barycentric: [0.0; 2] });
                    let best = &mut hits[ray as usize];
                    *best = Hit::nearer(*best, hit);
                });
            }
        }
    }

    /// Whether anything that is there in whole lies within each of many rays, into `blocked`.
    pub(crate) fn occluded_all(
        &self,
        rays: impl Iterator<Item = Ray>,
        blocked: &mut Vec<bool>,
        marching: &mut Marching,
    ) {
        let rays: Vec<Ray> = rays.collect();
        blocked.clear();
        marching.start(if self.function_count() > 0 { rays.len() } else { 0 });
        let Marching { waiting, tally, spent } = marching;
        for (number, ray) in rays.iter().enumerate() {
            let (first, before) = (waiting.objects.len(), tally.evaluations());
            let stopped = self.stops(ray, waiting, tally);
            if stopped {
                waiting.objects.truncate(first);
            }
            blocked.push(stopped);
            waiting.close(number as u32, first);
            if let Some(spent) = spent.get_mut(number) {
                *spent = (tally.evaluations() - before) as u32;
            }
        }
        while waiting.next_turn(|ray| !blocked[ray as usize]) {
            for (number, group) in waiting.groups() {
                let wave: Vec<_> = group.iter().map(|&(_, ray)| (ray, rays[ray as usize])).collect();
                let object = &self.objects[number as usize];
                object.march_any(&wave, tally, |ray, is_hit, evaluations| {
                    spent[ray as usize] += evaluations;
                    blocked[ray as usize] |= is_hit;
                });
            }
        }
    }

    /// Whether something that needs no march stops a ray; what needs one is noted.
    fn stops(&self, ray: &Ray, waiting: &mut Waiting, tally: &mut Tally) -> bool {
        let mut t_max = ray.t_max;
        let cast = Cast::new(ray.o, ray.d);
        let tree = &self.trees.tree;
        tree.traverse(cast.boxes(), &mut t_max, |first, count, _| {
            let slots = &tree.slots()[first as usize..(first + count) as usize];
            slots.iter().any(|&slot| match self.trees.entries[slot as usize] {
                Entry::Soup => self.trees.soup_occludes(&cast, ray.t_max),
                Entry::Object(number) => {
                    let object = &self.objects[number as usize];
                    if object.is_marched() && !object.holes {
                        waiting.objects.push(number);
                    }
                    !object.holes && !object.is_marched() && object.occluded(ray, &cast, tally)
                }
            })
        })
    }
}
