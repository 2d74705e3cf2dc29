//! Owns the tests of distance functions; what several of them need stands here.

mod accuracy;
mod cells;
mod closed;
mod closed_seams;
mod hard_cases;
mod hostile;
mod interval;
mod lanes;
mod noise;
mod objects;
mod oracle;
mod properties;
mod surface;

use glam::{Mat3, Quat, Vec3};
use wide::f32x8;

use super::{MarchStats, NodeId, Point, Sdf, SdfRay, Settings, Tape, TapeBuilder};

/// A tape from a closure over a fresh builder.
fn tape(build: impl FnOnce(&mut TapeBuilder) -> NodeId) -> Tape {
    let mut builder = TapeBuilder::new();
    let root = build(&mut builder);
    builder.finish(root).expect("test trees are valid")
}

/// An object with derived settings and bounds.
fn object(build: impl FnOnce(&mut TapeBuilder) -> NodeId) -> Sdf {
    Sdf::new(tape(build), Settings::default(), None).expect("derived bounds hold")
}

/// A child moved.
fn moved(t: &mut TapeBuilder, child: NodeId, to: Vec3) -> NodeId {
    t.transform(child, to, Mat3::IDENTITY, 1.0)
}

/// Box, ball and torus melted together, turned and moved.
fn melted(t: &mut TapeBuilder) -> NodeId {
    let (cube, ball, ring) = (t.cuboid(Vec3::new(1.0, 1.6, 0.8)), t.sphere(0.9), t.torus(0.7, 0.2));
    let cube = moved(t, cube, Vec3::new(1.2, -0.2, 0.0));
    let ball = moved(t, ball, Vec3::new(-0.6, 0.2, 0.0));
    let turn = Mat3::from_quat(Quat::from_rotation_x(0.6));
    let ring = t.transform(ring, Vec3::new(0.0, -0.4, 0.9), turn, 1.3);
    t.smooth_union(&[cube, ball, ring], 0.3)
}

/// A ray with unit direction and no limits.
fn ray(origin: Vec3, dir: Vec3) -> SdfRay {
    SdfRay { origin, dir: dir.normalize(), t_min: 0.0, t_max: f32::INFINITY, footprint: 0.0 }
}

/// Numbers in [0, 1) from a fixed sequence.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        // PCG-XSH-RR of O'Neill 2014.
        let state = self.0;
        self.0 = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mixed = (((state >> 18) ^ state) >> 27) as u32;
        (mixed.rotate_right((state >> 59) as u32) >> 8) as f32 / 16_777_216.0
    }

    fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0));
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// Eight points as lanes.
fn pack(points: [Vec3; 8]) -> Point<f32x8> {
    let [x, y, z] = std::array::from_fn(|axis| f32x8::new(points.map(|p| p[axis])));
    Point::new(x, y, z)
}

/// The value in f64.
fn exact(sdf: &Sdf, p: glam::DVec3) -> f64 {
    sdf.tape().distance(Point::new(p.x, p.y, p.z))
}

/// Intersects, counting into a throw-away record.
fn hit(sdf: &Sdf, ray: &SdfRay) -> Option<f32> {
    sdf.intersect(ray, &mut MarchStats::default())
}
