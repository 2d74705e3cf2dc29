//! Owns the directional albedo of a material, and the factors that keep it from gaining energy.

use super::Principled;
use crate::sampler::{Decision, Replicate, Sampler, Stream};
use glam::Vec3;

/// Factors by the cosine of a direction: what the lobes are scaled by so that their directional albedo is at most 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Conserving {
    /// At the cosines of [`cosine`].
    factors: Vec<Vec3>,
}

/// Cosines from −1 to 1 at which the albedo is tabulated, denser towards 0, where it changes fast.
const NODES: usize = 65;
/// Samples of each.
const SAMPLES: u32 = 2048;
/// What an estimated albedo is multiplied by.
const MARGIN: f32 = 1.01;

/// The cosine of a node: its distance from the middle, squared.
fn cosine(node: usize) -> f32 {
    let t = 2.0 * node as f32 / (NODES - 1) as f32 - 1.0;
    // At grazing itself nothing is seen.
    (t * t).max(1.0e-3).copysign(t)
}

impl Conserving {
    /// Factors that serve every one of some models, which must not have any yet.
    pub fn new(models: &[Principled]) -> Self {
        let albedos = |node| models.iter().map(move |model| model.greatest_albedo(cosine(node)));
        // More than what the estimate and the steps between nodes may be off by.
        let greatest = |node| albedos(node).fold(Vec3::ZERO, Vec3::max) * MARGIN;
        let factors = (0..NODES).map(|node| Vec3::ONE / greatest(node).max(Vec3::ONE)).collect();
        Self { factors }
    }

    /// The factor of a direction with this cosine, of either sign.
    pub(super) fn factor(&self, cos: f32) -> Vec3 {
        let t = cos.abs().min(1.0).sqrt().copysign(cos);
        let at = (t + 1.0) * 0.5 * (NODES - 1) as f32;
        let low = (at as usize).min(NODES - 2);
        let share = at - low as f32;
        self.factors[low] * (1.0 - share) + self.factors[low + 1] * share
    }
}

impl Principled {
    /// Directional albedo towards directions with this cosine, the greatest by channel over the azimuth, estimated from
    /// the model's own samples to about 0.2 %.
    pub fn greatest_albedo(&self, cos: f32) -> Vec3 {
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let diagonal = std::f32::consts::FRAC_1_SQRT_2;
        [(1.0, 0.0), (diagonal, diagonal), (0.0, 1.0)]
            .map(|(x, y)| self.directional_albedo(Vec3::new(sin * x, sin * y, cos)))
            .into_iter()
            .fold(Vec3::ZERO, Vec3::max)
    }

    fn directional_albedo(&self, wo: Vec3) -> Vec3 {
        let sum = (0..SAMPLES).fold(glam::DVec3::ZERO, |sum, index| {
            let sampler = Sampler::new(Stream::new(0, 0), [0, 0], Replicate::A, index);
            let (lobe, u) = (sampler.get_1d(Decision::Lobe(0)), sampler.get_2d(Decision::Direction(0)));
            // Radiance on the other side counts as flux: without the factor 1/η².
            sum + self.sample(wo, lobe, u).map_or(Vec3::ZERO, |s| s.weight * s.eta2).as_dvec3()
        });
        (sum / f64::from(SAMPLES)).as_vec3()
    }
}
