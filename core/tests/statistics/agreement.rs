//! Owns the agreement of the renderer's Disney BSDF in f32 with the oracle in f64, and of the oracle with numpy's.

use super::materials::principled;
use super::oracle::{Disney, Triple};
use super::random::Random;
use super::report::table;
use super::trial::bent;
use glam::Vec3;
use karst_core::bsdf::Bsdf;

/// Values below this are compared in absolute terms, as shares of it: where lobes are a millionth of a diffuse surface's
/// value their tails decide nothing, and f32 keeps no relative precision of a sum of lobes of which one is this dark.
const FLOOR: f64 = 1e-6;

/// Comma-separated values: see its head.
const TABLE: &str = include_str!("oracle.csv");

fn direction(z: f64, angle: f64) -> Triple {
    let s = (1.0 - z * z).sqrt();
    let (sin, cos) = libm::sincos(angle);
    [s * cos, s * sin, z]
}

#[test]
fn the_oracle_is_that_of_numpy() {
    let mut rows = 0;
    let mut worst: f64 = 0.0;
    let mut lit = 0;
    for line in TABLE.lines().filter(|line| !line.starts_with('#')) {
        let v: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(v.len(), 22, "{line}");
        let p: Vec<f32> = v[..15].iter().map(|x| *x as f32).collect();
        let set = Disney {
            base_color: [p[0], p[1], p[2]],
            specular_transmission: p[3],
            metallic: p[4],
            subsurface: p[5],
            specular: p[6],
            roughness: p[7],
            specular_tint: p[8],
            anisotropic: p[9],
            sheen: p[10],
            sheen_tint: p[11],
            clearcoat: p[12],
            clearcoat_gloss: p[13],
            eta: p[14],
        };
        let got = set.value(direction(v[15], v[16]), direction(v[17], v[18]));
        for (got, want) in got.iter().zip(&v[19..]) {
            let error = (got - want).abs() / want.abs().max(1e-12);
            worst = worst.max(error);
            assert!(error < 1e-8, "{line}: {got}");
        }
        lit += usize::from(v[19] > 0.0);
        rows += 1;
    }
    println!("{rows} cases, {lit} of them not black, worst relative error {worst:.1e}");
    assert!(rows >= 300 && lit > rows / 2);
}

/// Parameters of which each is 0 or 1 as often as something between.
pub(crate) fn random_set(random: &mut Random, roughness: f32) -> Disney {
    let mut share = || {
        let x = random.unit();
        if x < 0.25 {
            0.0
        } else if x > 0.75 {
            1.0
        } else {
            2.0 * x - 0.5
        }
    };
    let mut set = Disney {
        base_color: [share(), share(), share()],
        specular_transmission: share(),
        metallic: share(),
        subsurface: share(),
        specular: share(),
        roughness,
        specular_tint: share(),
        anisotropic: share(),
        sheen: share(),
        sheen_tint: share(),
        clearcoat: share(),
        clearcoat_gloss: share(),
        eta: 1.0,
    };
    // One set in ten has the denser side outside.
    set.eta = random.between(1.05, 2.4);
    if random.chance(0.1) {
        set.eta = 1.0 / set.eta;
    }
    set
}

/// A direction from the material's own sampler where it has one to give: there the peaks are.
fn peak(bsdf: &Bsdf, wo: Vec3, random: &mut Random) -> Option<Vec3> {
    let lobe = random.unit();
    bsdf.sample(wo, lobe, random.pair()).filter(|s| s.pdf.is_finite()).map(|s| s.wi)
}

