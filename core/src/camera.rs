//! Owns the camera: a point of the film and a point of the lens to a ray.

use crate::film::FrameSize;
use crate::math::{Ray, Transform, tan};
use crate::warp::disk_concentric;
use glam::{Vec2, Vec3};

/// Where a perspective camera stands and how it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perspective {
    /// Camera to world; it looks along −z, y is up.
    pub transform: Transform,
    /// Full vertical angle of view in degrees.
    pub vfov: f32,
    /// Radius of the thin lens; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus, along the line of sight.
    pub focus_distance: f32,
}

/// A camera for a film of one size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    view: Perspective,
    half: Vec2,
    /// 2 / film size.
    per_pixel: Vec2,
}

impl Camera {
    /// A camera whose pixels are square.
    pub fn new(view: Perspective, size: FrameSize) -> Self {
        let (width, height) = (size.width as f32, size.height as f32);
        let tangent = tan(view.vfov.to_radians() * 0.5);
        Self {
            view,
            half: Vec2::new(tangent * width / height, tangent),
            per_pixel: Vec2::new(2.0 / width, 2.0 / height),
        }
    }

    /// The ray through a film position in pixels (y down, pixel centres at .5); `lens` is a point of the unit square.
    pub fn ray(&self, position: Vec2, lens: Vec2) -> Ray {
        let ndc = position * self.per_pixel - Vec2::ONE;
        let towards = Vec3::new(ndc.x * self.half.x, -ndc.y * self.half.y, -1.0);
        let (origin, direction) = if self.view.lens_radius > 0.0 {
            let on_lens = (disk_concentric(lens) * self.view.lens_radius).extend(0.0);
            (on_lens, towards * self.view.focus_distance - on_lens)
        } else {
            (Vec3::ZERO, towards)
        };
        Ray::new(self.view.transform.point(origin), self.view.transform.vector(direction).normalize())
    }

    /// Whether rays leave from more than one point.
    pub fn has_lens(&self) -> bool {
        self.view.lens_radius > 0.0
    }

    /// Where it stands, in the world.
    pub fn position(&self) -> Vec3 {
        self.view.transform.point(Vec3::ZERO)
    }

    /// Half the width of a pixel per unit of distance.
    pub fn pixel_spread(&self) -> f32 {
        self.half.y * self.per_pixel.y * 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_looks_along_minus_z_and_the_top_row_up() {
        let view =
            Perspective { transform: Transform::IDENTITY, vfov: 90.0, lens_radius: 0.0, focus_distance: 1.0 };
        let camera = Camera::new(view, FrameSize { width: 200, height: 100 });
        let along = |x, y| camera.ray(Vec2::new(x, y), Vec2::splat(0.5)).d;
        assert!((along(100.0, 50.0) - Vec3::NEG_Z).length() < 1e-6);
        let corner = along(0.0, 0.0);
        assert!((corner / -corner.z - Vec3::new(-2.0, 1.0, -1.0)).length() < 1e-5, "{corner}");
    }

    #[test]
    fn lens_rays_meet_in_the_plane_of_focus() {
        let view =
            Perspective { transform: Transform::IDENTITY, vfov: 40.0, lens_radius: 0.2, focus_distance: 3.0 };
        let camera = Camera::new(view, FrameSize { width: 64, height: 64 });
        let meet = |lens| {
            let ray = camera.ray(Vec2::new(10.0, 20.0), lens);
            ray.at(-(3.0 + ray.o.z) / ray.d.z)
        };
        assert!((meet(Vec2::new(0.1, 0.2)) - meet(Vec2::new(0.9, 0.4))).length() < 1e-5);
    }
}
