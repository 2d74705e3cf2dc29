//! Owns what the error of a block of pixels is, as far as its two replicates tell.

use super::{BLOCK, PixelSums};
use crate::color::luminance;
use glam::{DVec3, Vec3};

/// How far around a pixel its brightness is looked for.
const AROUND: usize = 2;

/// A pixel that differs from what is around it by more than this times half the difference of its replicates does so by
/// what it shows, not by noise: it lies on an edge, and its own brightness is the better one.
const NOISE: f64 = 3.0;

/// Half the difference of a pixel's replicates by its brightness, below which that brightness is good enough to divide
/// by.
const SURE: f64 = 0.25;

/// How far the interval reaches for the sake of brightness that is not sure, as a part of what rests on it.
const DOUBT: f64 = 0.2;

/// How far it reaches up for lights that few samples have seen, as a part of the error that they would make if they were hardly
/// there.
const GLINTS: f64 = 0.15;

/// Standard deviations that 95 % lie within.
const Z: f64 = 1.96;

/// Most pixels of a block.
const MOST: usize = (BLOCK * BLOCK) as usize;

/// Errors of the means of a block's pixels, given row by row; `scale` is the exposure that relative errors are judged at.
///
/// (A − B)²/4 is an unbiased estimate of the square, because the replicates A and B are independent. Where they differ by
/// much, it is not divided by the squared mean of the pixel itself: a single bright sample would raise both and count as 1 at
/// most, where it is many times what is really there. The pixels around, within the block, say what that is. On most scenes
/// the whole is then 0.85 to 1.25 times the truth; by the pixel itself 0.16 to 1.0 times.
pub(super) fn block_errors(pixels: &[PixelSums], width: usize, samples: [u32; 2], scale: f64) -> Errors {
    let mut errors = Errors::default();
    let halves = || pixels.iter().map(|pixel| replicates(pixel, samples).map(|half| half.as_dvec3() * scale));
    let found = halves().zip(pixels).map(|([a, b], pixel)| Seen {
        mean: (a + b) * 0.5,
        noise: (a - b).abs() * 0.5,
        emission: f64::from(pixel.emission.to_f32()) * scale,
    });
    for (level, [a, b]) in levels(found, width).zip(halves()) {
        let half = (a - b) * 0.5;
        let over = |level: DVec3| (half * half / (level * level + 0.01)).element_sum() / 3.0;
        let relative = over(level.likely);
        errors.add(&Errors {
            relative,
            absolute: (half * half).element_sum() / 3.0 / (scale * scale),
            squares: relative * relative,
            cubes: relative.powi(3),
            doubt: if level.is_unsure { relative } else { 0.0 },
            glints: over(level.least) - relative,
        });
    }
    errors
}

/// Sums over pixels.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Errors {
    /// Relative squared errors, averaged over channels.
    pub(super) relative: f64,
    /// Absolute squared errors, averaged over channels.
    pub(super) absolute: f64,
    /// Squares of the relative ones.
    squares: f64,
    /// Cubes of the relative ones.
    cubes: f64,
    /// What of the relative ones rests on brightness that is not sure.
    doubt: f64,
    /// By how much the relative ones would be more, if lights that few samples have seen were hardly there.
    glints: f64,
}

impl Errors {
    pub(super) fn add(&mut self, other: &Self) {
        self.relative += other.relative;
        self.absolute += other.absolute;
        self.squares += other.squares;
        self.cubes += other.cubes;
        self.doubt += other.doubt;
        self.glints += other.glints;
    }

    /// 95 % interval of the mean relative squared error of so many pixels.
    ///
    /// What is estimated is not the mean over all pictures but what this one is off, which scatters as much as the estimate
    /// itself: the squares count twice. The upper end is further away by the skewness (Johnson, "Modified t tests and
    /// confidence intervals for asymmetrical populations", 1978): where few pixels make up much of the error, more of their
    /// kind have not been hit yet. So it is where few samples have seen a light itself, as a glint: whether it fills a part of
    /// the pixel, or is found there hardly ever, a few samples cannot tell.
    pub(super) fn interval(&self, pixels: f64) -> [f64; 2] {
        let mean = self.relative / pixels;
        let half = (Z * Z * 2.0 * self.squares + (DOUBT * self.doubt).powi(2)).sqrt() / pixels;
        let skew = (1.0 + 2.0 * Z * Z) / 6.0 * self.cubes / self.squares.max(f64::MIN_POSITIVE) / pixels;
        [(mean - half).max(0.0), mean + half + skew + GLINTS * self.glints / pixels]
    }
}

