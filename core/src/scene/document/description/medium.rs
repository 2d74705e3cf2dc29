//! Owns what fills space: fog, and what is inside of things.

use glam::Vec3;

use crate::scene::document::macros::object;
use crate::scene::document::rule::or;

object! {
    "medium";
    /// Something that fills space evenly and takes or scatters light on its way: fog, water, smoke.
    #[derive(Copy)]
    pub struct Medium {
        /// Absorption at density 1: share of light that is taken per world unit, linear Rec.709.
        sigma_a: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Scattering at density 1: share of light that is scattered per world unit, linear Rec.709.
        sigma_s: Vec3 = or(Vec3::ZERO).from(0.0);
        /// Factor of both.
        density: f32 = or(1.0).from(0.0);
        /// Henyey–Greenstein's mean cosine of the scattering angle: 0 scatters evenly, more than 0 mostly forwards.
        g: f32 = or(0.0).from(-0.99).to(0.99);
    }
}
