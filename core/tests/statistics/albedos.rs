//! Owns directional albedos by quadrature of the oracle.

use super::materials::principled;
use super::oracle::{Disney, Triple};
use super::partition::{Grain, Partition};
use super::random::Random;
use super::trial::suspects;
use glam::Vec3;

/// Directional albedo by quadrature of the oracle, with light from the other side as radiance.
pub(crate) fn albedo(p: &Disney, wo: Vec3) -> f64 {
    let bsdf = principled(p);
    let mut random = Random::new(3);
    let mut points = suspects(wo, 1 << 11, &mut random);
    points.extend((0..1 << 13).filter_map(|_| {
        let lobe = random.unit();
        bsdf.sample(wo, lobe, random.pair()).map(|s| s.wi)
    }));
    let partition = Partition::new(&points, Grain { cell: points.len(), leaf: 16 });
    let out: Triple = wo.to_array().map(f64::from);
    let mean = |wi: Vec3| p.value(out, wi.to_array().map(f64::from)).iter().sum::<f64>() / 3.0;
    partition.integrals(&mean, 1.0).iter().sum()
}
