//! Owns a distance-function object as the renderer sees it: tape, bounds and resolved settings.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use wide::f32x8;

use crate::math::Aabb;

use super::cells::{Cells, EVERYWHERE};
use super::closed::{ClosedForm, Ray};
use super::error::{SdfError, require};
use super::march::{Goal, March, MarchStats, Segment};
use super::pace::{Limits, ROUNDOFF};
use super::packet;
use super::real::{Dual, Point, Real};
use super::tape::Tape;

/// What a document may say about the march; `None` is derived.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Settings {
    /// Half the least step of the march, in object units: features thinner than twice this may be skipped.
    /// Derived: a fraction of the pixel's footprint at the distance travelled.
    pub hit_epsilon: Option<f32>,
    /// Distance over which normals are taken, in object units.
    /// Derived: the gradient itself; on fractals 1/64 of their level.
    pub normal_epsilon: Option<f32>,
    /// Largest single step, in object units. Derived: no limit.
    pub step_clamp: Option<f32>,
    /// Most steps of one ray. Derived: 4096, which only rays along a surface need.
    pub max_steps: Option<u32>,
}

/// [`Settings`] with everything that does not depend on the ray filled in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolved {
    /// Half the least step, in object units; `None`: follows the ray's footprint.
    pub hit_epsilon: Option<f32>,
    /// Upper limit for a derived `hit_epsilon`, in object units: 1/4096 of the diagonal of the bounds.
    pub largest_hit_epsilon: f32,
    /// Distance over which normals are taken, in object units; `None`: derived.
    pub normal_epsilon: Option<f32>,
    /// Largest single step, in object units.
    pub step_clamp: f32,
    /// Most steps of one ray.
    pub max_steps: u32,
}

/// Points per edge of the lattices that check given bounds.
const CHECK_POINTS: u16 = 33;

/// An object made of distance functions, ready for rays in object space.
#[derive(Debug, Clone)]
pub struct Sdf {
    tape: Tape,
    /// Which steps matter where, in trees that are large enough.
    cells: Option<Cells>,
    bounds: Aabb,
    resolved: Resolved,
    limits: Limits,
    /// What rays are answered by, where there is one.
    closed: Option<ClosedForm>,
}

impl Sdf {
    /// An object from its tape; `bounds` replace the computed ones where they are given.
    ///
    /// Given bounds are checked on a lattice of 33³ points over the computed bounds; an object without end is cut by
    /// them.
    ///
    /// # Errors
    /// A setting out of range; bounds that are empty, not finite, or cut an object that has an end (with the amount); no
    /// bounds for one that has none.
    pub fn new(tape: Tape, settings: Settings, bounds: Option<Aabb>) -> Result<Self, SdfError> {
        let computed = tape.bounds();
        let endless = !computed.is_empty() && !computed.is_finite();
        let (tape, bounds) = match bounds {
            Some(given) if endless => {
                is_box(given)?;
                (tape.cut(given)?, given)
            }
            Some(given) => {
                let bounds = check_bounds(&tape, given)?;
                (tape, bounds)
            }
            None if endless => return Err(SdfError::Endless),
            // Nothing is somewhere, and no ray hits it.
            None if computed.is_empty() => (tape, Aabb { min: Vec3::ZERO, max: Vec3::ZERO }),
            None => (tape, computed),
        };
        let diagonal = bounds.size().length();
        let resolved = resolve(settings, diagonal)?;
        // Surfaces may touch the bounds; rays should enter clearly outside of them.
        let margin = Vec3::splat(diagonal / 256.0);
        let bounds = Aabb { min: bounds.min - margin, max: bounds.max + margin };
        let cells = Cells::new(&tape, bounds);
        let closed = ClosedForm::of(tape.ops());
        let limits = Limits::new(&resolved, tape.level().is_some());
        Ok(Self { tape, cells, bounds, resolved, limits, closed })
    }

