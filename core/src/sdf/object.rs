//! Owns a distance-function object as the renderer sees it: tape, bounds and resolved settings.

use glam::Vec3;

use crate::math::Aabb;

use super::closed::{ClosedForm, Ray};
use super::error::{SdfError, require};
use super::march::{self, MarchStats, ROUNDOFF, Segment};
use super::real::Point;
use super::tape::Tape;

/// What a document may say about the march; `None` is derived.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Settings {
    /// Half the least step of the march, in object units: features thinner than twice this may be skipped.
    /// Derived: a fraction of the pixel's footprint at the distance travelled.
    pub hit_epsilon: Option<f32>,
    /// Distance over which normals are taken, in object units.
    /// Derived: as small as f64 allows; on fractals the pixel's footprint, and no less than their level.
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
    /// Distance over which normals are taken, in object units; `None`: derived at each point.
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
    bounds: Aabb,
    resolved: Resolved,
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
        let closed = ClosedForm::of(tape.ops());
        Ok(Self { tape, bounds, resolved, closed })
    }

    /// The box that rays are clipped to, in object space: a little larger than the object.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The distance function.
    pub fn tape(&self) -> &Tape {
        &self.tape
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
        let dir = ray.dir.as_dvec3();
        let length = dir.length();
        if !(length > 0.0 && length.is_finite() && ray.t_min <= ray.t_max) {
            return None;
        }
        let from = f64::from(ray.t_min.max(0.0)) * length;
        let to = f64::from(ray.t_max) * length;
        let (origin, dir) = (ray.origin.as_dvec3(), dir / length);
        let at = if let Some(closed) = &self.closed {
            closed.first_hit(self, &Ray { origin, dir, from, to }, stats)?
        } else {
            let segment = Segment::clip(self.bounds, origin, dir, from, to)?;
            let epsilon = if ray.footprint > 0.0 { (0.25 * ray.footprint).clamp(1e-6, 1e-3) } else { 1e-4 };
            segment.start + f64::from(march::first_hit(self, &segment, epsilon, stats)?)
        };
        Some(((at / length) as f32).clamp(ray.t_min, ray.t_max))
    }

    /// The same object without its closed form.
    #[cfg(test)]
    pub(super) fn marching(mut self) -> Self {
        self.closed = None;
        self
    }

    /// Whether rays are answered by formula.
    #[cfg(test)]
    pub(super) fn is_closed(&self) -> bool {
        self.closed.is_some()
    }

    /// Outward unit normal at a point of the surface, from differences at the corners of a small tetrahedron.
    ///
    /// `footprint` is the half width of the pixel cone at `p` in object units (0 = unknown): fractals have no limit
    /// normal, so theirs is taken over the footprint. Always finite and of unit length.
    pub fn normal(&self, p: Vec3, footprint: f32) -> Vec3 {
        let derived = match self.tape.level() {
            Some(level) => f64::from(footprint.max(level)),
            None => f64::from(self.magnitude(p)) / f64::from(1_u32 << 26),
        };
        let h = self.resolved.normal_epsilon.map_or(derived, f64::from).max(f64::MIN_POSITIVE);
        let mut gradient = glam::DVec3::ZERO;
        for corner in [[1.0, -1.0, -1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, 1.0, 1.0]] {
            let corner = glam::DVec3::from_array(corner);
            let q = p.as_dvec3() + corner * h;
            gradient += corner * self.tape.distance::<f64>(Point::new(q.x, q.y, q.z));
        }
        // Where the gradient vanishes (between equal children, say) away from the middle is as good as any.
        let middle = self.bounds.center();
        gradient
            .try_normalize()
            .map(glam::DVec3::as_vec3)
            .or_else(|| (p - middle).try_normalize())
            .unwrap_or(Vec3::Y)
    }

    /// How far along the normal a ray must start to leave the surface at `p`, in object units:
    /// `|f(p)| + 16 · 2⁻²⁴ · max|p|`, and on fractals half their level.
    pub fn offset(&self, p: Vec3) -> f32 {
        let value = self.tape.distance::<f32>(Point::splat(p)).abs();
        let coarse = self.tape.level().map_or(0.0, |level| 0.5 * level);
        value + coarse.max(16.0 * self.noise(p))
    }

    /// Rounding error of a value near `p`, in object units.
    pub(super) fn noise(&self, p: Vec3) -> f32 {
        ROUNDOFF * self.magnitude(p)
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
