//! Owns light from a point that shines in a direction, with three falloffs.

use super::emitter::Emitter;
use super::point::delta_sample;
use super::{LightSample, Receiver};
use crate::color::luminance;
use crate::math::Aabb;
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};
use wide::f32x8;

/// How the intensity of a spotlight falls with the angle θ off its axis; angles in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpotFalloff {
    /// max(cos θ, 0) to the power focus², and nothing from an angle on.
    Focus {
        /// Square root of the exponent.
        focus: f32,
        /// Angle of the edge off the axis, at most 90.
        cutoff_angle: f32,
    },
    /// Full, then linear in the angle down to nothing.
    Linear {
        /// Angle off the axis up to which the light is full.
        beam_width: f32,
        /// Angle of the edge off the axis, at least `beam_width`.
        cutoff_angle: f32,
    },
    /// A smoothstep of the cosine: from 0 at the edge to 1 where the cosine has risen by the share `blend` of what
    /// lies between edge and axis (Blender's spot lamp, as Cycles renders it).
    Blend {
        /// Angle across the whole cone.
        cone_angle: f32,
        /// Share of the cone that is soft, 0 to 1.
        blend: f32,
    },
}

/// A point that shines in a direction. Angles and cosines are kept in f64: a narrow beam lives in the last bits of
/// an f32 cosine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpotLight {
    position: Vec3,
    axis: DVec3,
    intensity: Vec3,
    falloff: Falloff,
    /// Cosine of the edge.
    cos_edge: f64,
    /// Cosine from which on a linear falloff has not begun.
    cos_full: f64,
}

/// [`SpotFalloff`] in the units of its formula.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Falloff {
    Power { exponent: f64 },
    Linear { beam: f64, edge: f64 },
    Smoothstep { width: f64 },
}

impl SpotLight {
    /// A spotlight at a position that shines in a direction of any length but 0, with the intensity (power per solid
    /// angle, linear Rec.709) of its axis.
    pub fn new(position: Vec3, direction: DVec3, intensity: Vec3, falloff: SpotFalloff) -> Self {
        let radians = |degrees: f32| f64::from(degrees).to_radians();
        let (falloff, edge) = match falloff {
            SpotFalloff::Focus { focus, cutoff_angle } => {
                let exponent = f64::from(focus) * f64::from(focus);
                (Falloff::Power { exponent }, radians(cutoff_angle).min(FRAC_PI_2))
            }
            SpotFalloff::Linear { beam_width, cutoff_angle } => {
                let edge = radians(cutoff_angle);
                (Falloff::Linear { beam: radians(beam_width).min(edge), edge }, edge)
            }
            SpotFalloff::Blend { cone_angle, blend } => {
                let edge = radians(cone_angle) * 0.5;
                (Falloff::Smoothstep { width: (1.0 - libm::cos(edge)) * f64::from(blend) }, edge)
            }
        };
        let axis = direction.normalize_or(DVec3::NEG_Z);
        let cos_full = match falloff {
            Falloff::Linear { beam, .. } => libm::cos(beam),
            Falloff::Power { .. } | Falloff::Smoothstep { .. } => 1.0,
        };
        Self { position, axis, intensity, falloff, cos_full, cos_edge: libm::cos(edge) }
    }

    pub(super) fn position(&self) -> Vec3 {
        self.position
    }

    pub(super) fn intensity(&self) -> Vec3 {
        self.intensity
    }

    pub(super) fn axis(&self) -> DVec3 {
        self.axis
    }

    /// Cosine of the angle off the axis from which on there is no light.
    pub(super) fn cos_edge(&self) -> f64 {
        self.cos_edge
    }

