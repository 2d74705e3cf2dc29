//! Owns furnaces: under the same light from all sides a convex object shows its directional albedo and nothing else.

use super::albedos::albedo;
use super::chi2::{limit_of, sidak};
use super::materials::{sets, view};
use super::oracle::Disney;
use super::report::table;
use super::scenes::{Shot, Shown, mean_of};
use super::{FAMILY, fresh_seed};
use glam::DVec3;

/// Linear between evenly spaced values, those of the middles of equal parts of 0 to 1.
fn between(values: &[f64], at: f64) -> f64 {
    let at = (at * values.len() as f64 - 0.5).clamp(0.0, (values.len() - 1) as f64);
    let low = (at as usize).min(values.len() - 2);
    values[low] + (values[low + 1] - values[low]) * (at - low as f64)
}

/// Document member of a principled material.
pub(crate) fn material(p: &Disney) -> String {
    let Disney { base_color: [r, g, b], .. } = p;
    format!(
        r#"{{"type": "principled_bsdf", "base_color": [{r:?}, {g:?}, {b:?}], "specular_transmission": {:?}, "metallic": {:?},
        "subsurface": {:?}, "specular": {:?}, "roughness": {:?}, "specular_tint": {:?}, "anisotropic": {:?}, "sheen": {:?},
        "sheen_tint": {:?}, "clearcoat": {:?}, "clearcoat_gloss": {:?}, "eta": {:?}}}"#,
        p.specular_transmission,
        p.metallic,
        p.subsurface,
        p.specular,
        p.roughness,
        p.specular_tint,
        p.anisotropic,
        p.sheen,
        p.sheen_tint,
        p.clearcoat,
        p.clearcoat_gloss,
        p.eta
    )
}

/// A ball of radius 1 around the origin in a white sky.
pub(crate) fn ball(material: &str) -> String {
    format!(
        r#""materials": {{"m": {material}}}, "spheres": {{"ball": {{"center": [0, 0, 0], "radius": 1, "material": "m"}}}},
        "lights": {{"sky": {{"type": "environment", "radiance": [1, 1, 1]}}}}"#
    )
}

/// Every pixel sees the ball, from the middle to cosines of about 0.2.
pub(crate) fn close_up(spp: u32, seed: u32) -> Shot {
    Shot {
        spp,
        seed,
        vfov: 2.0 * libm::asin(1.0 / 3.0).to_degrees() * 0.66,
        ..Shot::from(DVec3::new(1.0, 2.0, 2.0))
    }
}

/// Cosine at the ball under a pixel.
fn cosine(shot: &Shot, pixel: u32) -> f64 {
    let (o, d) = (shot.eye, shot.ray(pixel));
    let b = o.dot(d);
    let t = -b - (b * b - o.dot(o) + 1.0).sqrt();
    assert!(t.is_finite(), "pixel {pixel} does not see the ball");
    -(o + d * t).dot(d)
}

/// Difference of a picture from what each pixel's cosine makes expected, in parts of the expectation, and its error.
fn difference(shot: &Shot, shown: &Shown, expected: &dyn Fn(f64) -> f64) -> (f64, f64) {
    let want: Vec<f64> = (0..shot.side * shot.side).map(|pixel| expected(cosine(shot, pixel))).collect();
    let want = want.iter().sum::<f64>() / want.len() as f64;
    (shown.mean / want - 1.0, shown.error / want)
}

/// Limits: as many standard errors as that many tests may be off by together, and 0.05 % for the quadrature between its
/// nodes.
fn judge(rows: &[(String, f64, f64)]) {
    let limit = limit_of(sidak(FAMILY, rows.len()));
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|(name, d, e)| vec![name.clone(), format!("{:+.3} %", d * 100.0), format!("{:.3} %", e * 100.0)])
        .collect();
    println!(
        "limit {limit:.1} standard errors: a bias of {:.2} % fails",
        100.0 * rows.iter().map(|r| r.2).fold(0.0, f64::max) * limit
    );
    println!("{}", table(&["material", "picture against quadrature", "±"], &cells));
    for (name, difference, error) in rows {
        assert!(*error < 2e-3, "{name}: no power: ± {error}");
        assert!(difference.abs() < limit * error + 5e-4, "{name}: {difference:+.5} ± {error:.5}");
    }
}

#[test]
fn opaque_balls_show_their_albedo() {
    let names = [
        "plain",
        "rough",
        "polished",
        "subsurface",
        "metal",
        "metal rough",
        "sheen",
        "clearcoat",
        "metal half",
        "tinted highlight",
    ];
    let opaque = sets().into_iter().filter(|(name, _)| names.contains(name));
    let rows: Vec<_> = opaque
        .enumerate()
        .map(|(at, (name, p))| {
            let shot = close_up(512, at as u32);
            let nodes: Vec<f64> = (0..16)
                .map(|i| albedo(&p, view(libm::acos((f64::from(i) + 0.5) / 16.0).to_degrees(), 0.4)))
                .collect();
            let (difference, error) =
                difference(&shot, &shot.take(&ball(&material(&p))), &|cos| between(&nodes, cos));
            (name.to_owned(), difference, error)
        })
        .collect();
    judge(&rows);
}

