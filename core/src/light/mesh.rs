//! Owns cutting a placed mesh into lights: its triangles, and rectangles where two of them make one.

use super::{Light, RectangleLight, TriangleLight};
use glam::Vec3;
use std::collections::BTreeMap;

/// Number of a triangle that is no light.
const NO_LIGHT: u32 = u32::MAX;

/// The lights of triangles in the world whose fronts send out a radiance: the lights, and for each triangle the number
/// of the light that it is part of. Two triangles that make a rectangle share one; a triangle without area has
/// `u32::MAX`. Corners run counter-clockwise seen from the front.
pub fn mesh_lights(triangles: &[[Vec3; 3]], radiance: Vec3) -> (Vec<Light>, Vec<u32>) {
    let mut lights = Vec::new();
    let mut numbers = vec![NO_LIGHT; triangles.len()];
    // Right triangles that wait for their other half, by their longest side in their own direction.
    let mut halves: BTreeMap<[u32; 6], usize> = BTreeMap::new();
    for (index, &triangle) in triangles.iter().enumerate() {
        let Some(light) = TriangleLight::new(triangle, radiance) else { continue };
        if let Some(half) = Half::new(triangle) {
            let other = halves.get(&half.key_of_other()).copied();
            if let Some((other, rectangle)) =
                other.and_then(|i| Some((i, half.rectangle(triangles[i], radiance)?)))
            {
                halves.remove(&half.key_of_other());
                numbers[index] = numbers[other];
                lights[numbers[other] as usize] = Light::Rectangle(rectangle);
                continue;
            }
            halves.entry(half.key()).or_insert(index);
        }
        numbers[index] = lights.len() as u32;
        lights.push(Light::Triangle(light));
    }
    (lights, numbers)
}

/// A right triangle: the corner at the right angle, and the corners after and before it.
#[derive(Debug, Clone, Copy)]
struct Half {
    corner: Vec3,
    next: Vec3,
    last: Vec3,
}

impl Half {
    /// How far a rectangle may be from a true one, in parts of its size.
    const TOLERANCE: f32 = 1e-5;

    fn new(t: [Vec3; 3]) -> Option<Self> {
        (0..3).map(|i| Self { corner: t[i], next: t[(i + 1) % 3], last: t[(i + 2) % 3] }).find(|half| {
            let [a, b] = [half.next - half.corner, half.last - half.corner];
            a.dot(b).abs() <= Self::TOLERANCE * a.length() * b.length()
        })
    }

    fn key(&self) -> [u32; 6] {
        key(self.next, self.last)
    }

    /// The other half has the same longest side the other way round.
    fn key_of_other(&self) -> [u32; 6] {
        key(self.last, self.next)
    }

    /// The rectangle that it makes with a triangle that shares its longest side.
    fn rectangle(&self, other: [Vec3; 3], radiance: Vec3) -> Option<RectangleLight> {
        let other = Self::new(other)?;
        let edges = [self.next - self.corner, self.last - self.corner];
        let off = (other.corner - self.corner - edges[0] - edges[1]).length();
        let size = edges[0].length().min(edges[1].length());
        (off <= Self::TOLERANCE * size).then(|| RectangleLight::new(self.corner, edges, radiance))?
    }
}

/// Two corners as bits; 0 and −0 are the same.
fn key(a: Vec3, b: Vec3) -> [u32; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z].map(|x| (x + 0.0).to_bits())
}