    /// Roughly the shares of the intensity at cosines off the axis.
    #[inline]
    pub(super) fn shares(&self, cos: f32x8) -> f32x8 {
        let (zero, one) = (f32x8::splat(0.0), f32x8::splat(1.0));
        match self.falloff {
            Falloff::Power { exponent } => {
                let tiny = f32x8::splat(1e-30);
                (cos.max(tiny).ln() * f32x8::splat(exponent as f32)).max(f32x8::splat(-60.0)).exp()
            }
            Falloff::Linear { beam, edge } => {
                // The angle by the chord, which is exact where beams are narrow.
                let chord = (one - cos).max(zero) * f32x8::splat(0.5);
                let angle = chord.sqrt().min(one).asin() * f32x8::splat(2.0);
                let width = ((edge - beam) as f32).max(1e-6);
                ((f32x8::splat(edge as f32) - angle) / f32x8::splat(width)).max(zero).min(one)
            }
            Falloff::Smoothstep { width } => {
                let width = (width as f32).max(1e-6);
                let t = ((cos - f32x8::splat(self.cos_edge as f32)) / f32x8::splat(width)).max(zero).min(one);
                t * t * (f32x8::splat(3.0) - t * f32x8::splat(2.0))
            }
        }
    }

    /// Share of the intensity that goes along a unit direction away from the light.
    fn share(&self, direction: DVec3) -> f64 {
        let cos = direction.dot(self.axis);
        if cos <= self.cos_edge {
            return 0.0;
        }
        match self.falloff {
            Falloff::Power { exponent } => libm::pow(cos.clamp(0.0, 1.0), exponent),
            Falloff::Linear { .. } if cos >= self.cos_full => 1.0,
            Falloff::Linear { beam, edge } => {
                let angle = libm::atan2(direction.cross(self.axis).length(), cos);
                if angle <= beam { 1.0 } else { ((edge - angle) / (edge - beam)).max(0.0) }
            }
            Falloff::Smoothstep { width } => {
                let t = (cos - self.cos_edge) / width;
                if t < 1.0 { t * t * (3.0 - 2.0 * t) } else { 1.0 }
            }
        }
    }

    pub(super) fn sample(&self, from: &Receiver) -> Option<LightSample> {
        delta_sample(self.position, from.p, |direction| self.intensity * self.share(direction) as f32)
    }

    /// Exactly what it brings, unoccluded, at a squared distance of at least `nearest2`.
    pub(super) fn importance(&self, from: &Receiver, nearest2: f32) -> f32 {
        let towards = self.position - from.p;
        let d2 = towards.length_squared();
        let cos = if from.n == Vec3::ZERO { 1.0 } else { towards.dot(from.n) / d2.sqrt() };
        // Also where the light is too near to have a direction.
        if cos <= 0.0 || d2 <= 0.0 {
            return 0.0;
        }
        let direction = (from.p.as_dvec3() - self.position.as_dvec3()).normalize();
        luminance(self.intensity) * self.share(direction) as f32 * cos / d2.max(nearest2)
    }

    /// Where it shines and how brightly. The tree takes intensities to fall with the cosine outside a full cone, so
    /// the cone is as wide as the light needs to stay above 0 up to its edge.
    pub(super) fn emitter(&self) -> Emitter {
        let edge = libm::acos(self.cos_edge.clamp(-1.0, 1.0));
        let full = match self.falloff {
            // Flatter than the cosine.
            Falloff::Power { exponent } if exponent < 1.0 => edge,
            Falloff::Power { .. } => 0.0,
            Falloff::Linear { beam, .. } => beam,
            Falloff::Smoothstep { width } => libm::acos((self.cos_edge + width).clamp(-1.0, 1.0)),
        };
        let full = full.max(edge - FRAC_PI_2);
        Emitter {
            bounds: Aabb { min: self.position, max: self.position },
            axis: self.axis,
            full,
            fade: edge - full,
            intensity: f64::from(luminance(self.intensity)),
        }
    }

    /// Power in all directions.
    pub fn power(&self) -> Vec3 {
        let edge = libm::acos(self.cos_edge.clamp(-1.0, 1.0));
        let solid_angle = 2.0
            * PI
            * match self.falloff {
                Falloff::Power { exponent } => {
                    (1.0 - libm::pow(self.cos_edge.max(0.0), exponent + 1.0)) / (exponent + 1.0)
                }
                Falloff::Linear { beam, .. } if edge > beam => {
                    1.0 - (libm::sin(edge) - libm::sin(beam)) / (edge - beam)
                }
                Falloff::Linear { .. } => 1.0 - self.cos_edge,
                // Half of what the soft part would have if it were full.
                Falloff::Smoothstep { width } => 1.0 - self.cos_edge - 0.5 * width,
            };
        self.intensity * solid_angle as f32
    }
}
