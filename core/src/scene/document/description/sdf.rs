//! Owns objects made of distance functions.

use glam::{DAffine3, DVec3, Vec3};

use crate::scene::Named;
use crate::scene::document::macros::{object, variants};

object! {
    "sdf_object";
    /// An object made of distance functions.
    pub struct SdfObject {
        /// Name of the material.
        material: String = required().naming(Table::Materials);
        /// Places the object.
        transform: DAffine3 = or(DAffine3::IDENTITY);
        /// A box that holds the object, in its own frame; `"auto"` computes one from the tree.
        bounds: Option<Bounds> = auto();
        /// How rays march through it.
        settings: SdfSettings = or(SdfSettings::AUTO);
        /// The shape.
        tree: SdfNode = required();
    }
}

object! {
    "bounds";
    /// A box along the axes.
    #[derive(Copy)]
    pub struct Bounds {
        /// Lowest corner.
        min: Vec3 = required();
        /// Highest corner; above `min` in every axis.
        max: Vec3 = required();
    }
}

object! {
    "settings";
    /// How rays march through an object; each setting is derived from the object where it is `"auto"`.
    #[derive(Copy)]
    pub struct SdfSettings {
        /// Distance below which a ray has hit, in units of the object.
        hit_epsilon: Option<f32> = auto().above(0.0);
        /// Half the distance between the points of a normal's differences, in units of the object.
        normal_epsilon: Option<f32> = auto().above(0.0);
        /// Longest step of a ray, in units of the object.
        step_clamp: Option<f32> = auto().above(0.0);
        /// Most steps of a ray; one that runs out is counted in the statistics.
        max_steps: Option<u32> = auto().from(1.0).to(65536.0);
    }
}

impl SdfSettings {
    /// Everything derived from the object.
    pub const AUTO: Self =
        Self { hit_epsilon: None, normal_epsilon: None, step_clamp: None, max_steps: None };
}

variants! {
    "sdf_node";
    /// A node of a tree of distance functions; all of them are centred at the origin of their parent.
    pub enum SdfNode {
        /// A sphere.
        "sphere" => Sphere {
            /// Radius.
            radius: f32 = required().above(0.0);
        }
        /// A box along the axes.
        "box" => Box {
            /// Full lengths of the edges.
            size: Vec3 = required().above(0.0);
        }
        /// A torus around the y axis.
        "torus" => Torus {
            /// Distance from the centre to the middle of the tube.
            major_radius: f32 = required().above(0.0);
            /// Radius of the tube.
            minor_radius: f32 = required().above(0.0);
        }
        /// The Mandelbulb fractal, within a radius of about 1.25.
        "mandelbulb" => Mandelbulb {
            /// Power of the iterated map.
            power: f32 = or(8.0).from(2.0).to(64.0);
            /// Iterations of the map; more give finer detail.
            iterations: u32 = or(12).from(1.0).to(256.0);
            /// Radius at which a point counts as escaped.
            bailout: f32 = or(4.0).from(2.0).to(1.0e6);
        }
        /// All points of any child.
        "union" => Union {
            /// The children by name, at least one.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// A union with rounded seams: the polynomial smooth minimum.
        "smooth_union" => SmoothUnion {
            /// Width of the seam; 0 is a plain union.
            k: f32 = required().from(0.0);
            /// The children by name, at least one.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// A child scaled evenly, then rotated, then translated.
        "transform" => Transform {
            /// Translation.
            translate: DVec3 = or(DVec3::ZERO);
            /// Rotations about x, y and z, in degrees, applied in this order.
            rotate: DVec3 = or(DVec3::ZERO);
            /// Factor in all directions, above 0.
            scale: f64 = or(1.0).above(0.0);
            /// The child.
            child: Box<SdfNode> = required();
        }
    }
}
