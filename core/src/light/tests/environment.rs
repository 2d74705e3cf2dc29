//! Environments: directions, densities, and what they bring.

use super::{facing_up, points};
use crate::color::luminance;
use crate::light::{EnvironmentLight, Light, Lights};
use crate::math::Aabb;
use crate::texture::Image;
use crate::warp::{hemisphere_cosine, hemisphere_cosine_pdf};
use glam::{DMat3, DVec3, Vec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// A grey float image (Radiance HDR) of powers of two times 1/256 to 255/256, or 0.
fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> f32) -> Arc<Image> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let value = texel(x, y);
        let exponent = (0..60).find(|e| value < 2.0_f32.powi(e - 20)).unwrap() - 20;
        let mantissa = (value / 2.0_f32.powi(exponent) * 256.0) as u8;
        let exponent = if value > 0.0 { (exponent + 128) as u8 } else { 0 };
        bytes.extend([mantissa, mantissa, mantissa, exponent]);
    }
    Arc::new(Image::read(&bytes, 1 << 24).unwrap())
}

fn lights(image: Arc<Image>, to_world: DMat3) -> Lights {
    let light = EnvironmentLight::image(Vec3::ONE, image, to_world, false);
    Lights::new(vec![Light::Environment(light)], &Aabb::EMPTY)
}

/// An image with a gradient, a bright texel, a bright upper and a black lower edge, and black stretches.
fn lively(bright: f32) -> Arc<Image> {
    image(16, 8, |x, y| match (x, y) {
        (11, 2) => bright,
        (0, 5) => 4.0,
        (_, 0) => 1.5,
        (_, 7) | (3..6, _) => 0.0,
        _ => (x + 1) as f32 / 16.0,
    })
}

/// Directions on a fine grid of longitude and latitude, each with its solid angle.
fn grid(rows: u32) -> impl Iterator<Item = (Vec3, f64)> {
    let step = PI / f64::from(rows);
    (0..rows).flat_map(move |j| {
        let (sin, cos) = libm::sincos((f64::from(j) + 0.5) * step);
        // Not along the edges of texels.
        (0..2 * rows).map(move |i| {
            let (s, c) = libm::sincos((f64::from(i) + 0.51) * step);
            (DVec3::new(sin * s, cos, -sin * c).as_vec3(), sin * step * 2.0 * libm::sin(step * 0.5))
        })
    })
}

/// Radiance and density along a direction; 0 where it is black.
fn seen(all: &Lights, d: Vec3) -> (Vec3, f32) {
    all.infinite(d).map(|(_, radiance, pdf)| (radiance, pdf)).next().unwrap_or_default()
}

#[test]
fn texels_are_where_the_documentation_says() {
    let turn = DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y);
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let stretched = DMat3::from_rotation_x(1.0) * DMat3::from_diagonal(DVec3::new(3.0, 2.0, 5.0));
    for to_world in [DMat3::IDENTITY, turn, mirror, stretched] {
        for (x, y, direction) in [
            // The middle of the image, rounded up and down: +z.
            (8, 4, DVec3::Z),
            (7, 3, DVec3::Z),
            // A quarter from the left: +x; from the right: -x.
            (4, 4, DVec3::X),
            (12, 4, DVec3::NEG_X),
            (0, 4, DVec3::NEG_Z),
            (15, 3, DVec3::NEG_Z),
            (2, 0, DVec3::Y),
            (2, 7, DVec3::NEG_Y),
        ] {
            let all = lights(image(16, 8, |i, j| if (i, j) == (x, y) { 32.0 } else { 0.0 }), to_world);
            // Half a texel off, which is 11 degrees, towards both sides.
            let towards = (to_world * direction).normalize();
            let samples: Vec<_> =
                points(0, 64).filter_map(|u| all.all()[0].sample(&facing_up(Vec3::ZERO), u)).collect();
            // The outer halves of its neighbours are black.
            assert!(samples.len() > 32, "{x} {y}: {}", samples.len());
            let mean = samples.iter().map(|s| s.wi.as_dvec3()).sum::<DVec3>().normalize();
            assert!(mean.dot(towards) > 0.95, "({x}, {y}): {mean}, expected {towards}");
        }
    }
}

#[test]
fn texel_centres_lie_at_half_integers() {
    let all = lights(lively(32.0), DMat3::IDENTITY);
    let at = |x: f64, y: f64| {
        let (sin, cos) = libm::sincos(y / 8.0 * PI);
        let (s, c) = libm::sincos(x / 16.0 * TAU);
        seen(&all, DVec3::new(sin * s, cos, -sin * c).as_vec3()).0.x
    };
    for (x, y, want) in [
        (11.5, 2.5, 32.0),
        (12.5, 2.5, 13.0 / 16.0),
        (12.0, 2.5, f32::midpoint(32.0, 13.0 / 16.0)),
        // Around the back, and on to the pole.
        (0.0, 4.5, f32::midpoint(1.0 / 16.0, 1.0)),
        (8.0, 0.1, 1.5),
        (8.0, 7.9, 0.0),
    ] {
        assert!((at(x, y) - want).abs() < 1e-3, "({x}, {y}): {}, expected {want}", at(x, y));
    }
}

#[test]
fn densities_integrate_to_1() {
    let even = image(16, 8, |_, _| 0.5);
    let narrow = image(1, 1, |_, _| 2.0);
    for image in [lively(4.0), lively(1e6), even, narrow, image(5, 3, |x, y| (x * y) as f32)] {
        let all = lights(image, DMat3::from_rotation_y(0.3));
        let sum: f64 = grid(480).map(|(d, angle)| f64::from(seen(&all, d).1) * angle).sum();
        // Where the image is black there is no light, and no density is told.
        assert!((sum - 1.0).abs() < 2e-3, "{sum}");
    }
}