/// Relative errors of `count` random cases of half uniform directions, half peaks; with the worst case in words.
fn errors(count: u32, seed: u64, roughness: &dyn Fn(&mut Random) -> f32) -> (Vec<f64>, String) {
    let mut random = Random::new(seed);
    let mut all = Vec::new();
    let mut worst = (0.0, String::new());
    let mut peaks = 0;
    for case in 0..count {
        let roughness = roughness(&mut random);
        let set = random_set(&mut random, roughness);
        let bsdf = principled(&set);
        let wo = random.direction();
        let wi = if case % 2 == 0 { None } else { peak(&bsdf, wo, &mut random) };
        peaks += u32::from(wi.is_some());
        let wi = wi.unwrap_or_else(|| random.direction());
        let got = bsdf.eval(wo, wi);
        assert!(got.is_finite() && bsdf.pdf(wo, wi).is_finite(), "{set:?} {wo} {wi}: {got}");
        let want = set.value(wo.to_array().map(f64::from), wi.to_array().map(f64::from));
        let size = want.iter().fold(FLOOR, |most, x| most.max(x.abs()));
        let error = (0..3).map(|c| (f64::from(got[c]) - want[c]).abs() / size).fold(0.0, f64::max);
        if error > worst.0 {
            worst = (error, format!("{set:?} wo {wo:?} wi {wi:?}: {got:?} against {want:?}"));
        }
        all.push(error);
    }
    assert!(peaks > count / 4, "too few directions from the sampler: {peaks}");
    all.sort_by(f64::total_cmp);
    (all, worst.1)
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn a_hundred_thousand_random_materials_have_the_value_of_the_oracle() {
    let (sorted, worst) = errors(100_000, 272, &|random| random.between(0.05, 1.0));
    let (narrow, narrow_worst) = errors(20_000, 273, &|_| 0.02);
    let (sharp, _) = errors(20_000, 274, &|_| 0.05);
    let row = |name: &str, e: &[f64]| {
        let cells = [0.5, 0.9, 0.99, 0.999, 1.0].map(|share| format!("{:.1e}", quantile(e, share)));
        [vec![name.to_owned(), e.len().to_string()], cells.to_vec()].concat()
    };
    let rows =
        [row("roughness 0.05 to 1", &sorted), row("roughness 0.05", &sharp), row("roughness 0.02", &narrow)];
    println!(
        "relative error of eval() in f32, relative to max(|f|, {FLOOR:.0e}); half of wi from the sampler"
    );
    println!("{}", table(&["", "cases", "p50", "p90", "p99", "p99.9", "worst"], &rows));
    println!("worst: {worst}\nworst at roughness 0.02: {narrow_worst}");
    assert!(quantile(&sorted, 0.999) <= 1e-3, "p99.9 {:.2e}", quantile(&sorted, 0.999));
    assert!(quantile(&sharp, 0.999) <= 1e-3, "p99.9 at roughness 0.05 {:.2e}", quantile(&sharp, 0.999));
}

/// The comparison sees a lobe that is 1 % too bright, and one that lacks a term that only matters at grazing angles.
#[test]
fn the_comparison_finds_a_percent() {
    let mut random = Random::new(5);
    let (mut brighter, mut flatter) = (Vec::new(), Vec::new());
    for _ in 0..10_000 {
        let set = Disney { clearcoat: 1.0, ..random_set(&mut random, 0.3) };
        let (wo, wi) = (random.direction(), random.direction());
        let (wo, wi) = (wo.to_array().map(f64::from), wi.to_array().map(f64::from));
        let right = set.value(wo, wi);
        let size = right.iter().fold(FLOOR, |most, x| most.max(x.abs()));
        let against = |wrong: Disney| {
            (0..3).map(|c| (wrong.value(wo, wi)[c] - right[c]).abs() / size).fold(0.0, f64::max)
        };
        brighter.push(against(Disney { clearcoat: 1.01, ..set }));
        flatter.push(against(Disney { roughness: set.roughness * 1.01, ..set }));
    }
    for mut errors in [brighter, flatter] {
        errors.sort_by(f64::total_cmp);
        assert!(quantile(&errors, 0.999) > 1e-3, "{:.2e}", quantile(&errors, 0.999));
    }
}

/// f(o, i) / |cos i| is the same both ways; through an interface the squares of the indices stand beside it (Veach 1997,
/// section 5.2).
#[test]
fn light_goes_both_ways_alike() {
    let mut random = Random::new(31);
    let mut rows = Vec::new();
    for (name, low, limit) in
        [("roughness 0.3 to 1", 0.3, 1e-5), ("roughness 0.1 to 0.3", 0.1, f64::INFINITY)]
    {
        let (mut same, mut through) = (Vec::new(), Vec::new());
        for case in 0..40_000 {
            let roughness = if low < 0.3 { random.between(low, 0.3) } else { random.between(low, 1.0) };
            let mut set = random_set(&mut random, roughness);
            if case % 2 == 0 {
                set = Disney { specular_transmission: 1.0, metallic: 0.0, base_color: [0.9; 3], ..set };
            }
            let bsdf = principled(&set);
            let wo = random.direction();
            let anywhere = random.direction();
            let refracted = bent(wo, set.eta).filter(|_| case % 4 == 0);
            let wi = refracted.map_or(anywhere, |d| (d + anywhere * 0.2).normalize());
            // Inside there is glass alone: light that goes between lobes of the outside has both directions outside.
            let crosses = wo.z * wi.z < 0.0;
            let eta = if wo.z > 0.0 { f64::from(set.eta) } else { 1.0 / f64::from(set.eta) };
            let factor = if crosses { eta * eta } else { 1.0 };
            let there = f64::from(bsdf.eval(wo, wi).element_sum()) / f64::from(wi.z.abs()) * factor;
            let back = f64::from(bsdf.eval(wi, wo).element_sum()) / f64::from(wo.z.abs());
            if there.max(back) > 1e-4 {
                let error = (there - back).abs() / there.max(back);
                if crosses { through.push(error) } else { same.push(error) }
            }
        }
        for (side, mut errors) in [("reflection", same), ("refraction", through)] {
            assert!(errors.len() > 3000, "{name}, {side}: {}", errors.len());
            errors.sort_by(f64::total_cmp);
            let cells = [0.5, 0.99, 1.0].map(|share| format!("{:.1e}", quantile(&errors, share)));
            rows.push([vec![format!("{side}, {name}"), errors.len().to_string()], cells.to_vec()].concat());
            // A refraction through a facet that is seen from its edge, or near total reflection, has few digits left in f32:
            // it is dark, and an index on the wrong side would double the median.
            let worst = if side == "reflection" { quantile(&errors, 1.0) } else { quantile(&errors, 0.5) };
            assert!(worst <= limit, "{name}, {side}: {worst:.1e}");
            assert!(quantile(&errors, 0.99) <= 1e-3, "{name}, {side}: p99 {:.1e}", quantile(&errors, 0.99));
        }
    }
    println!(
        "relative difference of f / |cos| there and back\n{}",
        table(&["", "cases", "p50", "p99", "worst"], &rows)
    );
}
