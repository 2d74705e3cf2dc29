//! Owns textures in the space of the object: no texture coordinates needed, so that distance functions have them too.
//!
//! A solid texture (Peachey 1985, Perlin 1985) is carved out of a block of it: it has no seams, and stays with the object
//! when that moves.

use glam::{Affine3A, Vec3};

use crate::sdf::{Noise, Trap, Traps};

/// Two colours in cubes of half a unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidCheckerboard {
    /// Linear Rec.709; the first in the cube from (0, 0, 0) to (0.5, 0.5, 0.5), the second in those beside it.
    pub colors: [Vec3; 2],
    /// Maps the object's space to that of the board.
    pub transform: Affine3A,
}

impl SolidCheckerboard {
    /// The colour at a place in the space of the object.
    pub(super) fn color(&self, solid: Vec3) -> Vec3 {
        let place = self.transform.transform_point3(solid);
        if !place.is_finite() {
            return Vec3::ZERO;
        }
        let upper = (place - place.floor()).to_array().map(|part| part >= 0.5);
        self.colors[usize::from(upper[0] ^ upper[1] ^ upper[2])]
    }
}

/// Fractal noise in space between two colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidFbm {
    /// Linear Rec.709 colours where the noise is lowest and highest.
    pub colors: [Vec3; 2],
    /// The noise.
    pub noise: Noise,
    /// Shares of what its octaves add at most, with the first and the second colour; the first is less.
    pub range: [f32; 2],
    /// Maps the object's space to that of the noise.
    pub transform: Affine3A,
}

impl SolidFbm {
    /// The colour at a place in the space of the object.
    pub(super) fn color(&self, solid: Vec3) -> Vec3 {
        let place = self.transform.transform_point3(solid);
        if !place.is_finite() {
            return Vec3::ZERO;
        }
        between(self.colors, self.range, self.noise.value(place) / self.noise.bound())
    }
}

/// Colours of a fractal by how close the orbits of its points come to a trap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrbitTrap {
    /// Linear Rec.709 colours at and below `range[0]`, at and above `range[1]`.
    pub colors: [Vec3; 2],
    /// What orbits come close to.
    pub trap: Trap,
    /// Distances from the trap, in the fractal's own units; the first is less.
    pub range: [f32; 2],
}

impl OrbitTrap {
    /// The colour of a point by its orbit; the second one where there is no orbit.
    pub(super) fn color(&self, traps: &Traps) -> Vec3 {
        between(self.colors, self.range, traps.of(self.trap))
    }
}

/// The first colour at the lower end of a range and below, the second at the upper end and above.
fn between(colors: [Vec3; 2], [low, high]: [f32; 2], value: f32) -> Vec3 {
    let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
    colors[0] * (1.0 - share) + colors[1] * share
}

#[cfg(test)]
mod tests {
    use super::{OrbitTrap, SolidCheckerboard, SolidFbm};
    use crate::sdf::{Noise, NoiseParameters, Trap, Traps};
    use glam::{Affine3A, Vec3};

    const COLORS: [Vec3; 2] = [Vec3::X, Vec3::Y];

    #[test]
    fn cubes_alternate_along_every_axis_and_move_with_the_transform() {
        let board = SolidCheckerboard { colors: COLORS, transform: Affine3A::IDENTITY };
        for (place, expected) in [
            ([0.0, 0.0, 0.0], Vec3::X),
            ([0.25, 0.25, 0.25], Vec3::X),
            ([0.75, 0.25, 0.25], Vec3::Y),
            ([0.25, 0.75, 0.25], Vec3::Y),
            ([0.25, 0.25, 0.75], Vec3::Y),
            ([0.75, 0.75, 0.25], Vec3::X),
            ([-0.25, 0.25, 0.25], Vec3::Y),
            ([-0.25, -0.25, -0.25], Vec3::Y),
            ([7.25, -3.75, 2.25], Vec3::X),
            ([f32::NAN, 0.0, 0.0], Vec3::ZERO),
        ] {
            assert_eq!(board.color(place.into()), expected, "{place:?}");
        }
        let half = SolidCheckerboard { transform: Affine3A::from_scale(Vec3::splat(2.0)), ..board };
        assert_eq!(half.color(Vec3::new(0.3, 0.1, 0.1)), Vec3::Y);
        let far = SolidCheckerboard { transform: Affine3A::from_scale(Vec3::splat(1e30)), ..board };
        assert_eq!(far.color(Vec3::splat(1e20)), Vec3::ZERO, "nothing is known so far out");
    }

    #[test]
    fn noise_fills_its_colours_and_is_that_of_distance_functions() {
        let noise = |amplitude| {
            let parameters = NoiseParameters {
                amplitude,
                frequency: 3.0,
                octaves: 5,
                gain: 0.5,
                lacunarity: 2.0,
                seed: 4,
            };
            Noise::new(parameters).unwrap()
        };
        let texture = SolidFbm {
            colors: [Vec3::ZERO, Vec3::ONE],
            range: [-1.0, 1.0],
            noise: noise(1.0),
            transform: Affine3A::IDENTITY,
        };
        let double = SolidFbm { noise: noise(2.0), ..texture };
        let narrow = SolidFbm { range: [-0.2, 0.2], ..texture };
        let (mut low, mut high) = (1.0_f32, 0.0_f32);
        for step in 0..40_000_u16 {
            let at = f32::from(step) * Vec3::new(0.0137, 0.0071, 0.0103) - 3.0;
            let grey = texture.color(at).x;
            (low, high) = (low.min(grey), high.max(grey));
            assert!((double.color(at).x - grey).abs() < 1e-5, "amplitudes do not matter");
            let expected = (0.5 + (grey - 0.5) * 5.0).clamp(0.0, 1.0);
            assert!(
                (narrow.color(at).x - expected).abs() < 1e-5,
                "a fifth of the range is five times as steep"
            );
        }
        assert!((0.0..0.25).contains(&low) && high > 0.75 && high <= 1.0, "{low} to {high}");
        assert_eq!(texture.color(Vec3::INFINITY), Vec3::ZERO);
    }

    #[test]
    fn orbits_are_coloured_between_the_ends_of_the_range() {
        let texture = OrbitTrap { colors: COLORS, trap: Trap::Axes, range: [0.25, 0.75] };
        let at = |axes| texture.color(&Traps { axes, ..Traps::NONE });
        assert_eq!([at(0.0), at(0.25), at(0.75), at(9.0)], [Vec3::X, Vec3::X, Vec3::Y, Vec3::Y]);
        assert_eq!(at(0.5), Vec3::new(0.5, 0.5, 0.0));
        assert_eq!(texture.color(&Traps::NONE), Vec3::Y, "no orbit comes close to nothing");
    }
}
