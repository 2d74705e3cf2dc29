//! Owns the χ² test of every material's sampler, and its weights against the quadrature of its value.

use super::chi2::{detectable, limit_of, sidak};
use super::materials::{grid, views};
use super::report::table;
use super::trial::{Effort, Outcome, run};
use super::{FAMILY, fresh_seed};

/// One sampler from one side.
struct Row {
    name: String,
    degrees_off: f64,
    outcome: Outcome,
}

fn rows(effort: Effort) -> Vec<Row> {
    let cases = grid();
    let trials =
        cases.iter().enumerate().flat_map(|(at, case)| views().map(|(degrees, wo)| (at, case, degrees, wo)));
    trials
        .map(|(at, case, degrees_off, wo)| {
            let seed = effort.seed.wrapping_mul(0x1_0001).wrapping_add(at as u64 * 1009 + degrees_off as u64);
            Row { name: case.name.clone(), degrees_off, outcome: run(case, wo, Effort { seed, ..effort }) }
        })
        .collect()
}

fn judge(effort: Effort) {
    let rows = rows(effort);
    // Two tests of every row: directions and weights.
    let level = sidak(FAMILY, 2 * rows.len());
    let cells = rows.iter().map(|row| row.outcome.verdict.degrees).max().unwrap_or(1);
    let n = f64::from(effort.samples);
    println!(
        "{} samplers from {} sides, {} samples each; {} tests at level {level:.2e}: a false alarm in one of {:.0} runs",
        rows.len() / 4,
        4,
        effort.samples,
        2 * rows.len(),
        1.0 / FAMILY
    );
    println!(
        "power: a density wrong by ±{:.2} % over halves of the sphere's cells fails in one of two runs; a mean weight wrong by {:.1} standard errors",
        100.0 * detectable(level, cells, n),
        limit_of(level)
    );
    let shown: Vec<Vec<String>> = rows.iter().map(cells_of).collect();
    println!(
        "{}",
        table(
            &[
                "sampler",
                "wo",
                "cells",
                "p (χ²)",
                "∫ pdf",
                "single",
                "mean weight",
                "±",
                "∫ value",
                "p (mean)",
                "largest",
                "differ"
            ],
            &shown
        )
    );
    let mut wrong: Vec<String> = Vec::new();
    for Row { name, degrees_off, outcome } in &rows {
        let mut say = |what: String| wrong.push(format!("{name} at {degrees_off}°: {what}"));
        if outcome.verdict.p < level {
            say(format!("directions do not have the density that pdf() says, p = {:.1e}", outcome.verdict.p));
        }
        if outcome.albedo_p() < level {
            say(format!(
                "mean weight {:.5} ± {:.5}, value integrates to {:.5}",
                outcome.mean.0, outcome.mean.1, outcome.albedo
            ));
        }
        if outcome.mass > 1.003 {
            say(format!("density integrates to {:.4}", outcome.mass));
        }
        if outcome.broken > 0 {
            say(format!(
                "{} samples are not finite, not of unit length, or where pdf() is 0",
                outcome.broken
            ));
        }
        if outcome.inconsistent > 2e-3 {
            say(format!(
                "{:.2} % of the samples have another weight or density than eval() and pdf() say",
                100.0 * outcome.inconsistent
            ));
        }
    }
    assert!(wrong.is_empty(), "{} of {} failed\n{}", wrong.len(), rows.len(), wrong.join("\n"));
}

fn cells_of(Row { name, degrees_off, outcome: o }: &Row) -> Vec<String> {
    vec![
        name.clone(),
        format!("{degrees_off}°"),
        o.verdict.degrees.to_string(),
        format!("{:.3e}", o.verdict.p),
        format!("{:.4}", o.mass),
        format!("{:.4}", o.single),
        format!("{:.5}", o.mean.0),
        format!("{:.5}", o.mean.1),
        format!("{:.5}", o.albedo),
        format!("{:.2e}", o.albedo_p()),
        format!("{:.2}", o.largest),
        format!("{:.4}", o.inconsistent),
    ]
}

#[test]
fn every_sampler_has_the_density_and_the_weights_that_it_says() {
    judge(Effort::SHORT);
}

#[test]
#[ignore = "long: 32 times the samples with fresh seeds"]
fn every_sampler_has_the_density_and_the_weights_that_it_says_under_fresh_seeds() {
    judge(Effort { seed: fresh_seed(), ..Effort::LONG });
}