    /// The box that rays are clipped to, in object space: a little larger than the object.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The distance function.
    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// The limits of steps.
    pub(super) fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The settings in force.
    pub fn resolved(&self) -> &Resolved {
        &self.resolved
    }

    /// The first hit of the ray `origin + t dir` with `t_min <= t <= t_max`.
    ///
    /// `dir` need not have unit length. `footprint` is the half width of the ray's pixel cone per unit of distance
    /// (0 = unknown). A ray that starts inside is marched inside and hits where it comes out. A ray that starts on
    /// the surface, or [`Sdf::offset`] away from it, does not hit the place that it leaves. Non-finite rays miss.
    ///
    /// Unblended spheres, boxes, planes, cylinders, capsules, cones and ellipsoids, and up to sixteen of them under
    /// hard operators, are met by formula: exactly, whatever the settings. Everything else is marched, in at most
    /// `max_steps` steps.
    pub fn intersect(&self, ray: &SdfRay, stats: &mut MarchStats) -> Option<f32> {
        if let Some(closed) = &self.closed {
            let (line, unit) = measured(ray)?;
            stats.rays += 1;
            let at = closed.first_hit(self, &line, stats)?;
            return Some(((at / unit) as f32).clamp(ray.t_min, ray.t_max));
        }
        let mut march = self.march(ray, Goal::First)?;
        let at = loop {
            let p = march.point();
            let value = self.distance(p);
            if let ControlFlow::Break(hit) = march.tell(self, value, self.noise(p), stats) {
                break hit;
            }
        };
        stats.rays += 1;
        stats.evaluations += u64::from(march.evaluations());
        let at = at?;
        Some(march.segment().reached(at).clamp(ray.t_min, ray.t_max))
    }

    /// [`Sdf::intersect`] for many rays: `ended` gets the name of a ray, its first hit if it has one, and how many
    /// evaluations that took, for those that enter the bounds.
    ///
    /// The answers are the same, bit for bit; their order is not that of the rays.
    pub fn intersect_all<N: Copy>(
        &self,
        rays: impl Iterator<Item = (N, SdfRay)>,
        stats: &mut MarchStats,
        mut ended: impl FnMut(N, Option<f32>, u32),
    ) {
        if self.closed.is_some() {
            for (name, ray) in rays {
                let before = stats.evaluations;
                let hit = self.intersect(&ray, stats);
                ended(name, hit, (stats.evaluations - before) as u32);
            }
            return;
        }
        let marches = rays.filter_map(|(name, ray)| {
            let march = self.march(&ray, Goal::First)?;
            Some(((name, ray.t_min, ray.t_max), march))
        });
        packet::all_hits(self, marches, stats, |(name, t_min, t_max), t, evaluations| {
            ended(name, t.map(|t| t.clamp(t_min, t_max)), evaluations);
        });
    }

    /// Whether [`Sdf::intersect`] finds a hit, for many rays: `ended` gets the name of a ray, whether it has a hit, and how
    /// many evaluations that took, for those that enter the bounds. Their order is not that of the rays.
    pub fn occluded_all<N: Copy>(
        &self,
        rays: impl Iterator<Item = (N, SdfRay)>,
        stats: &mut MarchStats,
        mut ended: impl FnMut(N, bool, u32),
    ) {
        if self.closed.is_some() {
            self.intersect_all(rays, stats, |name, hit, evaluations| ended(name, hit.is_some(), evaluations));
            return;
        }
        let marches = rays.filter_map(|(name, ray)| Some((name, self.march(&ray, Goal::Any)?)));
        packet::all_hits(self, marches, stats, |name, hit, evaluations| {
            ended(name, hit.is_some(), evaluations);
        });
    }

