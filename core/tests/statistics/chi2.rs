//! Owns the χ² test: how probable counts are under what is expected of them.

/// Fewest expected events of a cell; cells with less are put together (Cochran 1954).
const FEWEST: f64 = 5.0;

/// The outcome of a test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Verdict {
    /// Probability of counts at least as far from what is expected.
    pub(crate) p: f64,
    /// Degrees of freedom.
    pub(crate) degrees: usize,
}

/// Compares counts with expectations, cell by cell. A count where nothing at all is expected is impossible: p = 0.
pub(crate) fn chi2(observed: &[u64], expected: &[f64]) -> Verdict {
    let mut cells: Vec<(f64, f64)> =
        expected.iter().copied().zip(observed.iter().map(|o| *o as f64)).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    if cells.iter().any(|(e, o)| *e <= 0.0 && *o > 0.0) {
        return Verdict { p: 0.0, degrees: cells.len() };
    }
    let mut pooled: Vec<(f64, f64)> = Vec::new();
    for (e, o) in cells {
        match pooled.last_mut() {
            Some(last) if last.0 < FEWEST => *last = (last.0 + e, last.1 + o),
            _ => pooled.push((e, o)),
        }
    }
    let statistic: f64 = pooled.iter().filter(|c| c.0 > 0.0).map(|(e, o)| (o - e).powi(2) / e).sum();
    let degrees = pooled.len().saturating_sub(1);
    Verdict { p: if degrees == 0 { 1.0 } else { survival(statistic, degrees) }, degrees }
}

/// The level of one of `tests` tests at which all of them together alarm falsely with probability `family` (Šidák 1967).
pub(crate) fn sidak(family: f64, tests: usize) -> f64 {
    -libm::expm1(libm::log1p(-family) / tests as f64)
}

/// Probability that a χ² of so many degrees of freedom is larger.
pub(crate) fn survival(statistic: f64, degrees: usize) -> f64 {
    upper_gamma(0.5 * degrees as f64, 0.5 * statistic)
}

/// Probability that a normal number is farther from 0 on either side.
pub(crate) fn two_sided(z: f64) -> f64 {
    libm::erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// The distance from 0, in standard errors, that a normal number exceeds on either side with probability `level`.
pub(crate) fn limit_of(level: f64) -> f64 {
    bisect(0.0, 40.0, |z| two_sided(z) > level)
}

/// Relative error of a density that half of `n` samples' tests find: too large in half of the cells and too small in the
/// others by this much.
pub(crate) fn detectable(level: f64, degrees: usize, n: f64) -> f64 {
    let critical = bisect(0.0, 1e6, |x| survival(x, degrees) > level);
    ((critical - degrees as f64) / n).sqrt()
}

/// Where `above` ends to hold.
fn bisect(mut low: f64, mut high: f64, above: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if above(middle) { low = middle } else { high = middle }
    }
    low
}

/// The regularised incomplete gamma function Q(a, x): its series below a + 1, its continued fraction (Lentz) beyond.
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for i in 1..10_000 {
        let an = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        fraction *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

#[test]
fn probabilities_are_those_of_the_tables() {
    // Abramowitz and Stegun, table 26.8, and the exponential distribution, which has two degrees of freedom.
    for (x, degrees, p) in
        [(3.841_459, 1, 0.05), (18.307_04, 10, 0.05), (124.342_1, 100, 0.05), (149.449_3, 100, 0.001)]
    {
        assert!((survival(x, degrees) / p - 1.0).abs() < 1e-5, "{x} {degrees}: {}", survival(x, degrees));
    }
    assert!((survival(60.0, 2) / libm::exp(-30.0) - 1.0).abs() < 1e-9);
    assert!((two_sided(1.959_964) - 0.05).abs() < 1e-6 && (limit_of(0.05) - 1.959_964).abs() < 1e-6);
    assert!((sidak(1e-4, 1) - 1e-4).abs() < 1e-12 && (sidak(1e-4, 100) / 1.000_05e-6 - 1.0).abs() < 1e-4);
}

#[test]
fn counts_are_judged() {
    let fair = chi2(&[98, 103, 1, 2, 99], &[100.0, 100.0, 2.0, 1.0, 100.0]);
    assert!(fair.p > 0.5 && fair.degrees == 2, "{fair:?}");
    assert!(chi2(&[160, 40], &[100.0, 100.0]).p < 1e-15);
    assert_eq!(chi2(&[100, 1], &[100.0, 0.0]).p, 0.0, "where nothing is expected there is nothing");
}
