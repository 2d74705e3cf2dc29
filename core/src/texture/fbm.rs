//! Owns fractal noise: octaves of gradient noise, the same bits on every machine.
//!
//! An octave is the noise of Perlin, "Improving Noise" (2002), in the plane z = 0: the fade curve 6t⁵ − 15t⁴ + 10t³
//! and his twelve gradients, the edges of a cube chosen by four bits, of which the plane sees x and y. In place of his
//! table of 256 numbers an integer hash of (cell, octave, seed) chooses, so that the noise has no period. Such an
//! octave is 0 at the corners of its cells and stays in −1 to 1: at the middle of a cell four diagonal gradients reach
//! ±1, elsewhere fade and distance give less.

use glam::{Affine2, Vec2, Vec3};

/// Fractal noise between two colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fbm {
    /// Linear Rec.709 colours where the noise is lowest and highest.
    pub colors: [Vec3; 2],
    /// Number of octaves.
    pub octaves: u32,
    /// Amplitude of an octave in units of the one before.
    pub gain: f32,
    /// Frequency of an octave in units of the one before.
    pub lacunarity: f32,
    /// Cells of the first octave per unit of uv.
    pub frequency: f32,
    /// Another number is another noise.
    pub seed: u32,
    /// Maps the surface's uv to that of the noise.
    pub transform: Affine2,
}

/// Octave k is moved by k times this many cells (the two-dimensional golden ratio's powers), because with a whole
/// lacunarity all octaves would be 0 at the same points.
const SHIFT: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);

/// Cells further out than this have no fraction in single precision.
const FAR: f32 = 8_388_608.0;

impl Fbm {
    /// The colour at a texture coordinate of the surface: the sum of the octaves, divided by that of the amplitudes,
    /// mapped from −1 to 1 to the two colours.
    pub(super) fn color(&self, uv: Vec2) -> Vec3 {
        let place = self.transform.transform_point2(uv);
        if !place.is_finite() {
            return Vec3::ZERO;
        }
        let share = (0.5 + 0.5 * self.sum(place)).clamp(0.0, 1.0);
        self.colors[0] * (1.0 - share) + self.colors[1] * share
    }

    /// Weighted mean of the octaves, −1 to 1.
    fn sum(&self, place: Vec2) -> f32 {
        let (mut sum, mut amplitudes) = (0.0, 0.0);
        let (mut amplitude, mut frequency) = (1.0_f32, self.frequency);
        for octave in 0..self.octaves {
            sum += amplitude * noise(place * frequency + SHIFT * octave as f32, octave, self.seed);
            amplitudes += amplitude;
            amplitude *= self.gain;
            frequency *= self.lacunarity;
        }
        if amplitudes > 0.0 { sum / amplitudes } else { 0.0 }
    }
}

/// One octave at a place measured in cells, −1 to 1; 0 where cells are too far out to have an inside.
fn noise(place: Vec2, octave: u32, seed: u32) -> f32 {
    if !place.is_finite() || place.abs().max_element() >= FAR {
        return 0.0;
    }
    let cell = place.floor();
    let (x, y) = (cell.x as i32, cell.y as i32);
    let part = place - cell;
    let corner = |right: i32, up: i32| {
        let gradient = GRADIENTS[(hash(x + right, y + up, octave, seed) >> 28) as usize];
        gradient.dot(part - Vec2::new(right as f32, up as f32))
    };
    let (right, up) = (fade(part.x), fade(part.y));
    let row = |up: i32| corner(0, up) * (1.0 - right) + corner(1, up) * right;
    row(0) * (1.0 - up) + row(1) * up
}

/// From 0 to 1 with no slope and no curvature at the ends.
fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// What Perlin's `grad` makes of four bits where z = 0; their mean is zero.
const GRADIENTS: [Vec2; 16] = [
    Vec2::new(1.0, 1.0),
    Vec2::new(-1.0, 1.0),
    Vec2::new(1.0, -1.0),
    Vec2::new(-1.0, -1.0),
    Vec2::new(1.0, 0.0),
    Vec2::new(-1.0, 0.0),
    Vec2::new(1.0, 0.0),
    Vec2::new(-1.0, 0.0),
    Vec2::new(0.0, 1.0),
    Vec2::new(0.0, -1.0),
    Vec2::new(0.0, 1.0),
    Vec2::new(0.0, -1.0),
    Vec2::new(1.0, 1.0),
    Vec2::new(0.0, -1.0),
    Vec2::new(-1.0, 1.0),
    Vec2::new(0.0, -1.0),
];

/// 32 even bits for a corner: each number is added to the mixed ones before it, multiplied apart so that small
/// numbers do not cancel.
fn hash(x: i32, y: i32, octave: u32, seed: u32) -> u32 {
    let key = mix(seed.wrapping_add(octave.wrapping_mul(0x9e37_79b9)));
    let key = mix(key.wrapping_add((x as u32).wrapping_mul(0x85eb_ca6b)));
    mix(key.wrapping_add((y as u32).wrapping_mul(0xc2b2_ae35)))
}

/// A bijection of 32 bits whose every input bit changes every output bit about half the time (the constants are
/// those of the least biased two-round multiply and shift that is known, Wellons' search).
fn mix(mut bits: u32) -> u32 {
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x21f0_aaad);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x735a_2d97);
    bits ^ (bits >> 15)
}

#[cfg(test)]
mod tests {
    use super::{Fbm, fade, hash, noise};
    use glam::{Affine2, Vec2, Vec3};

