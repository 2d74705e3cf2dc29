//! Owns random numbers: Owen-scrambled Sobol points keyed by what they are for, never by who asks.
//!
//! Every decision along a path (pixel offset, light choice, lobe choice …) has its own padded copy of the first two
//! Sobol dimensions, shuffled and scrambled by a seed of (seed, frame, pixel, replicate, decision)
//! (Burley 2020, "Practical Hash-based Owen Scrambling"). Sample indices are 32 bits.

use glam::Vec2;

/// What a random number decides. Decisions of a bounce repeat for every bounce.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decision {
    /// Offset inside the pixel filter.
    Filter,
    /// Point on the lens.
    Lens,
    /// Which light to sample.
    LightChoice(u32),
    /// Whether a shadow ray is traced: of a bounce, the ray of that number.
    Shadow(u32, u32),
    /// Point on the light.
    LightPoint(u32),
    /// Which lobe of the material.
    Lobe(u32),
    /// Direction of the lobe.
    Direction(u32),
    /// Whether the path goes on.
    Roulette(u32),
    /// Whether the path is stopped by a surface that is there in part: of a bounce, the crossing of that number.
    Opacity(u32, u32),
    /// Whether and where a medium scatters the path: of a bounce, the medium of that number on its way.
    Distance(u32, u32),
    /// Which light is gathered in a medium, and where: as above.
    GatherPlace(u32, u32),
    /// The place from which many lights are seen for that.
    GatherView(u32, u32),
    /// Point on that light.
    GatherPoint(u32, u32),
    /// Which light at infinity to sample, beside one at a finite distance.
    InfiniteChoice(u32),
    /// Point on that light.
    InfinitePoint(u32),
    /// Which light at infinity is gathered in a medium, and where: as for [`Decision::Distance`].
    GatherSky(u32, u32),
    /// Point on that light.
    GatherSkyPoint(u32, u32),
    /// Whether lights are sampled at the surface behind a place where a medium scatters the path.
    Behind(u32),
}

impl Decision {
    const PER_BOUNCE: u32 = 16;

    fn index(self) -> u32 {
        let of = |slot: u32, bounce: u32| (bounce + 1) * Self::PER_BOUNCE + slot;
        match self {
            Self::Filter => 0,
            Self::Lens => 1,
            Self::LightChoice(b) => of(0, b),
            Self::Shadow(b, ray) => of(1, b) + (ray << 17),
            Self::LightPoint(b) => of(2, b),
            Self::Lobe(b) => of(3, b),
            Self::Direction(b) => of(4, b),
            Self::Roulette(b) => of(5, b),
            // Bounces stay below 2¹² and crossings below 2¹⁵, so that no two decisions share a number.
            Self::Opacity(b, crossing) => of(6, b) + (crossing << 17),
            Self::Distance(b, piece) => of(7, b) + (piece << 17),
            Self::GatherPlace(b, piece) => of(8, b) + (piece << 17),
            Self::GatherView(b, piece) => of(9, b) + (piece << 17),
            Self::GatherPoint(b, piece) => of(10, b) + (piece << 17),
            Self::Behind(b) => of(11, b),
            Self::InfiniteChoice(b) => of(12, b),
            Self::InfinitePoint(b) => of(13, b),
            Self::GatherSky(b, piece) => of(14, b) + (piece << 17),
            Self::GatherSkyPoint(b, piece) => of(15, b) + (piece << 17),
        }
    }
}

/// One of the two independently scrambled halves of a pixel's samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Replicate {
    /// Even samples.
    A,
    /// Odd samples.
    B,
}

/// The random numbers of one sample of one replicate of one pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampler {
    key: u64,
    /// The sample's index, its bits reversed.
    index: u32,
}

impl Sampler {
    /// Keyed by everything that a pixel may depend on; `index` counts within the replicate.
    #[inline]
    pub fn new(stream: Stream, pixel: [u32; 2], replicate: Replicate, index: u32) -> Self {
        let place = u64::from(pixel[0]) << 32 | u64::from(pixel[1]);
        let key = mix64(mix64(stream.0 ^ mix64(place)) ^ replicate as u64);
        Self { key, index: index.reverse_bits() }
    }

    /// That of the pixel's next sample.
    #[inline]
    #[must_use]
    pub fn next(self) -> Self {
        Self { key: self.key, index: self.index.reverse_bits().wrapping_add(1).reverse_bits() }
    }

    /// One number in [0, 1).
    #[inline]
    pub fn get_1d(&self, decision: Decision) -> f32 {
        let seeds = self.seeds(decision);
        to_unit(first(shuffled(self.index, seeds.shuffle), seeds.x))
    }

