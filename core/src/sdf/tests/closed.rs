//! Closed forms against the value in f64, subdivided along the ray until it is known where its sign changes.

use glam::{DVec3, Mat3, Quat, Vec3};

use super::{Random, exact, moved, object, ray};
use crate::sdf::closed::{ClosedForm, MAX_SOLIDS, Ray};
use crate::sdf::{MarchStats, NodeId, Sdf, SdfRay, TapeBuilder};

/// A turn about a random axis.
fn turn(random: &mut Random) -> Mat3 {
    Mat3::from_quat(Quat::from_scaled_axis(random.direction() * random.within(0.0, 3.0)))
}

/// One of the solids with a closed form, of a size around 1; `kind` counts them, from 0 to 7.
fn solid(t: &mut TapeBuilder, kind: u32, random: &mut Random) -> NodeId {
    let mut length = || random.within(0.2, 1.2);
    let (a, b, c) = (length(), length(), length());
    match kind {
        0 => t.sphere(a),
        1 => t.cuboid(2.0 * Vec3::new(a, b, c)),
        2 => t.cylinder(a, 2.0 * b),
        3 => t.capsule(0.5 * a, b),
        4 => t.cone(a, 0.0, 2.0 * b),
        5 => t.cone(a, b, 2.0 * c),
        6 => t.ellipsoid(Vec3::new(a, b, c)),
        _ => {
            let parts = [t.plane(), t.sphere(a)];
            t.intersection(&parts)
        }
    }
}

/// A random tree of `count` of the first `kinds` solids; the half-space, cut by a ball, counts as one.
fn tree(t: &mut TapeBuilder, kinds: f32, count: u32, random: &mut Random) -> NodeId {
    let node = if count == 1 {
        let kind = random.within(0.0, kinds) as u32;
        solid(t, kind, random)
    } else {
        let left = 1 + (random.next() * (count - 1) as f32) as u32;
        let children = [tree(t, kinds, left, random), tree(t, kinds, count - left, random)];
        match random.within(0.0, 4.0) as u32 {
            // Seldom: little is left of what many are cut with.
            0 if random.next() < 0.5 => t.intersection(&children),
            1 => t.difference(&children),
            _ => t.union(&children),
        }
    };
    let (to, about) = (random.direction() * random.within(0.0, 1.0), turn(random));
    t.transform(node, to, about, random.within(0.5, 1.5))
}

/// `tree` or one solid, placed in the object.
fn placed(seed: u64, kind: Option<u32>, count: u32, to: Vec3, scale: f32) -> Sdf {
    let mut random = Random(seed);
    let sdf = object(|t| {
        let node = match kind {
            Some(kind) => solid(t, kind, &mut random),
            // With half-spaces there may be twice as many solids.
            None => tree(t, if count <= 8 { 8.0 } else { 7.0 }, count, &mut random),
        };
        let about = turn(&mut random);
        t.transform(node, to, about, scale)
    });
    assert!(sdf.is_closed());
    sdf
}

fn middle(sdf: &Sdf) -> DVec3 {
    sdf.bounds().center().as_dvec3()
}

fn radius(sdf: &Sdf) -> f64 {
    0.5 * sdf.bounds().size().as_dvec3().length()
}

/// The ray as the closed form sees it.
fn line(ray: &SdfRay) -> Ray {
    let dir = ray.dir.as_dvec3();
    Ray { origin: ray.origin.as_dvec3(), dir: dir / dir.length(), from: 0.0, to: f64::INFINITY }
}

/// Distance to the first hit in f64, in units of `dir` where that is a unit vector.
pub(super) fn closed(sdf: &Sdf, ray: &SdfRay) -> Option<f64> {
    let form = ClosedForm::of(sdf.tape().ops()).expect("has a closed form");
    form.first_hit(sdf, &line(ray), &mut MarchStats::default())
}

/// What the oracle needs to know; an answer may be out of reach.
enum Answer {
    Hit(f64),
    Miss,
    TooLong,
}

/// The first change of sign along the ray. Values change no faster than the place, so that a piece is left out where
/// both its ends are further from 0 than it is long; others are halved, down to 1e-9 of the object.
fn oracle(sdf: &Sdf, ray: &Ray) -> Answer {
    let value = |at: f64| exact(sdf, ray.origin + ray.dir * at);
    let (ahead, size) = ((middle(sdf) - ray.origin).dot(ray.dir), radius(sdf));
    let (start, end) = ((ahead - 1.1 * size).max(0.0), ahead + 1.1 * size);
    if end <= start {
        return Answer::Miss;
    }
    let mut pending = vec![((start, value(start)), (end, value(end)))];
    for _ in 0..200_000 {
        let Some((a, b)) = pending.pop() else { return Answer::Miss };
        let length = b.0 - a.0;
        let changes = (a.1 < 0.0) != (b.1 < 0.0);
        if !changes && (a.1.abs() + b.1.abs()) > length * (1.0 + 1e-5) {
            continue;
        }
        if length <= (1e-9 * size).max(1e-15 * end.abs()) {
            if changes {
                return Answer::Hit(a.0);
            }
            continue;
        }
        let at = a.0 + 0.5 * length;
        let between = (at, value(at));
        pending.extend([(between, b), (a, between)]);
    }
    Answer::TooLong
}

