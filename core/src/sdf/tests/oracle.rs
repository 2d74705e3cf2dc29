//! Rays against a proof: interval arithmetic along the ray shows where there is no surface, and where there is one.

use glam::DVec3;

use super::interval::Interval;
use super::objects::{solids, trees};
use super::{Random, exact, ray};
use crate::sdf::{MarchStats, Point, Sdf, SdfRay};

/// An object of every kind of node, and trees of them; what rays meet by formula is marched as well.
fn objects() -> Vec<(String, Sdf)> {
    let all = solids().into_iter().chain(trees());
    all.flat_map(|(name, sdf)| {
        let marched = sdf.is_closed().then(|| (format!("{name}, marched"), sdf.clone().marching()));
        std::iter::once((name.to_owned(), sdf)).chain(marched)
    })
    .collect()
}

/// What is proven of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Proof {
    /// The first place where the surface is.
    Hit(f64),
    Miss,
    /// The ray touches the surface, or comes so close to it that f64 cannot tell.
    Open,
}

/// The first root between 0 and `far`: all before is shown to be outside by intervals that are halved until they say so.
fn prove(sdf: &Sdf, origin: DVec3, dir: DVec3, far: f64, work: &mut u64) -> Proof {
    let along = |axis: usize, t: Interval| {
        Interval::new(origin[axis], origin[axis]) + Interval::new(dir[axis], dir[axis]) * t
    };
    let size = f64::from(sdf.bounds().size().length());
    let least = 1e-9 * size;
    let mut open = None;
    // A place that could not be decided just before a hit is part of it; farther away it may be a hit of its own.
    let hit = |open: Option<f64>, at: f64| {
        if open.is_none_or(|t| at - t < 1e-6 * size) { Proof::Hit(at) } else { Proof::Open }
    };
    let mut pending = vec![Interval::new(0.0, far)];
    while let Some(t) = pending.pop() {
        *work += 1;
        let value: Interval = sdf.tape().distance(Point::new(along(0, t), along(1, t), along(2, t)));
        if value.low > 0.0 {
            continue;
        }
        if value.high < 0.0 {
            return hit(open, t.low);
        }
        if t.high - t.low <= least {
            let after = exact(sdf, origin + dir * (t.high + least));
            if after < 0.0 {
                return hit(open, t.low);
            }
            // Where space is folded an interval is on both sides, however short. Between two places that are a thousand
            // times as far outside as they are apart there is no surface: that is the one thing taken from the slope.
            let before = exact(sdf, origin + dir * t.low);
            if before.min(after) < 1e3 * (2.0 * least) {
                open = open.or(Some(t.low));
            }
            continue;
        }
        let middle = 0.5 * (t.low + t.high);
        pending.push(Interval::new(middle, t.high));
        pending.push(Interval::new(t.low, middle));
    }
    if open.is_some() { Proof::Open } else { Proof::Miss }
}