/// What a pixel shows, as far as some samples tell.
#[derive(Clone, Copy, Default)]
pub(crate) struct Seen {
    pub(crate) mean: DVec3,
    /// Standard error of the mean.
    pub(crate) noise: DVec3,
    /// Luminance of the lights that the pixel sees themselves: they have edges, but no noise of paths.
    pub(crate) emission: f64,
}

impl Seen {
    /// Without the lights that are seen themselves.
    fn scattered(&self) -> DVec3 {
        self.mean * (1.0 - (self.emission / f64::from(luminance(self.mean.as_vec3())).max(1e-30)).min(1.0))
    }
}

/// How bright a pixel really is.
#[derive(Clone, Copy)]
pub(crate) struct Level {
    pub(crate) likely: DVec3,
    /// Without what of the lights that it sees only one replicate has seen.
    least: DVec3,
    /// Whether it was told by the pixels around.
    is_unsure: bool,
}

/// How bright the pixels of a block really are, as far as that is known, whatever their own noise.
pub(crate) fn levels(pixels: impl Iterator<Item = Seen>, width: usize) -> impl Iterator<Item = Level> {
    let mut seen = [Seen::default(); MOST];
    let count = seen.iter_mut().zip(pixels).map(|(seen, pixel)| *seen = pixel).count();
    let sums = sums_around(&seen[..count], width.max(1));
    seen.into_iter().take(count).zip(sums).map(|(seen, (around, count))| level(&seen, around, count))
}

/// The same of one; `around` is the sum over the square around it of what `count` pixels scatter, itself included.
fn level(seen: &Seen, around: DVec3, count: f64) -> Level {
    let (own, scattered) = (seen.mean, seen.scattered());
    let noisy = seen.noise.cmpgt(own.abs() * SURE);
    if count <= 1.0 {
        return Level { likely: own, least: own, is_unsure: noisy.any() };
    }
    let others = (around - scattered) / (count - 1.0);
    let instead = own - scattered + others;
    let no_edge = (own - instead).abs().cmple(seen.noise * NOISE);
    let likely = DVec3::select(noisy & no_edge, instead, own);
    let dim = (own.abs() - seen.noise).max(others).min(likely);
    let least = if seen.emission > 0.0 { DVec3::select(noisy, dim, likely) } else { likely };
    Level { likely, least, is_unsure: (noisy & no_edge).any() }
}

/// Means of the replicates where they have samples.
pub(super) fn replicates(pixel: &PixelSums, samples: [u32; 2]) -> [Vec3; 2] {
    [pixel.a / samples[0].max(1) as f32, pixel.b / samples[1].max(1) as f32]
}

/// For each pixel the sum of the square around it, within the block, and how many pixels that is.
fn sums_around(seen: &[Seen], width: usize) -> impl Iterator<Item = (DVec3, f64)> + use<> {
    let height = seen.len() / width;
    let mut rows = [DVec3::ZERO; MOST];
    let range = move |at: usize, end: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(end);
    for (row, sums) in seen.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for (x, sum) in sums.iter_mut().enumerate() {
            *sum = row[range(x, width)].iter().map(Seen::scattered).sum();
        }
    }
    (0..height * width).map(move |at| {
        let (x, y) = (at % width, at / width);
        let of_rows = range(y, height);
        let count = (of_rows.len() * range(x, width).len()) as f64;
        (of_rows.map(|y| rows[y * width + x]).sum(), count)
    })
}

#[cfg(test)]
mod tests {
    use super::{BLOCK, Errors, GLINTS, PixelSums, block_errors};
    use glam::Vec3;

    fn block(width: usize, height: usize, of: impl Fn(usize, usize) -> (f32, f32)) -> Vec<PixelSums> {
        let halves = (0..width * height).map(|at| of(at % width, at / width));
        halves.map(|(a, b)| PixelSums { a: Vec3::splat(a), b: Vec3::splat(b), ..PixelSums::ZERO }).collect()
    }