    fn fbm(octaves: u32) -> Fbm {
        Fbm {
            colors: [Vec3::ZERO, Vec3::ONE],
            octaves,
            gain: 0.5,
            lacunarity: 2.0,
            frequency: 8.0,
            seed: 1,
            transform: Affine2::IDENTITY,
        }
    }

    /// Places in a square of 40 by 40 cells around the origin.
    fn places() -> impl Iterator<Item = Vec2> {
        (0..200 * 200).map(|index| Vec2::new((index % 200) as f32, (index / 200) as f32) * 0.2013 - 20.0)
    }

    /// `grad` of Perlin 2002, as printed.
    fn perlin(bits: u32, x: f64, y: f64, z: f64) -> f64 {
        let h = bits & 15;
        let u = if h < 8 { x } else { y };
        let v = if h < 4 {
            y
        } else if h == 12 || h == 14 {
            x
        } else {
            z
        };
        (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { v } else { -v })
    }

    #[test]
    fn an_octave_is_perlins_noise_in_the_plane() {
        for place in places() {
            let (x, y) = (f64::from(place.x), f64::from(place.y));
            let (i, j) = (x.floor() as i32, y.floor() as i32);
            let (x, y) = (x - x.floor(), y - y.floor());
            let bits = |right: i32, up: i32| hash(i + right, j + up, 3, 9) >> 28;
            let ease = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
            let mix = |t: f64, a: f64, b: f64| a + t * (b - a);
            let below = mix(ease(x), perlin(bits(0, 0), x, y, 0.0), perlin(bits(1, 0), x - 1.0, y, 0.0));
            let above =
                mix(ease(x), perlin(bits(0, 1), x, y - 1.0, 0.0), perlin(bits(1, 1), x - 1.0, y - 1.0, 0.0));
            let (found, expected) = (f64::from(noise(place, 3, 9)), mix(ease(y), below, above));
            assert!((found - expected).abs() < 2.0e-6, "{place}: {found}, expected {expected}");
        }
    }

    #[test]
    fn values_fill_the_range_and_never_leave_it() {
        let (mut low, mut high, mut sum) = (1.0_f32, -1.0_f32, 0.0);
        for place in places() {
            let value = noise(place, 0, 5);
            (low, high, sum) = (low.min(value), high.max(value), sum + f64::from(value));
        }
        assert!(low >= -1.0 && high <= 1.0 && low < -0.8 && high > 0.8, "{low} to {high}");
        // 1600 cells, each with a standard deviation of about 0.25: four standard errors of the mean.
        assert!((sum / 40_000.0).abs() < 0.025, "mean {}", sum / 40_000.0);
        // All gradients towards the middle: the largest value there is.
        let middle = 4.0 * fade(0.5) * fade(0.5) * (0.5 + 0.5);
        assert_eq!(middle, 1.0);
        for octaves in [1, 2, 6, 16] {
            for gain in [0.0, 0.5, 1.0] {
                let fbm = Fbm { gain, ..fbm(octaves) };
                for place in places().step_by(7) {
                    let color = fbm.color(place);
                    assert!(color.min_element() >= 0.0 && color.max_element() <= 1.0, "{place}: {color}");
                }
            }
        }
    }

    #[test]
    fn there_is_no_edge_between_cells() {
        let step = 1.0 / 256.0;
        for cell in -20..20 {
            for along in 0..40 {
                let (edge, along) = (cell as f32, along as f32 * 0.17 - 3.0);
                let across = |offset: f32| noise(Vec2::new(edge + offset, along), 0, 2);
                let up = |offset: f32| noise(Vec2::new(along, edge + offset), 0, 2);
                for at in [&across as &dyn Fn(f32) -> f32, &up] {
                    let (before, here, after) = (at(-step), at(0.0), at(step));
                    assert!((after - here).abs() < 3.0 * step, "a jump at {edge}, {along}");
                    // A fold would be of the order of a step, a curve is of its square.
                    let fold = (after - 2.0 * here + before).abs();
                    assert!(fold < 16.0 * step * step, "a fold of {fold} at {edge}, {along}");
                }
            }
        }
    }

    #[test]
    fn octaves_and_seeds_are_unlike_and_the_zeros_of_octaves_do_not_meet() {
        assert_eq!(fbm(1).color(Vec2::new(0.25, -0.5)), Vec3::splat(0.5));
        let corners = (0..64).map(|cell| fbm(4).color(Vec2::new(cell as f32 / 8.0, 0.25)).x);
        assert!(corners.filter(|value| (value - 0.5).abs() < 0.01).count() < 32);
        let product = |octave: u32, seed: u32| -> f64 {
            places().map(|place| f64::from(noise(place, 0, 1) * noise(place, octave, seed))).sum()
        };
        for (octave, seed) in [(0, 2), (1, 1), (2, 1)] {
            let correlation = product(octave, seed) / product(0, 1);
            assert!(correlation.abs() < 0.1, "octave {octave}, seed {seed}: {correlation}");
        }
    }

    #[test]
    fn bits_are_those_of_every_machine() {
        let fbm = Fbm { octaves: 8, gain: 0.6, lacunarity: 2.3, frequency: 3.7, ..fbm(8) };
        let hash = places()
            .step_by(13)
            .flat_map(|place| fbm.color(place).to_array())
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, value| {
                (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3)
            });
        assert_eq!(format!("{hash:016x}"), "0");
    }
}