/// Rays from far away, along the surface, and from close to it.
fn rays(sdf: &Sdf, count: u32) -> Vec<(View, SdfRay)> {
    let mut random = Random(41);
    let (middle, radius) = (sdf.bounds().center(), 0.5 * sdf.bounds().size().length());
    let mut rays = Vec::new();
    while rays.len() < count as usize {
        let origin = middle + random.direction() * radius * 2.0;
        let target = middle + random.direction() * radius * 0.8 * random.next();
        let far = ray(origin, target - origin);
        if rays.len() % 4 < 2 {
            rays.push((View::Far, far));
            continue;
        }
        let Some(t) = super::hit(sdf, &far) else { continue };
        let (p, n) = (far.origin + far.dir * t, sdf.normal(far.origin + far.dir * t));
        let along = n.cross(random.direction()).normalize_or(n.any_orthonormal_vector());
        if rays.len() % 4 == 2 {
            // Past a place of the surface, up to a hundredth of the size above or below.
            let past = p + n * radius * 0.01 * random.within(-1.0, 1.0);
            let origin = past - along * radius * 2.0;
            rays.push((View::Grazing, ray(origin, along)));
        } else {
            let origin = p + n * radius * 0.01;
            let target = p + along * radius * 0.03 * random.next();
            rays.push((View::Close, SdfRay { footprint: 1e-4, ..ray(origin, target - origin) }));
        }
    }
    rays
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum View {
    Far,
    Grazing,
    Close,
}

/// Plain sphere tracing that calls everything closer than `epsilon` a hit.
fn plain(sdf: &Sdf, ray: &SdfRay, epsilon: f32, evaluations: &mut u64) -> Option<f32> {
    let far = 4.0 * sdf.bounds().size().length();
    let mut t = 0.0;
    for _ in 0..4096 {
        *evaluations += 1;
        let value: f32 = sdf.tape().distance(Point::splat(ray.origin + ray.dir * t));
        if value < epsilon {
            return Some(t);
        }
        t += value;
        if t > far {
            break;
        }
    }
    None
}

#[derive(Debug, Default)]
pub(super) struct Record {
    pub(super) rays: u64,
    pub(super) hits: u64,
    pub(super) mismatches: u64,
    /// Hits on features thinner than two least steps, which may be skipped.
    pub(super) thin: u64,
    pub(super) open: u64,
    edges: u64,
    depths: Vec<f64>,
    normals: Vec<f64>,
    work: u64,
    /// Evaluations of the march and of plain sphere tracing, far and close, and grazing.
    evaluations: [[u64; 2]; 2],
}

fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(0.0)
}

/// How long the ray stays inside from `t` on, as far as a few samples can tell.
fn chord(sdf: &Sdf, origin: DVec3, dir: DVec3, t: f64, step: f64) -> f64 {
    let mut length = 0.0;
    while length < 64.0 * step && exact(sdf, origin + dir * (t + length + 0.05 * step)) < 0.0 {
        length += 0.1 * step;
    }
    length
}

/// Holds rays of all views against what is proven.
pub(super) fn examine(name: &str, sdf: &Sdf, count: u32) -> Record {
    let mut record = Record::default();
    let size = f64::from(sdf.bounds().size().length());
    for (view, ray) in rays(sdf, count) {
        let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
        let proof = prove(sdf, origin, dir, 3.0 * size, &mut record.work);
        let mut stats = MarchStats::default();
        let found = sdf.intersect(&ray, &mut stats);
        let grazing = usize::from(view == View::Grazing);
        if stats.exhausted > 0 {
            println!("{name}: {ray:?} ran out of steps and found {found:?}, {proof:?} is proven");
        }
        record.evaluations[grazing][0] += stats.evaluations;
        plain(sdf, &ray, (1e-7 * size) as f32, &mut record.evaluations[grazing][1]);
        record.rays += 1;
        match (proof, found) {
            (Proof::Open, _) => record.open += 1,
            (Proof::Miss, None) => {}
            (Proof::Hit(exactly), Some(t)) => {
                record.hits += 1;
                let p = origin + dir * exactly;
                let h = 1e-6 * size;
                let beside = DVec3::AXES.map(|axis| [exact(sdf, p + axis * h), exact(sdf, p - axis * h)]);
                let steepest = DVec3::from_array(beside.map(|[after, before]| after - before)).normalize();
                // On an edge there are two normals.
                let here = exact(sdf, p);
                let edge =
                    beside.iter().any(|[after, before]| (after + before - 2.0 * here).abs() > 1e-3 * h);
                let n = sdf.normal(ray.origin + ray.dir * t).as_dvec3();
                // Along the normal: how deep a grazing ray is when it hits is a matter of rounding.
                let depth = (f64::from(t) - exactly).abs() * dir.dot(steepest).abs() / size;
                if depth > 1e-4 {
                    println!("{name}: {view:?} {ray:?} found {t}, {exactly} is proven");
                }
                record.depths.push(depth);
                let angle = libm::atan2(n.cross(steepest).length(), n.dot(steepest)).to_degrees();
                if !edge && angle > 1.0 {
                    println!("{name}: {view:?} {ray:?}: normal {n} instead of {steepest} at {p}");
                }
                if edge {
                    record.edges += 1;
                } else {
                    record.normals.push(angle);
                }
            }
            (Proof::Hit(exactly), None) => {
                let least = 2e-4 * exactly;
                if chord(sdf, origin, dir, exactly, least) < least {
                    record.thin += 1;
                } else {
                    record.mismatches += 1;
                }
            }
            (Proof::Miss, Some(t)) => {
                println!("{name}: {ray:?} misses, found {t}");
                record.mismatches += 1;
            }
        }
    }
    record
}

