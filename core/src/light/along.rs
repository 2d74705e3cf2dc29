//! Owns light that a segment of a ray scatters towards its origin: which light, and where along the segment.
//!
//! Directly from a light at L to a point at t and on along the ray, a medium scatters
//! `σ_s exp(−σ_t (t + r)) p(cos) I / r²` per unit of length. In the angle φ at L between the segment and its nearest point,
//! `t = δ + D tan φ`, the factor `dt/dφ = r²/D` takes out the square of the distance (Kulla and Fajardo 2012,
//! "Importance Sampling Techniques for Path Tracing in Participating Media"). What is left is smooth: its values at eight
//! places even in φ are one register, and the curve through them is the density. Its integral says how much the light may
//! bring, so that lights are chosen by it too.

use super::beacon::{Beacon, Span};
use super::{Lights, Receiver};
use crate::math::{atan2, ln, sin_cos};
use crate::medium::Medium;
use glam::Vec3;
use std::f32::consts::PI;
use wide::{f32x4, f32x8};

/// A light and a place along a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Along {
    /// Number of the light.
    pub light: usize,
    /// Distance from the origin of the ray.
    pub t: f32,
    /// Density of the place per unit of length, times the probability of the light.
    pub pdf: f32,
}

/// The random numbers of a choice along a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers {
    /// Which light.
    pub light: f32,
    /// Where.
    pub place: f32,
    /// Where the tree of many lights is asked.
    pub view: f32,
}

/// Places at which a table knows its values.
const NODES: usize = 8;

/// Least part of a table's greatest value: what is between places is not known.
const FLOOR: f32 = 0.02;

/// Steepest exponent: darker places are taken to be this dark, so that none is left out.
const DARKEST: f32 = -60.0;

/// How often the tree of many lights is left aside and lights are chosen by brightness alone: it may not see lights that
/// shine on another part of the segment.
const BLIND: f32 = 0.125;

/// What one light may bring along a segment, by the angle at it.
#[derive(Debug, Clone, Copy)]
struct Table {
    values: [f32; NODES],
    /// The integral.
    total: f32,
    /// Angle of the first value, and from each to the next.
    first: f32,
    step: f32,
    /// Where the ray comes nearest, and how near.
    nearest: f32,
    distance: f32,
}

impl Table {
    /// `None` where the light brings nothing.
    fn new(beacon: &Beacon, span: Span, medium: &Medium, beta: Vec3) -> Option<Self> {
        let clipped = beacon.clip(span)?;
        let to_light = beacon.position - span.o;
        let nearest = to_light.dot(span.d);
        let apart = (to_light - span.d * nearest).length_squared() + beacon.radius * beacon.radius;
        // A ray through the light itself, or a part of one that points to it: the density is defensive there, and right all
        // the same. Angles near a right angle do not tell places apart.
        let length = clipped.far - clipped.near;
        let gap = (clipped.near - nearest).max(nearest - clipped.far).max(0.0);
        let defence = (1e-6 * if length.is_finite() { length } else { to_light.length() }).max(0.1 * gap);
        let distance = apart.sqrt().max(defence).max(f32::MIN_POSITIVE);
        let ends = f32x4::new([clipped.near - nearest, clipped.far - nearest, 0.0, 0.0]);
        let [first, last, ..] = angles(ends, distance);
        let step = (last - first) / (NODES - 1) as f32;
        if step <= 0.0 || step.is_nan() {
            return None;
        }
        let bright = beacon.brightness(beta);
        let (sigma_t, sigma_s) = medium.mean(beacon.intensity * beta);
        let values = values(beacon, span, [first, step, nearest, distance], (sigma_t, medium.phase().g()));
        let scale = bright * sigma_s / distance;
        let greatest = values.max_lane() * scale;
        let values = (values * f32x8::splat(scale)).max(f32x8::splat(FLOOR * greatest)).to_array();
        let inner: f32 = values[1..NODES - 1].iter().sum();
        let total = step * (inner + 0.5 * (values[0] + values[NODES - 1]));
        let usable = total > 0.0 && total.is_finite();
        usable.then_some(Self { values, total, first, step, nearest, distance })
    }