    #[test]
    fn even_blocks_have_the_plain_formula() {
        for (width, height) in [(1, 1), (3, 1), (16, 16), (5, 16)] {
            let pixels = block(width, height, |_, _| (2.0 * 1.1, 3.0 * 0.9));
            let Errors { relative, absolute, .. } = block_errors(&pixels, width, [2, 3], 1.0);
            let count = (width * height) as f64;
            assert!((absolute / count - 0.01).abs() < 1e-7, "{width}x{height}: {absolute}");
            assert!((relative / count - 0.01 / 1.01).abs() < 1e-7, "{width}x{height}: {relative}");
            // Exposure leaves absolute errors as they are.
            let brighter = block_errors(&pixels, width, [2, 3], 4.0);
            assert!((brighter.absolute - absolute).abs() < 1e-6 * count);
            assert!((brighter.relative / count - 0.16 / 16.01).abs() < 1e-6);
        }
    }

    #[test]
    fn a_firefly_counts_in_full() {
        let side = BLOCK as usize;
        for at in [(0, 0), (7, 7), (15, 3), (2, 15)] {
            let pixels = block(side, side, |x, y| if (x, y) == at { (100.0, 0.0) } else { (0.1, 0.1) });
            let Errors { relative, .. } = block_errors(&pixels, side, [1, 1], 1.0);
            let expected = 50.0_f64 * 50.0 / (0.1 * 0.1 + 0.01);
            assert!((relative / expected - 1.0).abs() < 1e-3, "{at:?}: {relative}, expected {expected}");
        }
    }

    #[test]
    fn the_edge_of_a_lamp_is_no_firefly() {
        let side = BLOCK as usize;
        let mut pixels = block(side, side, |x, y| if (x, y) == (5, 5) { (100.0, 0.0) } else { (0.1, 0.1) });
        pixels[5 * side + 5].emission = half::f16::from_f32(50.0);
        let Errors { relative, .. } = block_errors(&pixels, side, [1, 1], 1.0);
        assert!((relative - 1.0).abs() < 0.01, "{relative}");
        // Nor does it brighten what is around it.
        pixels[5 * side + 6] = PixelSums { a: Vec3::splat(0.2), b: Vec3::ZERO, ..PixelSums::ZERO };
        let Errors { relative: both, .. } = block_errors(&pixels, side, [1, 1], 1.0);
        assert!((both - relative - 0.5).abs() < 0.05, "{both} {relative}");
    }

    #[test]
    fn a_light_that_one_replicate_has_seen_may_be_a_glint() {
        let side = BLOCK as usize;
        let reach = |lamp: (f32, f32)| {
            let mut pixels = block(side, side, |x, y| if (x, y) == (5, 5) { lamp } else { (0.1, 0.1) });
            pixels[5 * side + 5].emission = half::f16::from_f32((lamp.0 + lamp.1) * 0.5);
            let errors = block_errors(&pixels, side, [1, 1], 1.0);
            let [low, high] = errors.interval(256.0);
            (errors.relative, low, high)
        };
        // Both have seen it: nothing is unsure.
        let (relative, low, high) = reach((11.0, 9.0));
        assert!((relative - 0.01).abs() < 1e-3 && low == 0.0 && high < 0.0004, "{relative} {low} {high}");
        // One has: the error may be that of a firefly beside what is around, of which a share counts.
        let (relative, low, high) = reach((20.0, 0.0));
        let firefly = 10.0_f32.powi(2) / 0.02;
        assert!((relative - 0.98).abs() < 0.01 && low == 0.0, "{relative} {low}");
        assert!((high * 256.0 / (GLINTS * f64::from(firefly)) - 1.0).abs() < 0.02, "{high}");
    }

    #[test]
    fn intervals_narrow_with_the_number_of_pixels() {
        let few = Errors { relative: 100.0, squares: 100.0, cubes: 100.0, ..Errors::default() };
        let many = Errors { relative: 10_000.0, squares: 10_000.0, cubes: 10_000.0, ..Errors::default() };
        let [low, high] = few.interval(100.0);
        assert!((low - 0.7228).abs() < 1e-3 && (high - 1.2917).abs() < 1e-3, "{low} {high}");
        let [low, high] = many.interval(10_000.0);
        assert!((low - 0.9723).abs() < 1e-3 && (high - 1.0279).abs() < 1e-3, "{low} {high}");
        // One pixel that is all of the error: nothing is known from below.
        let alone = Errors { relative: 100.0, squares: 10_000.0, cubes: 1_000_000.0, ..Errors::default() };
        let [low, high] = alone.interval(100.0);
        assert!(low == 0.0 && high > 3.7, "{low} {high}");
    }
}