/// Nodes of the angle off the normal and of the angle between planes, for light that goes to and fro in a ball of glass.
const TILTS: usize = 96;
const ANGLES: u32 = 96;

/// Radiance that leaves a ball of glass in a white sky, by the angle at which it is seen, evenly from 0° to 90°.
///
/// A chord of a ball meets it at both ends under the same angle, so only angles off the normal matter: light inside solves
/// a linear equation over them, whose kernel is the oracle's glass integrated over the angle between the planes.
fn ball_of_glass(p: &Disney) -> Vec<f64> {
    let step = std::f64::consts::FRAC_PI_2 / TILTS as f64;
    let tilt = |i: usize| (i as f64 + 0.5) * step;
    let direction = |side: f64, tilt: f64, angle: f64| {
        let (sin, cos) = libm::sincos(tilt);
        [sin * libm::cos(angle), sin * libm::sin(angle), side * cos]
    };
    let flow = |from: f64, i: usize, to: f64, j: usize| {
        let sum: f64 = (0..ANGLES)
            .map(|a| {
                let angle = (f64::from(a) + 0.5) / f64::from(ANGLES) * std::f64::consts::PI;
                p.value(direction(from, tilt(i), 0.0), direction(to, tilt(j), angle))[0]
            })
            .sum();
        sum * 2.0 * std::f64::consts::PI / f64::from(ANGLES) * libm::sin(tilt(j)) * step
    };
    let rows = |from: f64, to: f64| -> Vec<Vec<f64>> {
        (0..TILTS).map(|i| (0..TILTS).map(|j| flow(from, i, to, j)).collect()).collect()
    };
    let (mirror, enter, leave, inside) = (rows(1.0, 1.0), rows(1.0, -1.0), rows(-1.0, 1.0), rows(-1.0, -1.0));
    let sums = |rows: &[Vec<f64>]| rows.iter().map(|row| row.iter().sum()).collect::<Vec<f64>>();
    let out = sums(&leave);
    let mut within = out.clone();
    for _ in 0..200 {
        within =
            (0..TILTS).map(|i| out[i] + (0..TILTS).map(|j| inside[i][j] * within[j]).sum::<f64>()).collect();
    }
    let mirrored = sums(&mirror);
    (0..TILTS).map(|i| mirrored[i] + (0..TILTS).map(|j| enter[i][j] * within[j]).sum::<f64>()).collect()
}

/// Radiance by the cosine at which a ball is seen.
type Expected<'a> = &'a dyn Fn(f64) -> f64;

