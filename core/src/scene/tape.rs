//! Owns compiling the document's tree of distance functions to a tape.

use super::document::{Components, Named, Scale, SdfNode};
use crate::sdf::{NodeId, NoiseParameters, SdfError, Tape, TapeBuilder};
use glam::{DVec3, Mat3};

/// The tape of a tree.
pub(super) fn compile(root: &SdfNode) -> Result<Tape, SdfError> {
    let mut builder = TapeBuilder::new();
    let root = push(&mut builder, root);
    builder.finish(root)
}

/// Appends a node after its children. The document's own limit bounds the depth.
fn push(builder: &mut TapeBuilder, node: &SdfNode) -> NodeId {
    match node {
        SdfNode::Sphere { radius } => builder.sphere(*radius),
        SdfNode::Box { size } => builder.cuboid(*size),
        SdfNode::RoundedBox { size, radius } => builder.rounded_box(*size, *radius),
        SdfNode::Plane {} => builder.plane(),
        SdfNode::Torus { major_radius, minor_radius } => builder.torus(*major_radius, *minor_radius),
        SdfNode::Cylinder { radius, height } => builder.cylinder(*radius, *height),
        SdfNode::Capsule { radius, height } => builder.capsule(*radius, *height),
        SdfNode::Cone { radius, top_radius, height } => builder.cone(*radius, *top_radius, *height),
        SdfNode::Ellipsoid { radii } => builder.ellipsoid(*radii),
        SdfNode::Mandelbulb { power, iterations, bailout } => {
            builder.mandelbulb(*power, *iterations, *bailout)
        }
        SdfNode::Julia { c, iterations } => builder.julia(*c, *iterations),
        &SdfNode::FbmNoiseSphere { radius, amplitude, frequency, octaves, gain, lacunarity, seed } => {
            let ball = builder.sphere(radius);
            builder.fbm_noise(ball, NoiseParameters { amplitude, frequency, octaves, gain, lacunarity, seed })
        }
        &SdfNode::FbmNoise { amplitude, frequency, octaves, gain, lacunarity, seed, ref child } => {
            let child = push(builder, child);
            builder
                .fbm_noise(child, NoiseParameters { amplitude, frequency, octaves, gain, lacunarity, seed })
        }
        SdfNode::Union { children } => {
            let children = push_all(builder, children);
            builder.union(&children)
        }
        SdfNode::Intersection { children } => {
            let children = push_all(builder, children);
            builder.intersection(&children)
        }
        SdfNode::Difference { children } => {
            let children = push_all(builder, children);
            builder.difference(&children)
        }
        SdfNode::SmoothUnion { k, children } => {
            let children = push_all(builder, children);
            builder.smooth_union(&children, *k)
        }
        SdfNode::SmoothIntersection { k, children } => {
            let children = push_all(builder, children);
            builder.smooth_intersection(&children, *k)
        }
        SdfNode::SmoothDifference { k, children } => {
            let children = push_all(builder, children);
            builder.smooth_difference(&children, *k)
        }
        SdfNode::Repetition { period, count, child } => {
            let child = push(builder, child);
            builder.repetition(child, *period, *count)
        }
        SdfNode::Twist { degrees, child } => {
            let child = push(builder, child);
            builder.twist(child, *degrees)
        }
        SdfNode::Bend { degrees, child } => {
            let child = push(builder, child);
            builder.bend(child, *degrees)
        }
        SdfNode::Transform { translate, rotate, scale, child } => {
            let child = push(builder, child);
            let turn =
                Components { translate: DVec3::ZERO, rotate: *rotate, scale: Scale(DVec3::ONE) }.affine();
            let rotation = Mat3::from_cols_array(&turn.matrix3.to_cols_array().map(|v| v as f32));
            builder.transform(child, translate.as_vec3(), rotation, *scale as f32)
        }
    }
}

fn push_all(builder: &mut TapeBuilder, children: &Named<SdfNode>) -> Vec<NodeId> {
    children.values().map(|child| push(builder, child)).collect()
}
