//! Statistics of the renderer against closed forms, quadrature and an independent model in f64.
//!
//! Every family of tests states the probability that it alarms falsely and what it would detect; seeds are fixed, so a
//! pass is a pass. The long form (`--ignored`) draws fresh seeds and prints them. Wrong samplers are kept as tests
//! (`mutants.rs`): the tests must see them.
#![allow(clippy::print_stdout, reason = "the tables are for whoever runs the tests with --nocapture")]

mod agreement;
mod albedos;
mod chi2;
mod energy;
mod furnace;
mod hard_cases;
mod hard_limits;
mod hard_scenes;
mod materials;
mod metamorphic;
mod mutants;
mod oracle;
mod pairs;
mod partition;
mod quadrature;
mod random;
mod report;
mod samplers;
mod scenes;
#[path = "../support/mod.rs"]
mod support;
mod trial;

/// Probability that a family of tests alarms although everything is right.
const FAMILY: f64 = 1e-4;

/// A seed of its own for every run, printed so that a failure can be had again by `KARST_SEED`.
fn fresh_seed() -> u64 {
    let given = std::env::var_os("KARST_SEED").and_then(|text| text.to_str()?.parse().ok());
    let seed = given.unwrap_or_else(|| std::hash::BuildHasher::hash_one(&std::hash::RandomState::new(), 0));
    println!("KARST_SEED={seed}");
    seed
}