    /// The march of a ray, unless it misses the bounds.
    fn march(&self, ray: &SdfRay, goal: Goal) -> Option<March> {
        let (line, unit) = measured(ray)?;
        let segment = Segment::clip(self.bounds, line.origin, line.dir, unit, [line.from, line.to])?;
        let epsilon = if ray.footprint > 0.0 { (0.25 * ray.footprint).clamp(1e-6, 1e-3) } else { 1e-4 };
        Some(March::new(segment, epsilon, goal))
    }

    /// The same without its closed form, for comparison.
    #[doc(hidden)]
    #[must_use]
    pub fn marching(mut self) -> Self {
        self.closed = None;
        self
    }

    /// Whether rays are answered by formula.
    pub fn is_closed(&self) -> bool {
        self.closed.is_some()
    }

    /// Values at eight points; those of lanes that are not `wanted` (as bits) mean nothing.
    #[inline]
    pub(super) fn distances(&self, p: Point<f32x8>, wanted: u32) -> f32x8 {
        let Some(cells) = &self.cells else { return self.tape.distance(p) };
        let found = cells.find(p);
        // Lanes of a cell share its list; in many cells the lists together may be longer than the whole.
        let groups = packet::groups(found, wanted);
        let steps: usize = groups.clone().map(|(cell, _)| cells.cost(cell)).sum();
        if steps >= self.tape.ops().len() {
            return self.tape.distance(p);
        }
        let mut values = [0.0; 8];
        for (cell, lanes) in groups {
            let list = cells.list(cell);
            if lanes.is_power_of_two() {
                let lane = lanes.trailing_zeros() as usize;
                let [x, y, z] = [p.x, p.y, p.z].map(|at| at.to_array()[lane]);
                values[lane] = self.tape.of_list(list, Point::<f32>::new(x, y, z));
                continue;
            }
            for (lane, value) in self.tape.of_list(list, p).to_array().into_iter().enumerate() {
                if lanes >> lane & 1 == 1 {
                    values[lane] = value;
                }
            }
        }
        f32x8::new(values)
    }

    /// The value at a point.
    fn distance(&self, p: Vec3) -> f32 {
        self.near(p, Point::splat(p))
    }

    /// The value at a place that rounds to `p`, in any kind of number.
    fn near<R: Real>(&self, p: Vec3, place: Point<R>) -> R {
        let Some(cells) = &self.cells else { return self.tape.distance(place) };
        match cells.find(Point::splat(p)).to_array()[0] {
            EVERYWHERE => self.tape.distance(place),
            cell => self.tape.of_list(cells.list(cell), place),
        }
    }

    /// The same without cells, for comparison.
    #[doc(hidden)]
    #[must_use]
    pub fn without_cells(mut self) -> Self {
        self.cells = None;
        self
    }

    /// Cells that the tree was cut to pieces for, and the mean number of steps that matter in one; `None` for trees that
    /// are evaluated whole.
    pub fn cells(&self) -> Option<(usize, f64)> {
        self.cells.as_ref().map(Cells::extent)
    }

    /// Outward unit normal at a point of the surface: the gradient, which for a ray that comes from outside points to
    /// the side that it comes from. Always finite and of unit length.
    ///
    /// Fractals have no gradient to rely on. Theirs is a difference over [`Sdf::normal_reach`], small against the distance
    /// of their level from the set: a wider one, a pixel's for example, reaches across creases and turns normals around.
    pub fn normal(&self, p: Vec3) -> Vec3 {
        let gradient = match self.normal_reach() {
            Some(h) => self.difference(p, h),
            None => self.near(p, Dual::place(p.as_dvec3())).gradient,
        };
        // The root of a square has no slope where it is 0, which may be on the surface, but a difference has.
        let tiny = self.magnitude(p) / 67_108_864.0;
        let normalized = gradient.try_normalize().or_else(|| self.difference(p, tiny).try_normalize());
        // Where all of that vanishes (between equal children, say) away from the middle is as good as any.
        let middle = self.bounds.center();
        normalized.map(DVec3::as_vec3).or_else(|| (p - middle).try_normalize()).unwrap_or(Vec3::Y)
    }

