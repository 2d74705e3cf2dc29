//! Owns what colours mean: linear Rec.709 as `Vec3`, luminance, and the names of the view transforms.

use glam::Vec3;

/// Luminance of a linear Rec.709 colour (ITU-R BT.709 weights).
#[inline]
pub fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// How scene light becomes display light in an 8-bit picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum View {
    /// The sRGB curve with clipping at 1.
    Standard,
    /// A film-like curve with a shoulder; highlights roll off instead of clipping.
    #[default]
    Filmic,
}
