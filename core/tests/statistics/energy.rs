//! Owns how much light materials send back: the model's own gain, reported, and that conserving models have none.

use super::albedos::albedo;
use super::materials::{parameters, sets, view};
use super::oracle::Disney;
use super::partition::{Grain, Partition};
use super::random::Random;
use super::report::table;
use super::scenes::Shot;
use super::trial::suspects;
use glam::{DVec3, Vec3};
use karst_core::bsdf::{Bsdf, Conserving, Principled};
use std::path::Path;
use std::sync::Arc;

const DEGREES: [f64; 5] = [0.0, 50.0, 75.0, 85.0, 88.0];

/// Flux by quadrature of the renderer's value: of red, which is the brightest channel of all sets, light from the other side without the factor of radiance.
fn flux(bsdf: &Bsdf, eta: f32, wo: Vec3) -> f64 {
    let mut random = Random::new(11);
    let mut points = suspects(wo, 1 << 10, &mut random);
    points.extend((0..1 << 12).filter_map(|_| {
        let lobe = random.unit();
        bsdf.sample(wo, lobe, random.pair()).map(|s| s.wi)
    }));
    let partition = Partition::new(&points, Grain { cell: points.len(), leaf: 16 });
    let other = f64::from(if wo.z > 0.0 { eta * eta } else { 1.0 / (eta * eta) });
    let value = |wi: Vec3| {
        let factor = if wi.z * wo.z < 0.0 { other } else { 1.0 };
        f64::from(bsdf.eval(wo, wi).x) * factor
    };
    partition.integrals(&value, 1.0).iter().sum()
}

/// The published model gains energy where base colours are near 1 or lobes add up: the figures are facts of the model,
/// known from its definition, and would change if a lobe were weighed otherwise.
#[test]
fn the_gain_of_the_model_is_what_its_equations_give() {
    let rows: Vec<(String, Vec<f64>)> = sets()
        .iter()
        .filter(|(_, p)| p.specular_transmission == 0.0)
        .map(|(name, p)| ((*name).to_owned(), DEGREES.map(|d| albedo(p, view(d, 0.4))).to_vec()))
        .collect();
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|(name, values)| {
            [vec![name.clone()], values.iter().map(|v| format!("{v:.4}")).collect()].concat()
        })
        .collect();
    let head: Vec<String> = DEGREES.iter().map(|d| format!("{d}°")).collect();
    let head: Vec<&str> = std::iter::once("albedo by quadrature of the oracle")
        .chain(head.iter().map(String::as_str))
        .collect();
    println!("{}", table(&head, &cells));
    let (name, most) = rows
        .iter()
        .map(|(name, v)| (name, v.iter().fold(0.0, |a: f64, b| a.max(*b))))
        .fold((&rows[0].0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    println!("greatest: {most:.4}, {name}");
    // White and rough: 1.036 from above (found with numpy beforehand).
    let rough = Disney { base_color: [1.0; 3], roughness: 1.0, specular: 0.0, ..Disney::PLAIN };
    let diffuse_alone = albedo(&rough, Vec3::Z);
    assert!((diffuse_alone - 1.036).abs() < 0.02, "{diffuse_alone}");
    assert!(most > 1.1 && most < 2.0, "{name}: {most}");
}

#[test]
fn conserving_models_of_varying_color_gain_nothing() {
    // The strongest tint is that of pure blue, which a table for white would not know.
    let board = r#"{"type": "checkerboard", "color0": [0, 0, 1], "color1": [1, 1, 1]}"#;
    let peak = |conserving: bool| {
        let members = format!(
            r#""materials": {{"m": {{"type": "principled_bsdf", "base_color": {board}, "sheen": 1, "sheen_tint": 1,
            "roughness": 0.5, "energy_conserving": {conserving}}}}}"#
        );
        let shot = Shot::from(DVec3::Z);
        shot.scene_in(Path::new("."), &members).albedo_peaks()[0].albedo
    };
    let (open, closed) = (peak(false), peak(true));
    assert!(open > 1.2, "nothing to prevent: {open}");
    assert!(closed <= 1.005, "{closed} of the light is sent back, {open} without");
}

#[test]
fn conserving_models_gain_nothing() {
    let mut all = sets();
    all.push((
        "white everything",
        Disney {
            base_color: [1.0; 3],
            sheen: 1.0,
            clearcoat: 1.0,
            roughness: 1.0,
            specular: 1.0,
            ..Disney::PLAIN
        },
    ));
    let mut rows = Vec::new();
    let mut gained: f64 = 0.0;
    for (name, p) in all {
        let open = Principled::new(&parameters(&p));
        let table = Arc::new(Conserving::new(std::slice::from_ref(&open)));
        let closed = Bsdf::Principled(open.clone().conserving(table));
        let open = Bsdf::Principled(open);
        // From both sides, and with an azimuth that the table was not made for.
        let views = DEGREES.iter().flat_map(|d| [view(*d, 0.5), -view(*d, 0.5)]);
        let (mut before, mut after) = (0.0_f64, 0.0_f64);
        for wo in views.filter(|wo| wo.z > 0.0 || open.transmits()) {
            let published = flux(&open, p.eta, wo);
            before = before.max(published);
            // Scaling never brightens.
            if published > 0.98 {
                after = after.max(flux(&closed, p.eta, wo));
            }
        }
        rows.push(vec![name.to_owned(), format!("{before:.4}"), format!("{after:.4}")]);
        gained = gained.max(before);
        assert!(after <= 1.0, "{name}: {after} (published {before}) of the light is sent back");
        assert!(before < 0.98 || after > 0.5, "{name}: conserving takes too much: {after}");
    }
    println!("{}", table(&["greatest share of the light sent back", "published", "conserving"], &rows));
    assert!(gained > 1.1, "no model gained energy: the test has nothing to test");
}