#[test]
fn rays_hit_what_intervals_prove() {
    let (mut rays, mut mismatches, mut open) = (0, 0, 0);
    let mut evaluations = [[0_u64; 2]; 2];
    for (name, sdf) in objects() {
        let mut r = examine(&name, &sdf, 4096);
        let (depth, normal) = (percentile(&mut r.depths, 0.99), percentile(&mut r.normals, 0.99));
        println!(
            "{name:>21}: {} hits, {} mismatches, {} thin, {} open, {} on edges; p99 depth {depth:.1e}, normal {normal:.1e}°; \
             evaluations {:.1} and {:.1}, grazing {:.1} and {:.1} per ray; {:.0} intervals per ray",
            r.hits,
            r.mismatches,
            r.thin,
            r.open,
            r.edges,
            r.evaluations[0][0] as f64 / r.rays as f64 / 0.75,
            r.evaluations[0][1] as f64 / r.rays as f64 / 0.75,
            r.evaluations[1][0] as f64 / r.rays as f64 / 0.25,
            r.evaluations[1][1] as f64 / r.rays as f64 / 0.25,
            r.work as f64 / r.rays as f64,
        );
        assert!(r.hits > r.rays / 4, "{name}: a test that hits nothing shows nothing");
        assert!(r.open * 100 < r.rays, "{name}: {} of {} could not be decided", r.open, r.rays);
        assert!(depth <= 1e-5, "{name}: depth {depth}");
        // Noise and seams have no limit that differences would meet.
        assert!(normal <= 0.1 || name.starts_with("stone"), "{name}: normal {normal}");
        (rays, mismatches, open) = (rays + r.rays, mismatches + r.mismatches, open + r.open);
        for (sums, counts) in evaluations.iter_mut().zip(r.evaluations) {
            *sums = [sums[0] + counts[0], sums[1] + counts[1]];
        }
    }
    println!(
        "{rays} rays: {mismatches} mismatches, {open} open; evaluations of plain sphere tracing: {:.2} of them, \
         grazing {:.2}",
        (evaluations[0][0] + evaluations[1][0]) as f64 / (evaluations[0][1] + evaluations[1][1]) as f64,
        evaluations[1][0] as f64 / evaluations[1][1] as f64
    );
    assert!(mismatches * 10_000 <= rays, "{mismatches} of {rays}");
}

#[test]
fn intervals_hold_what_is_in_them() {
    let mut random = Random(42);
    for (name, sdf) in objects() {
        let reach = f64::from(sdf.bounds().size().length());
        for _ in 0..200 {
            let middle = sdf.bounds().center().as_dvec3()
                + random.direction().as_dvec3() * reach * f64::from(random.next());
            let size = reach * libm::exp10(f64::from(random.within(-6.0, 0.0)));
            let side = |axis: usize| Interval::new(middle[axis] - size, middle[axis] + size);
            let value: Interval = sdf.tape().distance(Point::new(side(0), side(1), side(2)));
            for _ in 0..20 {
                let off = DVec3::from_array([0; 3].map(|_| size * f64::from(random.within(-1.0, 1.0))));
                let inside = exact(&sdf, middle + off);
                assert!(value.low <= inside && inside <= value.high, "{name}: {inside} outside of {value:?}");
            }
        }
    }
}
