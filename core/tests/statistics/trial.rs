//! Owns what one sampler goes through: samples against their density (χ²), weights against the quadrature of the value.

use super::chi2::{Verdict, chi2, two_sided};
use super::partition::{Grain, Partition};
use super::random::Random;
use glam::Vec3;
use karst_core::bsdf::{Bsdf, BsdfSample};

/// Something that scatters light: a model of the renderer, or a wrong one.
pub(crate) trait Scatterer {
    /// Value times cosine.
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3;
    /// Density of `sample`.
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32;
    /// A direction.
    fn sample(&self, wo: Vec3, random: &mut Random) -> Option<BsdfSample>;

    /// What the mean weight is held against: value times cosine, the mean over channels.
    fn truth(&self, wo: Vec3, wi: Vec3) -> f64 {
        f64::from(self.eval(wo, wi).element_sum()) / 3.0
    }
}

impl Scatterer for Bsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        Self::eval(self, wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        Self::pdf(self, wo, wi)
    }

    fn sample(&self, wo: Vec3, random: &mut Random) -> Option<BsdfSample> {
        let lobe = random.unit();
        Self::sample(self, wo, lobe, random.pair())
    }
}

/// How much is sampled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effort {
    /// Samples that are tested.
    pub(crate) samples: u32,
    /// Samples that only decide how the sphere is cut.
    pub(crate) pilot: u32,
    /// Chooses the random numbers.
    pub(crate) seed: u64,
}

impl Effort {
    /// For every run.
    pub(crate) const SHORT: Self = Self { samples: 1 << 17, pilot: 1 << 13, seed: 1 };
    /// For nights.
    pub(crate) const LONG: Self = Self { samples: 1 << 22, pilot: 1 << 18, seed: 1 };

    fn grain(&self) -> Grain {
        Grain { cell: (self.pilot / 128) as usize, leaf: 6 }
    }
}

/// What became of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outcome {
    /// Samples against their density.
    pub(crate) verdict: Verdict,
    /// Integral of the density.
    pub(crate) mass: f64,
    /// Share of the samples with a direction of its own, as a mirror's.
    pub(crate) single: f64,
    /// Mean weight of scattered samples, over channels, and its standard error.
    pub(crate) mean: (f64, f64),
    /// Integral of the value over all directions.
    pub(crate) albedo: f64,
    /// Largest weight.
    pub(crate) largest: f64,
    /// Share of samples whose weight or density is not what `eval` and `pdf` say.
    pub(crate) inconsistent: f64,
    /// Samples that are not finite, not of unit length, negative, or of density 0.
    pub(crate) broken: u32,
}

impl Outcome {
    /// Probability of a mean weight that far from the integral.
    pub(crate) fn albedo_p(&self) -> f64 {
        let difference = self.mean.0 - self.albedo;
        // The quadrature itself is good to some 3e-4; without samples there is no other error.
        let slack = 3e-4 * self.albedo + 1e-7;
        two_sided((difference.abs() - slack).max(0.0) / self.mean.1.max(1e-9))
    }
}

/// Share of samples without a density that the quadrature cannot tell from none.
const BLUR: f64 = 3e-4;

/// Runs `effort` on a sampler seen from `wo`.
pub(crate) fn run(of: &dyn Scatterer, wo: Vec3, effort: Effort) -> Outcome {
    let mut random = Random::new(effort.seed);
    let mut pilot = directions(of, wo, effort.pilot, &mut random);
    let partition = Partition::new(&pilot, effort.grain());
    let density = partition.integrals(&|wi| f64::from(of.pdf(wo, wi)), 1.0);
    let mass: f64 = density.iter().sum();
    let mut tally = Tally::new(partition.len());
    for _ in 0..effort.samples {
        tally.add(of, wo, of.sample(wo, &mut random), &partition);
    }
    let n = f64::from(effort.samples);
    let mut expected: Vec<f64> = density.iter().map(|share| share * n).collect();
    // What has no density: absorbed, dropped, or in a lobe of a single direction.
    expected.push((1.0 - mass).max(0.0) * n);
    tally.counts.push(u64::from(effort.samples - tally.scattered));
    if expected.last().is_none_or(|e| *e < BLUR * n)
        && tally.counts.last().is_none_or(|c| *c as f64 <= BLUR * n)
    {
        expected.pop();
        tally.counts.pop();
    }
    // The value may peak where no sample goes: it is integrated over cells that are small around every peak there can be.
    pilot.extend(suspects(wo, effort.pilot / 8, &mut random));
    let fine = Partition::new(&pilot, effort.grain());
    let mean = tally.sum / n;
    let albedo = fine.integrals(&|wi| of.truth(wo, wi), mean.max(0.05)).iter().sum();
    let variance = (tally.squares / n - mean * mean).max(0.0);
    Outcome {
        verdict: chi2(&tally.counts, &expected),
        mass,
        single: f64::from(tally.single) / n,
        mean: (mean, (variance / n).sqrt()),
        albedo,
        largest: tally.largest,
        inconsistent: f64::from(tally.inconsistent) / n,
        broken: tally.broken,
    }
}