/// Hard case 6 besides: the square of the index must stand in the roulette, or paths inside end too often.
#[test]
fn glass_balls_show_the_sky() {
    let glass = Disney { base_color: [1.0; 3], specular_transmission: 1.0, eta: 1.5, ..Disney::PLAIN };
    let rough = ball_of_glass(&Disney { roughness: 0.3, ..glass });
    let whole = |_: f64| 1.0;
    let lost = |cos: f64| between(&rough, libm::acos(cos) / std::f64::consts::FRAC_PI_2);
    println!(
        "of a ball of roughness 0.3 leaves {:.4} to {:.4} by quadrature",
        rough.iter().fold(9.0, |a: f64, b| a.min(*b)),
        rough.iter().fold(0.0, |a: f64, b| a.max(*b))
    );
    let cases: [(&str, String, Expected<'_>); 5] = [
        ("dielectric smooth", r#"{"type": "dielectric", "ior": 1.5}"#.to_owned(), &whole),
        ("disney_glass smooth", r#"{"type": "disney_glass", "roughness": 0}"#.to_owned(), &whole),
        ("principled glass smooth", material(&Disney { roughness: 0.0, ..glass }), &whole),
        ("disney_glass 0.3", r#"{"type": "disney_glass", "roughness": 0.3}"#.to_owned(), &lost),
        ("dielectric 0.09", r#"{"type": "dielectric", "ior": 1.5, "alpha": 0.09}"#.to_owned(), &lost),
    ];
    let rows: Vec<_> = cases
        .iter()
        .map(|(name, material, expected)| {
            let shot = close_up(1024, 9);
            let (difference, error) = difference(&shot, &shot.take(&ball(material)), expected);
            assert!(difference.abs() < 3e-3, "{name}: {difference:+.5} ± {error:.5}");
            ((*name).to_owned(), difference, error)
        })
        .collect();
    judge(&rows);
}

/// Light inside a diffuse shell of albedo ρ that shines with e settles at e / (1 − ρ).
#[test]
fn a_closed_room_settles() {
    for (reflectance, emission) in [(0.5, 0.5), (0.8, 0.2)] {
        let members = format!(
            r#""materials": {{"m": {{"type": "diffuse", "reflectance": [{reflectance}, {reflectance}, {reflectance}]}}}},
            "spheres": {{"wall": {{"center": [0, 0, 0], "radius": 2, "material": "m", "emission": [{emission}, {emission}, {emission}], "flip_normals": true}}}}"#
        );
        let shot = Shot { max_depth: 256, vfov: 60.0, ..Shot::from(DVec3::new(0.3, 0.1, 0.2)) };
        let Shown { mean, error, .. } = shot.take(&members);
        println!("albedo {reflectance}: {mean:.5} ± {error:.5}");
        assert!((mean - 1.0).abs() < 4.9 * error + 1e-4 && error < 2e-3, "{reflectance}: {mean} ± {error}");
    }
}

/// Pictures of few samples.
const FEW: u32 = 32;

/// More samples sharpen a picture and do not brighten it: sixty-four times the samples, other random numbers.
fn no_material_brightens(side: u32, seed: u32) {
    let rows: Vec<(String, f64, f64)> = sets()
        .iter()
        .zip(0_u32..)
        .map(|((name, p), at)| {
            let body = room(&material(p));
            let shot = |spp, seed| Shot { side, max_depth: 24, ..close_up(spp, seed) };
            // Pictures of so few pixels know little of their own error where one edge makes it all: it is taken from the
            // spread of many of them.
            let means: Vec<f64> =
                (0..FEW).map(|i| shot(64, seed.wrapping_add(1000 * at + i)).take(&body).mean).collect();
            let mean = means.iter().sum::<f64>() / f64::from(FEW);
            let spread = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
            let error = (spread / f64::from(FEW * (FEW - 1))).sqrt();
            let many = shot(4096, seed.wrapping_add(1000 * at + 999)).take(&body);
            ((*name).to_owned(), (mean - many.mean) / many.mean, libm::hypot(error, many.error) / many.mean)
        })
        .collect();
    // Student's distribution of 31 degrees of freedom has a tail that much wider.
    let limit = 1.25 * limit_of(sidak(FAMILY, rows.len()));
    let cells = |(name, d, e): &(String, f64, f64)| {
        vec![
            name.clone(),
            format!("{:+.2} %", d * 100.0),
            format!("{:.2} %", e * 100.0),
            format!("{:+.1}", d / e),
        ]
    };
    let cells: Vec<Vec<String>> = rows.iter().map(cells).collect();
    println!("64 against 4096 samples, limit {limit:.1} standard errors");
    println!("{}", table(&["material", "difference", "±", "in errors"], &cells));
    let beyond = rows.iter().filter(|(_, d, e)| d.abs() > 3.0 * e).count();
    println!("{beyond} of {} beyond 3 standard errors", rows.len());
    assert!(rows.iter().all(|(_, d, e)| d.abs() < limit * e), "brighter or darker with samples");
    assert!(beyond <= 1, "{beyond} beyond 3 standard errors");
}

#[test]
fn no_material_brightens_with_samples() {
    no_material_brightens(4, 0);
}

#[test]
#[ignore = "long: sixteen times the pixels, with fresh seeds"]
fn no_material_brightens_with_samples_under_fresh_seeds() {
    no_material_brightens(16, fresh_seed() as u32);
}

/// The ball on a floor, under a lamp and a dim sky: light by all ways.
fn room(material: &str) -> String {
    format!(
        r#""materials": {{"m": {material}, "gray": {{"type": "diffuse", "reflectance": [0.4, 0.4, 0.4]}}}},
        "spheres": {{"ball": {{"center": [0, 0, 0], "radius": 1, "material": "m"}},
        "floor": {{"center": [0, -101, 0], "radius": 100, "material": "gray"}},
        "lamp": {{"center": [-3, 4, 3], "radius": 0.8, "material": "gray", "emission": [5, 5, 5]}}}},
        "lights": {{"sky": {{"type": "environment", "radiance": [0.5, 0.6, 0.7]}}}}"#
    )
}

#[test]
fn the_camera_of_the_tests_is_that_of_the_renderer() {
    let shot = close_up(1, 1);
    let shown = shot.take(&ball(r#"{"type": "diffuse"}"#));
    for pixel in 0..shot.side * shot.side {
        let (o, d) = (shot.eye, shot.ray(pixel));
        let b = o.dot(d);
        let want = -b - (b * b - o.dot(o) + 1.0).sqrt();
        let got = f64::from(shown.picture.depth[pixel as usize]);
        assert!((got / want - 1.0).abs() < 0.1, "pixel {pixel}: depth {got}, expected {want}");
    }
    assert!((mean_of(&shown.picture.color) - 0.5).abs() < 0.02);
}