    /// A point in [0, 1)².
    #[inline]
    pub fn get_2d(&self, decision: Decision) -> Vec2 {
        let seeds = self.seeds(decision);
        let index = shuffled(self.index, seeds.shuffle);
        Vec2::new(to_unit(first(index, seeds.x)), to_unit(second(index, seeds.y)))
    }

    /// How many samplers draw at a time: what a register of 256 bits holds.
    pub const LANES: usize = 8;

    /// What [`Self::get_1d`] gives to each: loops over arrays, of which compilers make lanes.
    #[inline]
    pub fn get_1d_of_all(samplers: &[Self; Self::LANES], decision: Decision) -> [f32; Self::LANES] {
        let (index, x, _) = Self::indices_and_seeds(samplers, decision);
        std::array::from_fn(|lane| to_unit(first(index[lane], x[lane])))
    }

    /// What [`Self::get_2d`] gives to each.
    #[inline]
    pub fn get_2d_of_all(samplers: &[Self; Self::LANES], decision: Decision) -> [Vec2; Self::LANES] {
        let (index, x, y) = Self::indices_and_seeds(samplers, decision);
        let x: [f32; Self::LANES] = std::array::from_fn(|lane| to_unit(first(index[lane], x[lane])));
        let y: [f32; Self::LANES] = std::array::from_fn(|lane| to_unit(second(index[lane], y[lane])));
        std::array::from_fn(|lane| Vec2::new(x[lane], y[lane]))
    }

    /// Shuffled indices, and what scrambles the first and the second dimension.
    #[inline]
    fn indices_and_seeds(samplers: &[Self; Self::LANES], decision: Decision) -> (Lanes, Lanes, Lanes) {
        let seeds = samplers.map(|sampler| sampler.seeds(decision));
        let shuffle = seeds.each_ref().map(|s| s.shuffle);
        let index = std::array::from_fn(|lane| shuffled(samplers[lane].index, shuffle[lane]));
        (index, seeds.each_ref().map(|s| s.x), seeds.each_ref().map(|s| s.y))
    }

    #[inline]
    fn seeds(&self, decision: Decision) -> Seeds {
        // The pixel's key plus a counter, mixed by a bijection: two decisions of a pixel never share their seeds.
        let h = mix64(self.key.wrapping_add(u64::from(decision.index()).wrapping_mul(0x9e37_79b9_7f4a_7c15)));
        // One more product takes every bit into the upper half (multiplier by Steele and Vigna 2021).
        let y = (h ^ h >> 29).wrapping_mul(0xd134_2543_de82_ef95) >> 32;
        Seeds { shuffle: h as u32, x: (h >> 32) as u32, y: y as u32 }
    }
}

/// The part of a sampler's key that a whole frame shares: (seed, frame).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream(u64);

impl Stream {
    /// The stream of a seed and a frame number.
    pub fn new(seed: u32, frame: i32) -> Self {
        Self(mix64(u64::from(seed) << 32 | u64::from(frame.cast_unsigned())))
    }
}

type Lanes = [u32; Sampler::LANES];

struct Seeds {
    shuffle: u32,
    x: u32,
    y: u32,
}

