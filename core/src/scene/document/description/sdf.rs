//! Owns objects made of distance functions.

use glam::{DAffine3, DVec3, Vec3, Vec4};

use crate::scene::document::cursor::Cursor;
use crate::scene::document::macros::{object, variants};
use crate::scene::document::named::Named;
use crate::scene::document::rule::{Table, auto, optional, or, required};

object! {
    "SDF object";
    /// An object made of distance functions.
    pub struct SdfObject checked by is_small {
        /// Name of the material.
        material: String = required().naming(Table::Materials);
        /// Places the object.
        transform: DAffine3 = or(DAffine3::IDENTITY);
        /// A box that holds the object, in its own frame; `"auto"` computes one from the tree.
        bounds: Option<Bounds> = auto();
        /// How rays march through it.
        settings: SdfSettings = or(SdfSettings::AUTO);
        /// Name of the medium inside, where the surface is closed.
        interior: Option<String> = optional().naming(Table::Media);
        /// The shape.
        tree: SdfNode = required();
    }
}

object! {
    "bounds";
    /// A box along the axes.
    #[derive(Copy)]
    pub struct Bounds checked by is_box {
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
        /// Half the least step of a ray, in units of the object: features thinner than twice this may be missed.
        hit_epsilon: Option<f32> = auto().above(0.0);
        /// Distance over which normals are taken, in units of the object.
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

/// Lengths and factors of nodes, from the least to the greatest: within f32 after every step of arithmetic.
const LEAST: f64 = 1.0e-12;
const GREATEST: f64 = 1.0e12;

variants! {
    "SDF node";
    /// A node of a tree of distance functions; all of them are centred at the origin of their parent.
    pub enum SdfNode {
        /// A sphere.
        "sphere" => Sphere {
            /// Radius.
            radius: f32 = required().from(LEAST).to(GREATEST);
        }
        /// A box along the axes.
        "box" => Box {
            /// Full lengths of the edges.
            size: Vec3 = required().from(LEAST).to(GREATEST);
        }
        /// A box along the axes with rounded edges.
        "rounded_box" => RoundedBox {
            /// Full lengths of the edges.
            size: Vec3 = required().from(LEAST).to(GREATEST);
            /// Radius of the rounding, at most half the shortest edge.
            radius: f32 = required().from(0.0).to(GREATEST);
        }
        /// Everything below y = 0; it has no end, so that `bounds` or an intersection must cut it.
        "plane" => Plane {}
        /// A torus around the y axis.
        "torus" => Torus {
            /// Distance from the centre to the middle of the tube.
            major_radius: f32 = required().from(LEAST).to(GREATEST);
            /// Radius of the tube.
            minor_radius: f32 = required().from(LEAST).to(GREATEST);
        }
        /// A cylinder around the y axis.
        "cylinder" => Cylinder {
            /// Radius.
            radius: f32 = required().from(LEAST).to(GREATEST);
            /// Full height.
            height: f32 = required().from(LEAST).to(GREATEST);
        }
        /// A cylinder around the y axis with half balls as its ends.
        "capsule" => Capsule {
            /// Radius.
            radius: f32 = required().from(LEAST).to(GREATEST);
            /// Full height without the ends; 0 is a sphere.
            height: f32 = required().from(0.0).to(GREATEST);
        }
        /// A cone around the y axis.
        "cone" => Cone {
            /// Radius at its bottom.
            radius: f32 = required().from(LEAST).to(GREATEST);
            /// Radius at its top; 0 is a tip.
            top_radius: f32 = or(0.0).from(0.0).to(GREATEST);
            /// Full height.
            height: f32 = required().from(LEAST).to(GREATEST);
        }
        /// An ellipsoid.
        "ellipsoid" => Ellipsoid {
            /// Half axes along x, y and z.
            radii: Vec3 = required().from(LEAST).to(GREATEST);
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
        /// A slice of the Julia set of q² + c in the quaternions, at most 2.6 in radius.
        "julia" => Julia {
            /// The four parts of c, the real one first.
            c: Vec4 = or(Vec4::new(-0.2, 0.6, 0.2, 0.2)).from(-4.0).to(4.0);
            /// Iterations of the map; more give finer detail.
            iterations: u32 = or(12).from(1.0).to(256.0);
        }
        /// A sphere whose surface is moved by fractal noise.
        "fbm_noise_sphere" => FbmNoiseSphere {
            /// Radius without the noise.
            radius: f32 = required().from(LEAST).to(GREATEST);
            /// How far the first octave moves the surface.
            amplitude: f32 = required().from(0.0).to(1.0e6);
            /// Cells of the first octave per unit of length.
            frequency: f32 = or(1.0).from(1.0e-6).to(1.0e6);
            /// Number of octaves.
            octaves: u32 = or(5).from(1.0).to(16.0);
            /// Amplitude of an octave in units of the one before.
            gain: f32 = or(0.5).from(0.0).to(1.0);
            /// Frequency of an octave in units of the one before.
            lacunarity: f32 = or(2.0).from(1.0).to(8.0);
            /// Another number is another noise.
            seed: u32 = or(0);
        }
        /// A child whose surface is moved by fractal noise: octaves of gradient noise with Perlin's twelve gradients.
        "fbm_noise" => FbmNoise {
            /// How far the first octave moves the surface.
            amplitude: f32 = required().from(0.0).to(1.0e6);
            /// Cells of the first octave per unit of length.
            frequency: f32 = or(1.0).from(1.0e-6).to(1.0e6);
            /// Number of octaves.
            octaves: u32 = or(5).from(1.0).to(16.0);
            /// Amplitude of an octave in units of the one before.
            gain: f32 = or(0.5).from(0.0).to(1.0);
            /// Frequency of an octave in units of the one before.
            lacunarity: f32 = or(2.0).from(1.0).to(8.0);
            /// Another number is another noise.
            seed: u32 = or(0);
            /// The child.
            child: Box<SdfNode> = required();
        }
        /// Everything that is in any child.
        "union" => Union {
            /// The children by name, at least one.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// Everything that is in all children.
        "intersection" => Intersection {
            /// The children by name, at least one.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// Everything that is in the first child and in none of the others.
        "difference" => Difference {
            /// The children by name, at least one; the first one is what is cut.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// A union with rounded seams: the polynomial smooth minimum.
        "smooth_union" => SmoothUnion {
            /// Width of the seam; 0 is a plain union.
            k: f32 = required().from(0.0).to(GREATEST);
            /// The children by name, at least one.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// An intersection with rounded edges: the polynomial smooth maximum.
        "smooth_intersection" => SmoothIntersection {
            /// Width of the edge; 0 is a plain intersection.
            k: f32 = required().from(0.0).to(GREATEST);
            /// The children by name, at least one.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// A difference with rounded edges.
        "smooth_difference" => SmoothDifference {
            /// Width of the edge; 0 is a plain difference.
            k: f32 = required().from(0.0).to(GREATEST);
            /// The children by name, at least one; the first one is what is cut.
            children: Named<SdfNode> = required().from(1.0);
        }
        /// Copies of a child along the axes.
        "repetition" => Repetition {
            /// From copy to copy along x, y and z; 0 makes none along an axis.
            period: Vec3 = required().from(0.0).to(1.0e6);
            /// Copies on either side of the child along every axis that has a period; `"auto"` has no end, so that `bounds`
            /// or an intersection must cut it.
            count: Option<u32> = auto().from(1.0).to(1.0e6);
            /// The child; within half a period of its origin.
            child: Box<SdfNode> = required();
        }
        /// A child turned around the y axis, the more the higher.
        "twist" => Twist {
            /// Degrees per unit of y.
            degrees: f32 = required().from(-1.0e6).to(1.0e6);
            /// The child.
            child: Box<SdfNode> = required();
        }
        /// A child turned around the z axis, the more the larger x is: a bar along x becomes a bow.
        "bend" => Bend {
            /// Degrees per unit of x.
            degrees: f32 = required().from(-1.0e6).to(1.0e6);
            /// The child.
            child: Box<SdfNode> = required();
        }
        /// A child scaled evenly, then rotated, then translated.
        "transform" => Transform {
            /// Translation.
            translate: DVec3 = or(DVec3::ZERO);
            /// Rotations about x, y and z, in degrees, applied in this order.
            rotate: DVec3 = or(DVec3::ZERO);
            /// Factor in all directions.
            scale: f64 = or(1.0).from(LEAST).to(GREATEST);
            /// The child.
            child: Box<SdfNode> = required();
        }
    }
}

/// Deepest nesting of SDF nodes.
const MAX_DEPTH: u32 = 64;

impl SdfNode {
    /// Nodes of the tree, and the depth of its deepest node; 1 and 1 for a leaf.
    pub fn size(&self) -> (u64, u32) {
        let children: &mut dyn Iterator<Item = &Self> = match self {
            Self::Sphere { .. }
            | Self::Box { .. }
            | Self::RoundedBox { .. }
            | Self::Plane {}
            | Self::Torus { .. }
            | Self::Cylinder { .. }
            | Self::Capsule { .. }
            | Self::Cone { .. }
            | Self::Ellipsoid { .. }
            | Self::Mandelbulb { .. }
            | Self::Julia { .. }
            | Self::FbmNoiseSphere { .. } => &mut std::iter::empty(),
            Self::Union { children }
            | Self::Intersection { children }
            | Self::Difference { children }
            | Self::SmoothUnion { children, .. }
            | Self::SmoothIntersection { children, .. }
            | Self::SmoothDifference { children, .. } => &mut children.values(),
            Self::Transform { child, .. }
            | Self::FbmNoise { child, .. }
            | Self::Repetition { child, .. }
            | Self::Twist { child, .. }
            | Self::Bend { child, .. } => &mut std::iter::once(child.as_ref()),
        };
        children
            .map(Self::size)
            .fold((1, 1), |(count, depth), (nodes, below)| (count + nodes, depth.max(below + 1)))
    }
}

fn is_box(bounds: &Bounds, at: &Cursor<'_>) -> bool {
    let ok = bounds.min.cmplt(bounds.max).all();
    if !ok {
        at.problem("found \"min\" that is not below \"max\" in every axis", None);
    }
    ok
}

fn is_small(object: &SdfObject, at: &Cursor<'_>) -> bool {
    let (nodes, depth) = object.tree.size();
    let before = at.context.sdf_nodes.get();
    let (total, limit) = (before + nodes, at.context.limits.max_sdf_nodes);
    at.context.sdf_nodes.set(total);
    if depth > MAX_DEPTH {
        at.member_problem("tree", format!("found nodes nested {depth} deep, the limit is {MAX_DEPTH}"), None);
    }
    if before <= limit && total > limit {
        let message =
            format!("found {total} SDF nodes up to here, the limit is {limit} in all objects together");
        at.member_problem("tree", message, None);
    }
    depth <= MAX_DEPTH && total <= limit
}
