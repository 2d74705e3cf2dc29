//! Owns light from a disk infinitely far away.

use super::{LightSample, Receiver, Target};
use crate::color::luminance;
use crate::math::Frame;
use crate::warp::{cone_uniform, cone_uniform_pdf};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;

/// A disk of even radiance in the sky; without size, one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunLight {
    /// Unit direction to its centre.
    towards: DVec3,
    /// Of a surface that faces it.
    irradiance: Vec3,
    /// 1 − cos of half the angle across it; 0 without size.
    one_minus_cos: f64,
}

impl SunLight {
    /// Suns with a smaller 1 − cos than this (0.00016 degrees across) have no size: directions in f32 could not tell
    /// their parts apart.
    const SMALLEST: f64 = 1e-12;

    /// A sun whose light travels in a direction of any length but 0, with the irradiance of a surface that faces it
    /// (linear Rec.709), `angular_size` degrees across.
    pub fn new(direction: DVec3, irradiance: Vec3, angular_size: f32) -> Self {
        let sin = libm::sin(f64::from(angular_size).to_radians() * 0.25);
        let one_minus_cos = 2.0 * sin * sin;
        let one_minus_cos = if one_minus_cos < Self::SMALLEST { 0.0 } else { one_minus_cos };
        Self { towards: -direction.normalize_or(DVec3::NEG_Y), irradiance, one_minus_cos }
    }

    /// Whether all its light comes from one direction.
    pub fn is_delta(&self) -> bool {
        self.one_minus_cos == 0.0
    }

    /// Radiance of the disk: irradiance over π sin² of its half angle.
    fn radiance(&self) -> Vec3 {
        let sin2 = self.one_minus_cos * (2.0 - self.one_minus_cos);
        self.irradiance / (PI * sin2) as f32
    }

    pub(super) fn sample(&self, u: Vec2) -> LightSample {
        let axis = self.towards.as_vec3();
        if self.is_delta() {
            let radiance = self.irradiance;
            return LightSample { wi: axis, radiance, pdf: 1.0, delta: true, target: Target::Infinity };
        }
        let one_minus_cos = self.one_minus_cos as f32;
        let wi = Frame::new(axis).to_world(cone_uniform(u, one_minus_cos)).normalize();
        let pdf = cone_uniform_pdf(one_minus_cos);
        LightSample { wi, radiance: self.radiance(), pdf, delta: false, target: Target::Infinity }
    }

    /// Radiance along a direction and the density of sampling it; `None` beside the disk.
    pub(super) fn seen(&self, d: Vec3) -> Option<(Vec3, f32)> {
        // |d − axis|² / 2 is 1 − cos without its cancellation.
        let off = (d.as_dvec3().normalize_or_zero() - self.towards).length_squared() * 0.5;
        (off < self.one_minus_cos).then(|| (self.radiance(), cone_uniform_pdf(self.one_minus_cos as f32)))
    }

    /// Irradiance by the part of the disk that is nearest to the receiver's normal.
    pub(super) fn importance(&self, from: &Receiver) -> f32 {
        let irradiance = luminance(self.irradiance);
        if from.n == Vec3::ZERO {
            return irradiance;
        }
        let cos = self.towards.as_vec3().dot(from.n);
        let cos_disk = (1.0 - self.one_minus_cos) as f32;
        if cos >= cos_disk {
            return irradiance;
        }
        let sin_disk = (self.one_minus_cos * (2.0 - self.one_minus_cos)).sqrt() as f32;
        irradiance * (cos * cos_disk + (1.0 - cos * cos).max(0.0).sqrt() * sin_disk).max(0.0)
    }
}