/// Finaliser of splitmix64 (Steele et al. 2014): a bijection of 64 bits.
#[inline]
fn mix64(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

/// A hash in which every bit depends on lower bits only (Laine and Karras 2011, constants by Vegdahl 2021), so that
/// it is an Owen scramble of the reversed bits.
#[inline]
fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul(seed >> 16 | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// Shuffles sample indices, given with their bits reversed, so that every aligned block of 2ᵐ indices maps onto an aligned
/// block of 2ᵐ.
#[inline]
fn shuffled(reversed: u32, seed: u32) -> u32 {
    laine_karras(reversed, seed).reverse_bits()
}

/// The first Sobol dimension, which is the index with its bits reversed, Owen-scrambled from its most significant bit on.
#[inline]
fn first(index: u32, seed: u32) -> u32 {
    laine_karras(index, seed).reverse_bits()
}

/// The second Sobol dimension, Owen-scrambled.
#[inline]
fn second(index: u32, seed: u32) -> u32 {
    laine_karras(sobol_second(index), seed).reverse_bits()
}

/// The second Sobol dimension, its bits reversed, from the index: the Pascal matrix modulo 2, which is the fifth Kronecker
/// power of [[1, 1], [0, 1]] and so takes five steps instead of 32.
#[inline]
fn sobol_second(index: u32) -> u32 {
    let mut x = index;
    x ^= x >> 16 & 0x0000_ffff;
    x ^= x >> 8 & 0x00ff_00ff;
    x ^= x >> 4 & 0x0f0f_0f0f;
    x ^= x >> 2 & 0x3333_3333;
    x ^= x >> 1 & 0x5555_5555;
    x
}

/// The upper 24 bits as a float in [0, 1).
#[inline]
fn to_unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampler(pixel: [u32; 2], index: u32) -> Sampler {
        Sampler::new(Stream::new(7, 3), pixel, Replicate::A, index)
    }

    #[test]
    fn eight_at_a_time_draw_what_each_does() {
        let samplers: [Sampler; Sampler::LANES] =
            std::array::from_fn(|lane| sampler([lane as u32 * 31, 7], 0x1000_0001 * lane as u32));
        for decision in [Decision::Filter, Decision::Direction(0), Decision::Shadow(4000, 30_000)] {
            let (one, two) =
                (Sampler::get_1d_of_all(&samplers, decision), Sampler::get_2d_of_all(&samplers, decision));
            assert_eq!(one, samplers.map(|s| s.get_1d(decision)));
            assert_eq!(two, samplers.map(|s| s.get_2d(decision)));
        }
        assert_eq!(sampler([3, 4], 9).next(), sampler([3, 4], 10));
    }

    #[test]
    fn second_dimension_equals_the_direction_numbers() {
        for i in (0..4096u32).chain([u32::MAX, 0x8000_0001]) {
            let (mut v, mut want) = (1u32 << 31, 0);
            for bit in 0..32 {
                if i >> bit & 1 == 1 {
                    want ^= v;
                }
                v ^= v >> 1;
            }
            assert_eq!(sobol_second(i).reverse_bits(), want, "index {i}");
        }
    }

    /// Every aligned block of 2ᵐ samples puts one point into every elementary interval (a (0,m,2)-net in base 2).
    #[test]
    fn aligned_blocks_are_nets() {
        for (m, start) in [(2, 0), (4, 0), (4, 48), (7, 128), (10, 1024), (5, 0xffff_ffe0)] {
            let points: Vec<Vec2> =
                (0..1u32 << m).map(|i| sampler([5, 9], start + i).get_2d(Decision::Direction(2))).collect();
            for a in 0..=m {
                let (nx, ny) = (1usize << a, 1usize << (m - a));
                let mut seen = vec![false; nx * ny];
                for p in &points {
                    let cell = (p.y * ny as f32) as usize * nx + (p.x * nx as f32) as usize;
                    assert!(!std::mem::replace(&mut seen[cell], true), "m={m} start={start} split={a}");
                }
            }
        }
    }

    #[test]
    fn decisions_pixels_and_replicates_are_independent() {
        let n = 4096;
        let correlation = |f: &dyn Fn(u32) -> (f32, f32)| {
            let (mut sx, mut sy, mut sxy) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let (x, y) = f(i);
                sx += f64::from(x);
                sy += f64::from(y);
                sxy += f64::from(x) * f64::from(y);
            }
            let n = f64::from(n);
            ((sxy / n - sx / n * (sy / n)) * 12.0).abs()
        };
        // Same index, two decisions; then two neighbouring pixels; then the replicates: five sigma is 0.08.
        let one = |s: Sampler, d| s.get_1d(d);
        assert!(
            correlation(&|i| (
                one(sampler([1, 1], i), Decision::Lobe(0)),
                one(sampler([1, 1], i), Decision::Roulette(0))
            )) < 0.08
        );
        assert!(
            correlation(&|i| (
                one(sampler([i, 1], 0), Decision::Filter),
                one(sampler([i + 1, 1], 0), Decision::Filter)
            )) < 0.08
        );
        let b = |i| Sampler::new(Stream::new(7, 3), [1, 1], Replicate::B, i);
        assert!(
            correlation(&|i| (one(sampler([1, 1], i), Decision::Lens), one(b(i), Decision::Lens))) < 0.08
        );
    }

    /// Six padded dimensions of a smooth integrand: the error must fall well below that of independent samples.
    #[test]
    fn padded_dimensions_integrate_better_than_independent_ones() {
        let decisions = [Decision::Filter, Decision::LightPoint(0), Decision::Direction(1)];
        let (pixels, n) = (256u32, 256u32);
        let mut mse = 0.0;
        for pixel in 0..pixels {
            let mut sum = 0.0;
            for i in 0..n {
                sum += decisions
                    .iter()
                    .map(|&d| sampler([pixel, 77], i).get_2d(d))
                    .map(|u| f64::from(u.x * u.y))
                    .sum::<f64>();
            }
            mse += (sum / f64::from(n) - 0.75).powi(2) / f64::from(pixels);
        }
        let independent = 3.0 * (1.0 / 9.0 - 1.0 / 16.0) / f64::from(n);
        assert!(mse < independent / 50.0, "mse {mse:.3e} against {independent:.3e}");
    }
}