    /// The place of a share `u` of the whole, and the density there per unit of length.
    fn sample(&self, u: f32) -> (f32, f32) {
        let mut rest = u * self.total / self.step;
        let mut interval = 0;
        while interval + 2 < NODES {
            let part = 0.5 * (self.values[interval] + self.values[interval + 1]);
            if rest < part {
                break;
            }
            rest -= part;
            interval += 1;
        }
        let [low, high] = [self.values[interval], self.values[interval + 1]];
        // The stable root of `low x + (high - low) x² / 2 = rest`.
        let root = (low * low + 2.0 * (high - low) * rest).max(0.0).sqrt();
        let part = (2.0 * rest / (low + root)).clamp(0.0, 1.0);
        let value = low + (high - low) * part;
        let angle = self.first + self.step * (interval as f32 + part);
        let (sin, cos) = sin_cos(angle);
        let cos = cos.max(1e-18);
        (self.nearest + self.distance * (sin / cos), value / self.total * (cos * cos / self.distance))
    }

    /// The density of a place per unit of length.
    fn density(&self, t: f32) -> f32 {
        let (along, distance) = (t - self.nearest, self.distance);
        let at = (atan2(along, distance) - self.first) / self.step;
        if !(0.0..=(NODES - 1) as f32).contains(&at) {
            return 0.0;
        }
        let interval = (at as usize).min(NODES - 2);
        let [low, high] = [self.values[interval], self.values[interval + 1]];
        let value = low + (high - low) * (at - interval as f32);
        value / self.total * (distance / (along * along + distance * distance))
    }
}

/// The angles at a light between its nearest point on a ray, at a distance, and places that are so far along from there;
/// infinitely far is a right angle.
#[inline]
fn angles(along: f32x4, distance: f32) -> [f32; 4] {
    let most = f32x4::splat(1e12 * distance);
    along.max(-most).min(most).atan2(f32x4::splat(distance)).to_array()
}

/// The integrand at the places of a table, but for constant factors.
#[inline]
fn values(
    beacon: &Beacon,
    span: Span,
    [first, step, nearest, distance]: [f32; 4],
    (sigma_t, g): (f32, f32),
) -> f32x8 {
    let splat = f32x8::splat;
    let places = f32x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let (sin, cos) = (splat(first) + splat(step) * places).sin_cos();
    let cos = cos.max(splat(1e-18));
    let along = splat(distance) * sin / cos;
    let far = splat(distance) / cos;
    let t = along + splat(nearest);
    // Where the way from the light leaves the medium is not known here: it is taken to be all inside.
    let dark = ((splat(span.near) - t - far) * splat(sigma_t)).max(splat(DARKEST)).exp();
    // The cosine between the light's direction and the ray back is that of the angle's complement.
    let off = if g >= 0.0 { splat(1.0) + sin } else { splat(1.0) - sin };
    let g = g.abs();
    let k = splat((1.0 - g) * (1.0 - g)) + splat(2.0 * g) * off.max(splat(0.0));
    let phase = splat((1.0 - g * g) / (4.0 * PI)) / (k * k.sqrt());
    let away = span.o - beacon.position;
    let direction = [0, 1, 2].map(|axis: usize| (splat(away[axis]) + splat(span.d[axis]) * t) / far);
    dark * phase * beacon.share(direction)
}

trait MaxLane {
    fn max_lane(self) -> f32;
}

impl MaxLane for f32x8 {
    fn max_lane(self) -> f32 {
        self.to_array().into_iter().fold(0.0, f32::max)
    }
}

/// Lights at a finite distance, as segments see them.
#[derive(Debug, Clone, Default)]
pub(super) struct Beacons {
    /// By light; `None` of those that are not sampled along segments.
    all: Vec<Option<Beacon>>,
    /// Luminances of their intensities, added up.
    brightness: f32,
}

impl Beacons {
    pub(super) fn new(lights: &[super::Light]) -> Self {
        let all: Vec<_> = lights.iter().map(Beacon::of).collect();
        let brightness = all.iter().flatten().map(|beacon| beacon.brightness(Vec3::ONE)).sum();
        Self { all, brightness }
    }

    /// Those that there are, by light.
    pub(super) fn all(&self) -> impl Iterator<Item = (usize, &Beacon)> {
        self.all.iter().enumerate().filter_map(|(light, beacon)| Some((light, beacon.as_ref()?)))
    }
}