    /// The distance over which normals are taken, in object units; `None` where they are gradients.
    pub fn normal_reach(&self) -> Option<f32> {
        self.resolved.normal_epsilon.or_else(|| self.tape.level().map(|level| level / 64.0))
    }

    /// The direction of steepest rise between the corners of a tetrahedron around `p`, `h` away along each axis.
    fn difference(&self, p: Vec3, h: f32) -> DVec3 {
        let corners = [[1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, 1.0, 1.0]];
        let values = if h >= self.magnitude(p) / 4096.0 {
            // Wide enough that rounding turns the normal by less than a thousandth.
            let lane = |axis: usize| f32x8::new(std::array::from_fn(|i| p[axis] + h * corners[i & 3][axis]));
            let values = self.distances(Point::new(lane(0), lane(1), lane(2)), 0xff).to_array();
            std::array::from_fn(|i| f64::from(values[i]))
        } else {
            corners.map(|corner| {
                let q = p.as_dvec3() + Vec3::from_array(corner).as_dvec3() * f64::from(h);
                self.near(q.as_vec3(), Point::<f64>::new(q.x, q.y, q.z))
            })
        };
        corners.iter().zip(values).map(|(&corner, value)| Vec3::from_array(corner).as_dvec3() * value).sum()
    }

    /// How far along the normal a ray must start to leave the surface at `p`, in object units:
    /// `|f(p)| + 16 · 2⁻²⁴ · max|p|`, and on fractals half their level.
    pub fn offset(&self, p: Vec3) -> f32 {
        let value = self.distance(p).abs();
        let coarse = self.tape.level().map_or(0.0, |level| 0.5 * level);
        value + coarse.max(16.0 * self.noise(p))
    }

    /// Whether a camera at `eye` whose pixels have the half width `spread` per unit of distance sees a fractal, which has
    /// detail at every size, no closer than single precision resolves.
    ///
    /// # Errors
    /// [`SdfError::TooClose`]: a pixel sees less than two steps of the coordinates at the place that is nearest to it.
    pub fn resolves(&self, eye: Vec3, spread: f32) -> Result<(), SdfError> {
        // The value is a bound: of the distance to a fractal it is a quarter, or less.
        let away = 4.0 * self.distance(eye);
        let pixel = 2.0 * spread * away;
        // Coordinates on the surface are no greater than the camera's when that is near, nor than the bounds allow.
        let farthest = self.bounds.min.abs().max(self.bounds.max.abs()).max_element();
        let least = 4.0 * ROUNDOFF * self.magnitude(eye).min(farthest);
        // Inside of a fractal its value is no distance, and the nearest wall is where the camera is put on purpose.
        let sees_more = !self.has_orbits() || away <= 0.0 || pixel >= least;
        if sees_more { Ok(()) } else { Err(SdfError::TooClose { pixel, least }) }
    }

    /// Rounding error of a value near `p`, in object units.
    pub(super) fn noise(&self, p: Vec3) -> f32 {
        ROUNDOFF * self.magnitude(p)
    }

    /// Rounding errors of values near eight points, in object units.
    #[inline]
    pub(super) fn noises(&self, p: Point<f32x8>) -> f32x8 {
        let largest = Real::max(Real::max(Real::abs(p.x), Real::abs(p.y)), Real::abs(p.z));
        f32x8::splat(ROUNDOFF) * Real::max(largest, f32x8::splat(self.tape.reach().max(1e-30)))
    }

    /// Largest number that the evaluation at `p` adds or subtracts.
    fn magnitude(&self, p: Vec3) -> f32 {
        p.abs().max_element().max(self.tape.reach()).max(1e-30)
    }
}

