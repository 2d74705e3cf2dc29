//! Owns colours that vary over a surface.

/// What the numbers in an image file mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorSpace {
    /// The sRGB curve: pictures.
    Srgb,
    /// Proportional to light: data.
    Linear,
}
/// Stub.
#[derive(Debug)]
pub struct Image;
impl Image {
    /// Stub.
    pub fn lookup(&self, uv: glam::Vec2, space: ColorSpace) -> glam::Vec3 {
        let _ = space;
        uv.extend(0.0)
    }
}
