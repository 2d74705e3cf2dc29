//! Owns the camera and the film of a document.

use glam::DAffine3;

use crate::color::View;
use crate::scene::document::cursor::Cursor;
use crate::scene::document::macros::{object, variants};
use crate::scene::document::rule::{optional, or, required};

variants! {
    "camera";
    /// Where the picture is taken from.
    #[derive(Copy)]
    pub enum Camera {
        /// A perspective camera, with a thin lens where `lens_radius` is above 0.
        "perspective" => Perspective {
            /// Full vertical angle of view, in degrees.
            vfov: f32 = required().above(0.0).below(180.0);
            /// Places the camera: it looks along −z of its own frame, with y up.
            transform: DAffine3 = or(DAffine3::IDENTITY);
            /// Radius of the lens, in world units; 0 is a pinhole, everything sharp.
            lens_radius: f32 = or(0.0).from(0.0);
            /// Distance from the camera to the plane in focus, along the line of sight, in world units.
            focus_distance: f32 = or(1.0).above(0.0);
        }
    }
}

object! {
    "film";
    /// The picture: its size and how samples become pixels and pixels become an image.
    pub struct Film checked by fits {
        /// Width in pixels. Cannot be animated.
        width: u32 = required().from(1.0).to(65536.0);
        /// Height in pixels. Cannot be animated.
        height: u32 = required().from(1.0).to(65536.0);
        /// The part that is rendered; without it all of the picture. Cannot be animated.
        crop: Option<Crop> = optional();
        /// The reconstruction filter.
        filter: Filter = or(Filter::BlackmanHarris { radius: 1.5 });
        /// Exposure, in stops: the picture is multiplied by 2 to this power where it becomes display light,
        /// and errors are judged under it. The EXR layers stay unscaled.
        exposure: f32 = or(0.0).from(-64.0).to(64.0);
        /// How scene light becomes display light in the PNG.
        view: View = or(View::Filmic);
    }
}

object! {
    "crop";
    /// A rectangle of the picture; the corner of pixel (0, 0) is at the top left.
    #[derive(Copy, Eq)]
    pub struct Crop {
        /// Left edge, in pixels.
        x: u32 = required().to(65535.0);
        /// Upper edge, in pixels.
        y: u32 = required().to(65535.0);
        /// Width, in pixels; `x + width` is at most the film's width.
        width: u32 = required().from(1.0).to(65536.0);
        /// Height, in pixels; `y + height` is at most the film's height.
        height: u32 = required().from(1.0).to(65536.0);
    }
}

variants! {
    "filter";
    /// The reconstruction filter: how far around a pixel's centre its samples lie, and with what density.
    #[derive(Copy)]
    pub enum Filter {
        /// Even over a square.
        "box" => Box {
            /// Half the side of the square, in pixels.
            radius: f32 = or(0.5).above(0.0).to(8.0);
        }
        /// A Gaussian with a standard deviation of a third of the radius, lowered to reach 0 at the radius.
        "gaussian" => Gaussian {
            /// Half width, in pixels.
            radius: f32 = or(1.5).above(0.0).to(8.0);
        }
        /// The Blackman–Harris window.
        "blackman_harris" => BlackmanHarris {
            /// Half width, in pixels.
            radius: f32 = or(1.5).above(0.0).to(8.0);
        }
    }
}

impl Film {
    /// The rectangle that is rendered: the crop, or all of the film.
    pub fn window(&self) -> Crop {
        self.crop.unwrap_or(Crop { x: 0, y: 0, width: self.width, height: self.height })
    }
}

/// Whether the film is within the limit of pixels and the crop within the film.
fn fits(film: &Film, at: &Cursor<'_>) -> bool {
    let pixels = u64::from(film.width) * u64::from(film.height);
    let limit = at.context.limits.max_pixels;
    if pixels > limit {
        let message =
            format!("found {} x {} = {pixels} pixels, the limit is {limit}", film.width, film.height);
        at.problem(message, None);
        return false;
    }
    let Some(crop) = film.crop else { return true };
    // Each is at most 65536: the sums fit.
    let (right, bottom) = (crop.x + crop.width, crop.y + crop.height);
    let inside = right <= film.width && bottom <= film.height;
    if !inside {
        let message =
            format!("found a crop to ({right}, {bottom}) of a film of {} x {}", film.width, film.height);
        at.member_problem("crop", message, None);
    }
    inside
}
