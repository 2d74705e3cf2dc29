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
    /// rotation counts, and whether it mirrors. Byte images have the sRGB curve, floats are linear.
    pub fn image(radiance: Vec3, image: Arc<Image>, to_world: DMat3) -> Self {
        let color_space = if image.is_float() { ColorSpace::Linear } else { ColorSpace::Srgb };
        let brightness = |x, y| luminance(radiance * image.texel(x, y, color_space));
        let map = SphereMap::new([image.width(), image.height()], brightness);
        let to_local = rotation(to_world).transpose().as_mat3();
        Self { radiance, map: Some(Arc::new(ImageMap { image, color_space, to_local, map })) }
    }

    pub(super) fn sample(&self, u: Vec2) -> Option<LightSample> {
        let wi = match &self.map {
            None => sphere_uniform(u),
            Some(map) => (map.to_local.transpose() * map.map.sample(u)?).normalize(),
        };
        let (radiance, pdf) = self.seen(wi).filter(|(_, pdf)| *pdf > 0.0)?;
        Some(LightSample { wi, radiance, pdf, delta: false, target: Target::Infinity })
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
        let y = (uv.y * height as f32 - 0.5).clamp(0.0, (height - 1) as f32);
        let wrap = |column: i64| column.rem_euclid(i64::from(width)) as u32;
        let (x0, x1) = (wrap(x.floor() as i64), wrap(x.floor() as i64 + 1));
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
