//! Owns the lights that are not surfaces.

use glam::Vec3;

use crate::scene::document::macros::variants;
use crate::scene::document::rule::required;

variants! {
    "light";
    /// A light that is not a surface.
    #[derive(Copy)]
    pub enum Light {
        /// Light from all directions, infinitely far away.
        "environment" => Environment {
            /// Radiance, linear Rec.709.
            radiance: Vec3 = required().from(0.0);
        }
    }
}