/// A ray of one of several kinds: towards the object, from inside, from far away, along an axis, along the surface,
/// along an edge of the bounds.
fn pick(sdf: &Sdf, kind: u32, random: &mut Random) -> SdfRay {
    let (middle, size) = (sdf.bounds().center(), radius(sdf) as f32);
    let target = middle + random.direction() * size * 0.8 * random.next();
    let from = |origin: Vec3, target: DVec3| ray(origin, (target - origin.as_dvec3()).as_vec3());
    match kind {
        1 => ray(target, random.direction()),
        2 => from(middle + random.direction() * size * 1e4, target.as_dvec3()),
        3 => {
            let axis = Vec3::AXES[(random.next() * 3.0) as usize];
            let axis = if random.next() < 0.5 { axis } else { -axis };
            ray(target - axis * size * 2.0, axis)
        }
        4 => {
            let seen = from(middle + random.direction() * size * 2.0, target.as_dvec3());
            let Some(at) = closed(sdf, &seen) else { return seen };
            let p = seen.origin + seen.dir * at as f32;
            let normal = sdf.normal(p);
            let along = normal.cross(random.direction()).normalize_or(normal.any_orthonormal_vector());
            let above = p + normal * size * 1e-3 * random.next();
            ray(above - along * size, along + normal * random.within(-2e-3, 1e-3))
        }
        5 => {
            let (axis, bounds) = ((random.next() * 3.0) as usize, sdf.tape().bounds());
            let step = bounds.size() * random.within(-1e-3, 1e-3);
            let mut corner = bounds.min + step;
            corner[axis] -= size;
            ray(corner, Vec3::AXES[axis])
        }
        _ => from(middle + random.direction() * size * 2.0, target.as_dvec3()),
    }
}

/// What rays show about objects.
#[derive(Default)]
struct Comparison {
    rays: usize,
    undecided: usize,
    mismatches: usize,
    /// In units of the object's size, ascending in the end.
    errors: Vec<f64>,
}

impl Comparison {
    fn add(&mut self, sdf: &Sdf, count: usize, random: &mut Random) {
        let size = radius(sdf);
        for i in 0..count {
            let ray = pick(sdf, (i % 6) as u32, random);
            if exact(sdf, ray.origin.as_dvec3()).abs() < 8.0 * f64::from(sdf.noise(ray.origin)) {
                // On the surface, as far as it can tell: other rules hold.
                continue;
            }
            self.rays += 1;
            match (closed(sdf, &ray), oracle(sdf, &line(&ray))) {
                (_, Answer::TooLong) => self.undecided += 1,
                (Some(got), Answer::Hit(want)) => {
                    self.errors.push((got - want).abs() / size);
                    let ray = line(&ray);
                    let value = exact(sdf, ray.origin + ray.dir * got);
                    let far = ray.origin.length() + got + f64::from(sdf.tape().reach());
                    assert!(value.abs() <= 1e-13 * far + 1e-7 * size, "{value} at a hit, {ray:?}");
                }
                (None, Answer::Miss) => {}
                (got, _) => {
                    println!("kind {}: {ray:?} {got:?}", i % 6);
                    self.mismatches += 1;
                }
            }
        }
    }

    fn judge(mut self, name: &str) {
        self.errors.sort_by(f64::total_cmp);
        let at = |share: f64| self.errors[((self.errors.len() - 1) as f64 * share) as usize];
        println!(
            "{name}: {} rays, {} hits, {} undecided, {} mismatches, depth error p50 {:.1e} p99 {:.1e} max {:.1e}",
            self.rays,
            self.errors.len(),
            self.undecided,
            self.mismatches,
            at(0.5),
            at(0.99),
            at(1.0)
        );
        assert!(self.errors.len() > self.rays / 8, "a test that hits nothing shows nothing");
        assert!(self.undecided * 200 < self.rays);
        assert!(self.mismatches * 10_000 <= self.rays);
        assert!(at(0.99) < 1e-8);
    }
}

#[test]
fn solids_agree_with_the_oracle_at_all_scales() {
    for kind in 0..8 {
        let mut random = Random(u64::from(kind) + 1);
        let mut found = Comparison::default();
        for (scale, away) in [(1.0, 0.0), (1e-4, 0.0), (1e-4, 1.0), (1e3, 1e4), (1e-2, 1e2), (1.0, 1e4)] {
            for seed in 0..8 {
                let to = random.direction() * away;
                found.add(&placed(seed, Some(kind), 1, to, scale), 300, &mut random);
            }
        }
        found.judge(&format!("solid {kind}"));
    }
}

#[test]
fn random_trees_agree_with_the_oracle() {
    let mut random = Random(23);
    let mut found = Comparison::default();
    for count in 2..=16 {
        for seed in 0..18 {
            let (scale, away) = [(1.0, 0.0), (1e-4, 1e-4), (1e3, 1e4)][seed as usize % 3];
            let sdf = placed(100 * u64::from(count) + seed, None, count, Vec3::ONE * away, scale);
            if !sdf.tape().bounds().is_empty() {
                found.add(&sdf, 240, &mut random);
            }
        }
    }
    found.judge("trees");
}

#[test]
fn sixteen_solids_are_closed_and_seventeen_are_marched() {
    for (count, is_closed) in [(MAX_SOLIDS, true), (MAX_SOLIDS + 1, false)] {
        let sdf = object(|t| {
            let balls: Vec<_> = (0..count)
                .map(|i| {
                    let ball = t.sphere(0.4);
                    moved(t, ball, Vec3::X * i as f32)
                })
                .collect();
            t.union(&balls)
        });
        assert_eq!(sdf.is_closed(), is_closed);
        for i in 0..count {
            let at = super::hit(&sdf, &ray(Vec3::new(i as f32, 3.0, 0.0), Vec3::NEG_Y)).expect("a ball");
            assert!((at - 2.6).abs() < 1e-5, "{at}");
        }
    }
    assert!(!object(super::melted).is_closed());
    assert!(!object(|t| t.rounded_box(Vec3::ONE, 0.1)).is_closed());
}