/// The place on a segment from which many lights are seen: one that light gets to.
fn view_of(span: Span, medium: &Medium, beta: Vec3, u: f32) -> Receiver {
    let length = span.far - span.near;
    let deep = -ln(1.0 - u) / medium.mean(beta).0;
    // Where that is too far, as likely anywhere.
    let at = if deep < length { deep } else { u * length };
    let at = if at.is_finite() { at } else { 0.0 };
    Receiver { p: span.o + span.d * (span.near + at), n: Vec3::ZERO }
}

impl Lights {
    /// Chooses a light at a finite distance and a place on a segment that it shines on, for a path with this throughput
    /// in a medium; `None` where no such light brings anything.
    ///
    /// Every place and light that bring something have a density.
    pub fn along(&self, span: Span, medium: &Medium, beta: Vec3, numbers: Numbers) -> Option<Along> {
        if self.beacons.brightness <= 0.0 || span.near >= span.far {
            return None;
        }
        if self.all.len() > Self::WEIGH_ALL {
            let (light, chosen) = self.one_of_many(view_of(span, medium, beta, numbers.view), numbers)?;
            let table = Table::new(self.beacons.all[light].as_ref()?, span, medium, beta)?;
            let (t, pdf) = table.sample(numbers.place);
            return Some(Along { light, t, pdf: pdf * chosen });
        }
        let (light, table, total) = self.one_of_few(span, medium, beta, numbers.light)?;
        let (t, pdf) = table.sample(numbers.place);
        Some(Along { light, t, pdf: pdf * (table.total / total) })
    }

    /// Chooses one of few lights for a segment by the integrals of their tables: its table, and the sum of all.
    ///
    /// Table by table the new one takes the place of the chosen one with the share that it has of all so far, and the
    /// random number is stretched again, so that only one table is kept.
    fn one_of_few(
        &self,
        span: Span,
        medium: &Medium,
        beta: Vec3,
        number: f32,
    ) -> Option<(usize, Table, f32)> {
        let (mut chosen, mut total, mut number) = (None, 0.0, f64::from(number));
        for (light, beacon) in self.beacons.all() {
            let Some(table) = Table::new(beacon, span, medium, beta) else { continue };
            total += table.total;
            let share = f64::from(table.total / total);
            if chosen.is_none() || number < share {
                number = (number / share).min(1.0);
                chosen = Some((light, table));
            } else {
                number = (number - share) / (1.0 - share);
            }
        }
        chosen.map(|(light, table)| (light, table, total))
    }

    /// Chooses one of many lights for a segment: by the tree as a place on it sees them, or blindly.
    fn one_of_many(&self, from: Receiver, numbers: Numbers) -> Option<(usize, f32)> {
        let by_brightness = |light: usize| {
            self.beacons.all[light].as_ref().map_or(0.0, |beacon| beacon.brightness(Vec3::ONE))
        };
        let light = if numbers.light < BLIND {
            let weights = (0..self.all.len()).map(|light| (light, by_brightness(light)));
            super::choice::pick(weights, numbers.light / BLIND * self.beacons.brightness)?.0
        } else {
            self.choose(&from, (numbers.light - BLIND) / (1.0 - BLIND))?.0
        };
        let blind = by_brightness(light) / self.beacons.brightness;
        Some((light, BLIND * blind + (1.0 - BLIND) * self.choice_pdf(&from, light)))
    }

    /// Density with which [`Lights::along`] chooses a light and a place, given what it was asked.
    pub fn along_pdf(
        &self,
        span: Span,
        medium: &Medium,
        beta: Vec3,
        view: f32,
        (light, t): (usize, f32),
    ) -> f32 {
        let table_of = |light: usize| {
            self.beacons.all[light].as_ref().and_then(|beacon| Table::new(beacon, span, medium, beta))
        };
        let Some(table) = table_of(light) else { return 0.0 };
        let chosen = if self.all.len() > Self::WEIGH_ALL {
            let from = view_of(span, medium, beta, view);
            let bright = self.beacons.all[light].as_ref().map_or(0.0, |beacon| beacon.brightness(Vec3::ONE));
            BLIND * bright / self.beacons.brightness + (1.0 - BLIND) * self.choice_pdf(&from, light)
        } else {
            let total: f32 = (0..self.all.len()).filter_map(table_of).map(|table| table.total).sum();
            table.total / total
        };
        table.density(t) * chosen
    }

    /// Whether there are lights at a finite distance.
    pub fn has_beacons(&self) -> bool {
        self.beacons.brightness > 0.0
    }
}
