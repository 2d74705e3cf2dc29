//! Owns the report of how much light materials reflect at most.

use super::compiled::Scene;
use super::material::Model;
use crate::bsdf::Bsdf;
use crate::sdf::Traps;
use crate::texture::Place;
use glam::{Vec2, Vec3};

/// The direction in which a material reflects most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlbedoPeak {
    /// Number of the material in the document's table.
    pub material: usize,
    /// Share of white light from all sides that is sent there, of the brightest channel; above 1 the model gains energy.
    pub albedo: f32,
    /// Angle of the direction off the normal, in degrees.
    pub angle: f32,
}

/// Directions that are tried, by their cosine.
const COSINES: [f32; 9] = [1.0, 0.9, 0.75, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05];
/// Points at which textures are tried, along u and v.
const POINTS: u32 = 4;

impl Scene {
    /// The peak of every material of the Disney model, whose published form may gain energy; to about 0.5 %.
    pub fn albedo_peaks(&self) -> Vec<AlbedoPeak> {
        self.materials.iter().enumerate().filter_map(|(number, m)| peak(number, &m.model)).collect()
    }
}

/// A place with something new in everything that textures look at.
fn place(uv: Vec2) -> Place {
    let traps = Traps { origin: uv.x, axes: uv.x, planes: uv.x };
    Place { solid: Vec3::new(uv.x, uv.y, uv.x + uv.y), traps, ..uv.into() }
}

fn peak(material: usize, model: &Model) -> Option<AlbedoPeak> {
    let steps = if let Model::Ready(_) = model { 1 } else { POINTS };
    let at = |step: u32| (step as f32 + 0.5) / steps as f32;
    let points = (0..steps * steps).map(|i| Vec2::new(at(i % steps), at(i / steps)));
    let bsdfs: Vec<_> = points.map(|uv| model.at(&place(uv))).collect();
    let peaks =
        bsdfs.iter().filter_map(|bsdf| if let Bsdf::Principled(p) = bsdf.as_ref() { Some(p) } else { None });
    peaks
        .flat_map(|p| COSINES.map(|cos| (p.greatest_albedo(cos).max_element(), cos)))
        .reduce(|best, next| if next.0 > best.0 { next } else { best })
        .map(|(albedo, cos)| AlbedoPeak { material, albedo, angle: crate::math::acos(cos).to_degrees() })
}
