//! Owns gradient noise in space and its octaves, with proven bounds of value and slope.

use glam::Vec3;

use super::error::{SdfError, require};
use super::real::{Lattice, Point, Real};

/// Sum of octaves of gradient noise: `amplitude Σ gainⁱ n(frequency lacunarityⁱ p + i s)`.
///
/// An octave `n` is the noise of Perlin, "Improving Noise" (2002): the fade curve 6t⁵ − 15t⁴ + 10t³ and the twelve
/// edges of a cube as gradients, chosen by an integer hash of (cell, octave, seed) in place of his table, so that the
/// noise has no period. Octaves are shifted against each other by `s`, because with a whole lacunarity all of them
/// would be 0 at the same places.
///
/// With gradients that may be anything in every corner, `|n|` and `|∇n|` are each the greatest of finitely many smooth
/// functions over one cell; their greatest values are 1.0364 and 3.75 (`LARGEST` and `STEEPEST`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    octaves: u32,
    gain: f32,
    lacunarity: f32,
    amplitude: f32,
    frequency: f32,
    seed: u32,
    /// What all octaves together add at most.
    bound: f32,
}

/// Most that an octave is away from 0, rounded up (1.03635, near two fifths of the way from a face to the middle).
const LARGEST: f32 = 1.0364;

/// The same for proofs.
#[cfg(test)]
pub(super) const LARGEST_OCTAVE: f64 = 1.0364;

/// Steepest slope of an octave, in units per cell (reached in the middle of a cell).
const STEEPEST: f32 = 3.75;

/// The same for proofs.
#[cfg(test)]
pub(super) const STEEPEST_OCTAVE: f64 = 3.75;

/// How far octaves are moved against each other, in cells: powers of the three-dimensional golden ratio.
const SHIFT: [f32; 3] = [0.819_172_5, 0.671_043_6, 0.549_700_5];

/// What a document says about noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseParameters {
    /// Height of the first octave, in units of length; 0 to 1e6.
    pub amplitude: f32,
    /// Cells of the first octave per unit of length; 1e-6 to 1e6.
    pub frequency: f32,
    /// Number of octaves, 1 to 16.
    pub octaves: u32,
    /// Amplitude of an octave in units of the one before; 0 to 1.
    pub gain: f32,
    /// Frequency of an octave in units of the one before; 1 to 8.
    pub lacunarity: f32,
    /// Another number is another noise.
    pub seed: u32,
}

/// One octave as it is met on the way through them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Octave {
    amplitude: f32,
    frequency: f32,
    /// What this octave adds at most.
    pub(super) bound: f32,
    /// What its slope is at most.
    pub(super) slope: f32,
    /// What all octaves after it add at most; 0 of the last.
    pub(super) rest: f32,
    shift: [f32; 3],
    key: u32,
}

impl Noise {
    /// The noise of these parameters.
    ///
    /// # Errors
    /// A parameter is out of its range.
    pub fn new(parameters: NoiseParameters) -> Result<Self, SdfError> {
        let NoiseParameters { amplitude, frequency, octaves, gain, lacunarity, seed } = parameters;
        require(
            (0.0..=1e6).contains(&amplitude),
            "fbm_noise.amplitude",
            amplitude,
            "a number from 0 to 1e6",
        )?;
        require(
            (1e-6..=1e6).contains(&frequency),
            "fbm_noise.frequency",
            frequency,
            "a number from 1e-6 to 1e6",
        )?;
        let count = octaves as f32;
        require((1..=16).contains(&octaves), "fbm_noise.octaves", count, "an integer from 1 to 16")?;
        require((0.0..=1.0).contains(&gain), "fbm_noise.gain", gain, "a number from 0 to 1")?;
        require(
            (1.0..=8.0).contains(&lacunarity),
            "fbm_noise.lacunarity",
            lacunarity,
            "a number from 1 to 8",
        )?;
        let mut noise = Self { octaves, gain, lacunarity, amplitude, frequency, seed, bound: 0.0 };
        // A little more than the sum, so that its rounding does not matter.
        noise.bound = noise.octaves().map(|octave| octave.bound).sum::<f32>() * (1.0 + 1e-6);
        Ok(noise)
    }

    /// What all octaves together are away from 0 at most.
    pub fn bound(&self) -> f32 {
        self.bound
    }

    /// The sum of all octaves at a place.
    pub fn value(&self, place: Vec3) -> f32 {
        self.octaves().map(|octave| octave.at(Point::<f32>::splat(place))).sum()
    }

    /// The octaves, the coarsest first.
    #[inline]
    pub(super) fn octaves(&self) -> impl Iterator<Item = Octave> {
        let Self { gain, lacunarity, seed, .. } = *self;
        let (mut amplitude, mut frequency, mut rest) = (self.amplitude, self.frequency, self.bound);
        let last = self.octaves - 1;
        (0..self.octaves).map(move |number| {
            let bound = amplitude * LARGEST;
            rest = if number == last { 0.0 } else { (rest - bound).max(0.0) };
            let octave = Octave {
                amplitude,
                frequency,
                bound,
                rest,
                slope: amplitude * frequency * STEEPEST,
                shift: SHIFT.map(|part| part * number as f32),
                key: mix(seed.wrapping_add(number.wrapping_mul(0x9e37_79b9))),
            };
            amplitude *= gain;
            frequency *= lacunarity;
            octave
        })
    }
}

