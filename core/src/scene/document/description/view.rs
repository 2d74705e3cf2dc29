//! Owns the camera and the film of a document.

use glam::DAffine3;

use crate::color::View;
use crate::scene::document::macros::{object, variants};

variants! {
    "camera";
    /// Where the picture is taken from.
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
    pub struct Film {
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
    pub enum Filter {
        /// Even over a square.
        "box" => Box {
            /// Half the side of the square, in pixels.
            radius: f32 = or(0.5).above(0.0).to(8.0);
        }
        /// A Gaussian with a standard deviation of a third of the radius, cut at the radius.
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