/// A ray in object space, for [`Sdf::intersect`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SdfRay {
    /// Start.
    pub origin: Vec3,
    /// Direction, of any length: `t` is counted in it.
    pub dir: Vec3,
    /// Least `t` of a hit.
    pub t_min: f32,
    /// Greatest `t` of a hit; may be infinite.
    pub t_max: f32,
    /// Half width of the pixel cone per unit of distance, 0 = unknown.
    pub footprint: f32,
}

/// A ray in f64 and in lengths of the object, and the length of a unit of its own direction; `None` for rays without a
/// direction or without a part that counts.
fn measured(ray: &SdfRay) -> Option<(Ray, f64)> {
    let dir = ray.dir.as_dvec3();
    let unit = dir.length();
    if !(unit > 0.0 && unit.is_finite() && ray.t_min <= ray.t_max) {
        return None;
    }
    let (from, to) = (f64::from(ray.t_min.max(0.0)) * unit, f64::from(ray.t_max) * unit);
    Some((Ray { origin: ray.origin.as_dvec3(), dir: dir * unit.recip(), from, to }, unit))
}

fn resolve(settings: Settings, diagonal: f32) -> Result<Resolved, SdfError> {
    let length = |name, value: Option<f32>| match value {
        Some(v) => require(v > 0.0 && v.is_finite(), name, v, "a length greater than 0, or \"auto\""),
        None => Ok(()),
    };
    length("settings.hit_epsilon", settings.hit_epsilon)?;
    length("settings.normal_epsilon", settings.normal_epsilon)?;
    length("settings.step_clamp", settings.step_clamp)?;
    let max_steps = settings.max_steps.unwrap_or(4096);
    let allowed = "an integer from 1 to 65536, or \"auto\"";
    require((1..=65_536).contains(&max_steps), "settings.max_steps", max_steps as f32, allowed)?;
    Ok(Resolved {
        hit_epsilon: settings.hit_epsilon,
        largest_hit_epsilon: diagonal / 4096.0,
        normal_epsilon: settings.normal_epsilon,
        step_clamp: settings.step_clamp.unwrap_or(f32::INFINITY),
        max_steps,
    })
}

/// Whether a box was given.
fn is_box(given: Aabb) -> Result<(), SdfError> {
    for axis in 0..3 {
        let (low, high) = (given.min[axis], given.max[axis]);
        require(low.is_finite(), "bounds.min", low, "three finite numbers")?;
        require(
            high.is_finite() && high > low,
            "bounds.max",
            high,
            "three finite numbers greater than bounds.min",
        )?;
    }
    Ok(())
}

/// The part of `given` inside the computed bounds, or how much of the object `given` cuts off.
fn check_bounds(tape: &Tape, given: Aabb) -> Result<Aabb, SdfError> {
    is_box(given)?;
    let computed = tape.bounds();
    if computed.is_empty() {
        return Ok(given);
    }
    let mut found = Aabb::EMPTY;
    let spacing = computed.size() / f32::from(CHECK_POINTS - 1);
    for z in 0..CHECK_POINTS {
        for y in 0..CHECK_POINTS {
            for x in 0..CHECK_POINTS {
                let p = computed.min + spacing * Vec3::new(f32::from(x), f32::from(y), f32::from(z));
                let cut = p.cmplt(given.min).any() || p.cmpgt(given.max).any();
                if cut && tape.distance::<f32>(Point::splat(p)) < 0.0 {
                    found = found.with_point(p);
                }
            }
        }
    }
    let beyond = (given.min - found.min).max(found.max - given.max).max_element();
    if beyond > 0.0 {
        let (needed_min, needed_max) = (computed.min, computed.max);
        return Err(SdfError::BoundsTooSmall { amount: beyond, needed_min, needed_max });
    }
    let (min, max) = (given.min.max(computed.min), given.max.min(computed.max));
    // No part of the object was found outside, and the boxes need not even touch: keep a box that can be clipped to.
    if min.cmplt(max).all() { Ok(Aabb { min, max }) } else { Ok(given) }
}