fn directions(of: &dyn Scatterer, wo: Vec3, count: u32, random: &mut Random) -> Vec<Vec3> {
    let samples = (0..count).filter_map(|_| of.sample(wo, random));
    samples.filter(|s| s.pdf.is_finite() && s.wi.is_finite()).map(|s| s.wi).collect()
}

/// Directions everywhere, and nearer and nearer to where a mirror or glass would send `wo`.
pub(crate) fn suspects(wo: Vec3, count: u32, random: &mut Random) -> Vec<Vec3> {
    let centers = [Vec3::new(-wo.x, -wo.y, wo.z), -wo];
    let refracted = [1.5, 1.0 / 1.5, 1.1, 1.0 / 1.1].map(|eta| bent(wo, eta));
    let centers: Vec<Vec3> = centers.into_iter().chain(refracted.into_iter().flatten()).collect();
    let mut all: Vec<Vec3> = (0..count).map(|_| random.direction()).collect();
    for center in centers {
        all.extend((0..count / 4).map(|_| {
            let distance = libm::exp2f(random.between(-14.0, 1.0));
            (center + random.direction() * distance).try_normalize().unwrap_or(center)
        }));
    }
    all
}

/// The direction into which a plane refracts `wo`.
pub(crate) fn bent(wo: Vec3, eta: f32) -> Option<Vec3> {
    let cos2 = 1.0 - (1.0 - wo.z * wo.z) / (eta * eta);
    (cos2 > 0.0).then(|| Vec3::new(-wo.x / eta, -wo.y / eta, -cos2.sqrt() * wo.z.signum()).normalize())
}

/// Sums over samples.
struct Tally {
    counts: Vec<u64>,
    scattered: u32,
    single: u32,
    sum: f64,
    squares: f64,
    largest: f64,
    inconsistent: u32,
    broken: u32,
}

impl Tally {
    fn new(cells: usize) -> Self {
        Self {
            counts: vec![0; cells],
            scattered: 0,
            single: 0,
            sum: 0.0,
            squares: 0.0,
            largest: 0.0,
            inconsistent: 0,
            broken: 0,
        }
    }

    fn add(&mut self, of: &dyn Scatterer, wo: Vec3, sample: Option<BsdfSample>, partition: &Partition) {
        let Some(BsdfSample { wi, weight, pdf, eta2 }) = sample else { return };
        let sound = wi.is_finite()
            && (wi.length() - 1.0).abs() < 1e-5
            && weight.is_finite()
            && weight.min_element() >= 0.0
            && eta2.is_finite()
            && pdf > 0.0;
        if !sound {
            self.broken += 1;
            return;
        }
        self.largest = self.largest.max(weight.max_element().into());
        if pdf.is_infinite() {
            self.single += 1;
            return;
        }
        self.scattered += 1;
        self.counts[partition.cell(wi)] += 1;
        let mean = f64::from(weight.element_sum()) / 3.0;
        self.sum += mean;
        self.squares += mean * mean;
        let again = of.pdf(wo, wi);
        let value = of.eval(wo, wi);
        if again <= 0.0 {
            self.broken += 1;
        }
        // The direction is rounded after the density was computed: a narrow lobe sees that.
        let near = |a: f32, b: f32| (a - b).abs() <= 0.01 * a.max(b) + 1e-6;
        if !near(again, pdf) || !near(value.element_sum(), weight.element_sum() * pdf) {
            self.inconsistent += 1;
        }
    }
}