#[test]
fn samples_fall_by_their_density() {
    let all = lights(lively(4.0), DMat3::IDENTITY);
    let (columns, rows, n) = (32_u32, 16_u32, 1 << 16);
    let cell = |d: Vec3| {
        let u = (f64::from(libm::atan2f(d.x, -d.z)) / TAU + 1.0).fract();
        let v = libm::acos(f64::from(d.y)) / PI;
        (v * f64::from(rows)) as usize * columns as usize + (u * f64::from(columns)) as usize
    };
    let (mut counts, mut on_edges) = (vec![0.0; (columns * rows) as usize], 0);
    for s in points(0, n).filter_map(|u| all.all()[0].sample(&facing_up(Vec3::ZERO), u)) {
        let (radiance, pdf) = seen(&all, s.wi);
        assert!((radiance - s.radiance).abs().max_element() < 1e-5, "{radiance}, {}", s.radiance);
        // On the edge of a cell rounding may see the other side.
        on_edges += usize::from((pdf - s.pdf).abs() > 1e-6 * s.pdf);
        counts[cell(s.wi)] += 1.0;
    }
    assert!(on_edges < 4, "{on_edges}");
    let mut wants = vec![0.0; counts.len()];
    for (d, angle) in grid(480) {
        wants[cell(d)] += f64::from(seen(&all, d).1) * angle * f64::from(n);
    }
    for (index, (count, want)) in counts.iter().zip(&wants).enumerate() {
        // Sobol points are evener than chance.
        assert!((count - want).abs() < 3.0 * want.sqrt() + 3.0, "cell {index}: {count}, expected {want}");
    }
    assert!(wants.iter().filter(|w| **w == 0.0).count() > 100, "the dim part is not sampled");
}

/// Irradiance by sampling the light and by scattering evenly, weighed as the integrator does.
fn irradiance(all: &Lights, n: u32) -> f64 {
    let heuristic = |this: f32, other: f32| this * this / (this * this + other * other);
    let from = facing_up(Vec3::ZERO);
    let by_light = points(0, n).filter_map(|u| all.all()[0].sample(&from, u)).map(|s| {
        let cosine = hemisphere_cosine_pdf(s.wi.z);
        luminance(s.radiance) * s.wi.z.max(0.0) / s.pdf * heuristic(s.pdf, cosine)
    });
    let by_scattering = points(1, n).map(|u| {
        let wi = hemisphere_cosine(u);
        let (radiance, pdf) = seen(all, wi);
        luminance(radiance) * std::f32::consts::PI * heuristic(hemisphere_cosine_pdf(wi.z), pdf)
    });
    by_light.chain(by_scattering).map(f64::from).sum::<f64>() / f64::from(n)
}

#[test]
fn irradiance_equals_quadrature_even_with_a_texel_that_outshines_all() {
    // Turned so that the bright texel is above the horizon.
    let to_world = DMat3::from_rotation_y(2.0);
    for (bright, samples) in [(1.0, 1 << 12), (32.0, 1 << 12), (1e6, 1 << 12)] {
        let all = lights(lively(bright), to_world);
        let want: f64 =
            grid(480).map(|(d, angle)| f64::from(luminance(seen(&all, d).0) * d.z.max(0.0)) * angle).sum();
        let found = irradiance(&all, samples);
        assert!(want > 0.5 && (found / want - 1.0).abs() < 0.005, "{bright}: {found}, expected {want}");
    }
}

#[test]
fn a_constant_environment_brings_pi() {
    let light = EnvironmentLight::constant(Vec3::ONE);
    let all = Lights::new(vec![Light::Environment(light)], &Aabb::EMPTY);
    assert!((irradiance(&all, 1 << 12) / PI - 1.0).abs() < 1e-3);
}

#[test]
fn black_environments_are_no_trouble() {
    let black = image(4, 2, |_, _| 0.0);
    let dark = [
        EnvironmentLight::image(Vec3::ONE, black.clone(), DMat3::IDENTITY, false),
        EnvironmentLight::image(Vec3::ZERO, lively(4.0), DMat3::ZERO, false),
        EnvironmentLight::constant(Vec3::ZERO),
    ];
    for light in dark {
        let all = Lights::new(vec![Light::Environment(light)], &Aabb::EMPTY);
        let from = facing_up(Vec3::ZERO);
        assert_eq!(all.choose(&from, 0.5), None);
        assert_eq!(all.choice_pdf(&from, 0), 0.0);
        assert_eq!(all.infinite(Vec3::X).count(), 0);
        assert!(points(0, 16).all(|u| all.all()[0].sample(&from, u).is_none()));
    }
}

#[test]
fn large_images_share_cells() {
    let all = lights(image(4097, 3, |x, y| if (x, y) == (4096, 1) { 1000.0 } else { 0.25 }), DMat3::IDENTITY);
    let (mut near, mut sum) = (0, 0.0);
    for s in points(0, 1024).filter_map(|u| all.all()[0].sample(&facing_up(Vec3::ZERO), u)) {
        near += usize::from(s.radiance.x > 1.0);
        sum += 1.0 / f64::from(s.pdf);
    }
    assert!(near > 300, "{near}");
    assert!(sum.is_finite());
}
