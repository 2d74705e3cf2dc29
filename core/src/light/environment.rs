//! Owns light from all directions: even, or an image as a map of longitude and latitude.

use super::map::{SphereMap, uv_of_direction};
use super::{LightSample, Target};
use crate::color::luminance;
use crate::texture::{ColorSpace, Image};
use crate::warp::{sphere_uniform, sphere_uniform_pdf};
use glam::{DMat3, DVec3, Mat3, Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// Radiance from every direction, infinitely far away.
///
/// An image is sampled where it is brighter than its mean, and only there (MIS compensation, Karlik et al. 2019):
/// scattered rays find the rest of it better. So light sampling alone does not bring all of its light; it must be
/// weighed together with scattering, as the integrator does.
#[derive(Debug, Clone)]
pub struct EnvironmentLight {
    radiance: Vec3,
    map: Option<Arc<ImageMap>>,
}

/// An image around the scene.
#[derive(Debug)]
struct ImageMap {
    image: Arc<Image>,
    color_space: ColorSpace,
    /// Whether the first and last row of texels lie on the poles, and not half a texel off them.
    rows_at_poles: bool,
    /// Orthonormal.
    to_local: Mat3,
    map: SphereMap,
}

impl EnvironmentLight {
    /// The same radiance (linear Rec.709) from every direction.
    pub fn constant(radiance: Vec3) -> Self {
        Self { radiance, map: None }
    }

    /// An image times a radiance. In the light's own frame its middle is in direction +z, its upper edge is +y, and it
    /// is seen from inside: what is on the right in the image is in direction −x. Of the map to the world only the
    /// rotation counts, and whether it mirrors. Byte images have the sRGB curve, floats are linear. Texels fill the map
    /// evenly, unless `rows_at_poles` puts the centres of the first and last row on the poles.
    pub fn image(radiance: Vec3, image: Arc<Image>, to_world: DMat3, rows_at_poles: bool) -> Self {
        let color_space = if image.is_float() { ColorSpace::Linear } else { ColorSpace::Srgb };
        let brightness = |x, y| luminance(radiance * image.texel(x, y, color_space));
        let map = SphereMap::new([image.width(), image.height()], brightness);
        let to_local = rotation(to_world).transpose().as_mat3();
        Self { radiance, map: Some(Arc::new(ImageMap { image, color_space, rows_at_poles, to_local, map })) }
    }

    pub(super) fn sample(&self, u: Vec2) -> Option<LightSample> {
        let (wi, radiance, pdf) = match &self.map {
            None => (sphere_uniform(u), self.radiance, sphere_uniform_pdf()),
            Some(map) => {
                let (local, uv, pdf) = map.map.sample(u)?;
                ((map.to_local.transpose() * local).normalize(), self.radiance * map.lookup(uv), pdf)
            }
        };
        (radiance.max_element() > 0.0 && pdf > 0.0).then_some(LightSample {
            wi,
            radiance,
            pdf,
            delta: false,
            target: Target::Infinity,
        })
    }

    /// Radiance along a direction and the density of sampling it; `None` where it is black.
    pub(super) fn seen(&self, d: Vec3) -> Option<(Vec3, f32)> {
        let (radiance, pdf) = match &self.map {
            None => (self.radiance, sphere_uniform_pdf()),
            Some(map) => {
                let uv = uv_of_direction(map.to_local * d);
                (self.radiance * map.lookup(uv), map.map.pdf(uv))
            }
        };
        (radiance.max_element() > 0.0).then_some((radiance, pdf))
    }

    /// Irradiance of an open horizon, on average over where it faces.
    pub(super) fn importance(&self) -> f32 {
        PI * self.map.as_ref().map_or(luminance(self.radiance), |map| map.map.mean())
    }
}

impl ImageMap {
    /// Between texel centres, which lie at half integers, values change linearly; the image goes around, and its upper
    /// and lower rows go on to the poles. Negative values count as black.
    fn lookup(&self, uv: Vec2) -> Vec3 {
        let (width, height) = (self.image.width(), self.image.height());
        let x = uv.x * width as f32 - 0.5;
        let last = (height - 1) as f32;
        let y = if self.rows_at_poles { uv.y * last } else { uv.y * height as f32 - 0.5 }.clamp(0.0, last);
        // From one before the first to one after the last.
        let column = x.floor() as i32;
        let x0 = if column < 0 { width - 1 } else { (column as u32).min(width - 1) };
        let x1 = if x0 + 1 < width { x0 + 1 } else { 0 };
        let (y0, y1) = (y as u32, (y as u32 + 1).min(height - 1));
        let texel = |x, y| self.image.texel(x, y, self.color_space).max(Vec3::ZERO);
        let row = |y| texel(x0, y).lerp(texel(x1, y), x - x.floor());
        row(y0).lerp(row(y1), y - y.floor())
    }
}

/// The nearest rotation in the sense that it keeps the direction of y, then the plane of y and z; mirrored if the map
/// mirrors.
fn rotation(m: DMat3) -> DMat3 {
    let up = m.y_axis.try_normalize();
    let forth = up.and_then(|y| (m.z_axis - y * y.dot(m.z_axis)).try_normalize());
    let (Some(y), Some(z)) = (up, forth) else { return DMat3::IDENTITY };
    let x: DVec3 = y.cross(z);
    DMat3::from_cols(if m.determinant() < 0.0 { -x } else { x }, y, z)
}