impl Octave {
    /// What the octave adds at a place.
    #[inline]
    pub(super) fn at<R: Real>(&self, p: Point<R>) -> R {
        let scale = R::splat(self.frequency);
        let [x, y, z] = self.shift.map(R::splat);
        let place = Point::new(p.x * scale + x, p.y * scale + y, p.z * scale + z);
        R::splat(self.amplitude) * R::gradient_noise(place, self.key)
    }
}

/// An octave at a place measured in cells; `key` is that of the octave.
#[inline]
pub(super) fn gradient_noise<R: Lattice>(place: Point<R>, key: u32) -> R {
    // Farther out there is nothing between whole numbers.
    let whole = |at: R| at.floor().max(R::splat(-FARTHEST)).min(R::splat(FARTHEST));
    let corner = Point::new(whole(place.x), whole(place.y), whole(place.z));
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let share = |at: R, whole: R| (at - whole).max(zero).min(one);
    let part = Point::new(share(place.x, corner.x), share(place.y, corner.y), share(place.z, corner.z));
    let cell = R::cell(corner, key);
    let along = [part.x, part.y, part.z].map(|part| [part, part - one]);
    let [x, y, z] = [fade(part.x), fade(part.y), fade(part.z)];
    let between = |a: R, b: R, share: R| a + share * (b - a);
    let bottom = between(dot::<R, 0, 0, 0>(cell, along), dot::<R, 1, 0, 0>(cell, along), x);
    let top = between(dot::<R, 0, 1, 0>(cell, along), dot::<R, 1, 1, 0>(cell, along), x);
    let far = between(bottom, top, y);
    let bottom = between(dot::<R, 0, 0, 1>(cell, along), dot::<R, 1, 0, 1>(cell, along), x);
    let top = between(dot::<R, 0, 1, 1>(cell, along), dot::<R, 1, 1, 1>(cell, along), x);
    between(far, between(bottom, top, y), z)
}

/// The gradient in a corner times the way from there; `along` is the way from the lower and the upper corner by axis.
#[inline]
fn dot<R: Lattice, const X: usize, const Y: usize, const Z: usize>(cell: R::Cell, along: [[R; 2]; 3]) -> R {
    let way = Point::new(along[0][X], along[1][Y], along[2][Z]);
    R::corner(cell, [X as u32, Y as u32, Z as u32], way)
}

/// From 0 to 1 with no slope and no curvature at the ends.
#[inline]
fn fade<R: Real>(t: R) -> R {
    t * t * t * (t * (t * R::splat(6.0) - R::splat(15.0)) + R::splat(10.0))
}

/// Greatest number of a cell that is told apart from its neighbours.
const FARTHEST: f32 = 8_388_608.0;

/// Odd factors of the three numbers of a cell, whose products together make the hash of the cell.
pub(super) const STRIDES: [u32; 3] = [0x85eb_ca6b, 0xc2b2_ae35, 0x27d4_eb2f];

/// The hash of the corner that is `step` away from the lowest of a cell.
#[inline]
pub(super) fn hash(cell: [u32; 3], step: [u32; 3]) -> u32 {
    let [x, y, z]: [u32; 3] =
        std::array::from_fn(|axis| cell[axis].wrapping_add(step[axis].wrapping_mul(STRIDES[axis])));
    mix(x ^ y ^ z)
}

/// A third of the hashes are below minus this, as signed numbers, and a third above this.
pub(super) const THIRD: i32 = 715_827_882;

/// A way times the gradient that a hash stands for: one of the twelve edges of a cube, all as likely to within 2⁻³⁰.
/// Their mean is zero.
#[inline]
pub(super) fn edge<R: Real>(bits: u32, way: Point<R>) -> R {
    // The axis that has no part in it by the size of the hash, and two signs by its lowest bits.
    let signed = bits.cast_signed();
    let (first, second) = match signed {
        _ if signed < -THIRD => (way.y, way.z),
        _ if signed > THIRD => (way.x, way.y),
        _ => (way.x, way.z),
    };
    let turned = |part: R, bit: u32| if bits >> bit & 1 == 0 { part } else { -part };
    turned(first, 0) + turned(second, 1)
}

/// Factors of [`mix`].
pub(super) const FACTORS: [u32; 2] = [0x21f0_aaad, 0x735a_2d97];

/// A bijection of 32 bits whose every input bit changes every output bit about half the time (the constants are
/// those of the least biased two-round multiply and shift that is known, Wellons' search).
#[inline]
fn mix(mut bits: u32) -> u32 {
    bits = (bits ^ (bits >> 16)).wrapping_mul(FACTORS[0]);
    bits = (bits ^ (bits >> 15)).wrapping_mul(FACTORS[1]);
    bits ^ (bits >> 15)
}
