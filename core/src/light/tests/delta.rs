//! Lights that are points, and the sun.

use super::{facing_up, points};
use crate::light::{Light, LightSample, Lights, PointLight, SpotFalloff, SpotLight, SunLight, Target};
use crate::math::Aabb;
use crate::warp::sphere_uniform;
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::PI;

fn spot(falloff: SpotFalloff) -> SpotLight {
    SpotLight::new(Vec3::ZERO, DVec3::new(0.0, 0.0, -2.0), Vec3::splat(3.0), falloff)
}

/// What a light at the origin brings at distance 1 in a direction.
fn brings(light: &Light, direction: Vec3) -> f32 {
    light.sample(&facing_up(direction), Vec2::ZERO).map_or(0.0, |s| s.radiance.x)
}

const FALLOFFS: [SpotFalloff; 9] = [
    SpotFalloff::Focus { focus: 1.0, cutoff_angle: 90.0 },
    SpotFalloff::Focus { focus: 3.0, cutoff_angle: 20.0 },
    SpotFalloff::Focus { focus: 0.0, cutoff_angle: 60.0 },
    SpotFalloff::Linear { beam_width: 15.0, cutoff_angle: 20.0 },
    SpotFalloff::Linear { beam_width: 0.0, cutoff_angle: 170.0 },
    SpotFalloff::Linear { beam_width: 30.0, cutoff_angle: 30.0 },
    SpotFalloff::Blend { cone_angle: 75.0, blend: 0.15 },
    SpotFalloff::Blend { cone_angle: 180.0, blend: 1.0 },
    SpotFalloff::Blend { cone_angle: 40.0, blend: 0.0 },
];

#[test]
fn the_power_of_a_spotlight_is_its_closed_form() {
    for falloff in FALLOFFS {
        let light = Light::Spotlight(spot(falloff));
        let n = 1 << 16;
        let mean: f64 =
            points(0, n).map(|u| f64::from(brings(&light, sphere_uniform(u)))).sum::<f64>() / f64::from(n);
        let (power, want) = (mean as f32 * 4.0 * PI, spot(falloff).power().x);
        assert!((power / want - 1.0).abs() < 1e-3, "{falloff:?}: {power}, expected {want}");
    }
}

/// A direction at an angle off −z, in degrees.
fn off_axis(degrees: f64) -> Vec3 {
    let (sin, cos) = libm::sincos(degrees.to_radians());
    DVec3::new(sin * 0.6, sin * 0.8, -cos).as_vec3()
}

#[test]
fn falloffs_are_as_documented() {
    let cos = |degrees: f64| libm::cos(degrees.to_radians());
    // Smoothstep at the middle of its range is a half.
    let half = libm::acos(1.0 - (1.0 - cos(20.0)) * 0.75).to_degrees();
    for (falloff, degrees, want) in [
        (SpotFalloff::Focus { focus: 2.0, cutoff_angle: 90.0 }, 30.0, cos(30.0).powi(4)),
        (SpotFalloff::Focus { focus: 2.0, cutoff_angle: 90.0 }, 90.1, 0.0),
        (SpotFalloff::Focus { focus: 2.0, cutoff_angle: 30.0 }, 30.1, 0.0),
        (SpotFalloff::Focus { focus: 1000.0, cutoff_angle: 90.0 }, 0.05, libm::pow(cos(0.05), 1e6)),
        (SpotFalloff::Linear { beam_width: 10.0, cutoff_angle: 20.0 }, 9.9, 1.0),
        (SpotFalloff::Linear { beam_width: 10.0, cutoff_angle: 20.0 }, 12.5, 0.75),
        (SpotFalloff::Linear { beam_width: 10.0, cutoff_angle: 20.0 }, 20.1, 0.0),
        (SpotFalloff::Linear { beam_width: 0.0, cutoff_angle: 0.1 }, 0.05, 0.5),
        (SpotFalloff::Blend { cone_angle: 40.0, blend: 0.5 }, 0.0, 1.0),
        (SpotFalloff::Blend { cone_angle: 40.0, blend: 0.5 }, half, 0.5),
        (SpotFalloff::Blend { cone_angle: 40.0, blend: 0.5 }, 20.1, 0.0),
        (SpotFalloff::Blend { cone_angle: 40.0, blend: 0.0 }, 19.9, 1.0),
    ] {
        let found = brings(&Light::Spotlight(spot(falloff)), off_axis(degrees)) / 3.0;
        assert!((f64::from(found) - want).abs() < 1e-3, "{falloff:?} at {degrees}: {found}, expected {want}");
    }
}

#[test]
fn points_bring_intensity_over_squared_distance() {
    let position = Vec3::new(1.0, 2.0, 3.0);
    let light = Light::Point(PointLight { position, intensity: Vec3::new(1.0, 2.0, 4.0) });
    let from = facing_up(Vec3::new(1.0, 2.0, 1.0));
    let want = LightSample {
        wi: Vec3::Z,
        radiance: Vec3::new(0.25, 0.5, 1.0),
        pdf: 1.0,
        delta: true,
        target: Target::Point(position, Vec3::ZERO, -Vec3::Z),
    };
    assert_eq!(light.sample(&from, Vec2::ZERO), Some(want));
    let near = light.sample(&facing_up(position - Vec3::Z * 1e-4), Vec2::ZERO).unwrap();
    assert!(near.radiance.is_finite() && near.radiance.x > 9e7, "{near:?}");
    assert_eq!(light.sample(&facing_up(position), Vec2::ZERO), None);
}

#[test]
fn a_sun_of_any_size_brings_its_irradiance() {
    let irradiance = Vec3::new(1.0, 2.0, 3.0);
    for size in [1e-3, 0.533, 30.0, 179.0] {
        let sun = Light::Sun(SunLight::new(DVec3::new(0.0, 0.0, -5.0), irradiance, size));
        let all = Lights::new(vec![sun.clone()], &Aabb::EMPTY);
        let n = 4096;
        let mut sum = Vec3::ZERO;
        let mut found = 0;
        for s in points(0, n).filter_map(|u| sun.sample(&facing_up(Vec3::ZERO), u)) {
            sum += s.radiance * (s.wi.z.max(0.0) / s.pdf / n as f32);
            // All but those at the very edge.
            found += all.infinite(s.wi).filter(|&(i, l, p)| (i, l, p) == (0, s.radiance, s.pdf)).count();
        }
        assert!((sum / irradiance - 1.0).abs().max_element() < 1e-3, "{size}: {sum}");
        assert!(found as u32 > n - 40, "{size}: {found} of {n}");
        assert_eq!(all.infinite(off_axis(181.0 - f64::from(size) * 0.5)).count(), usize::from(size > 2.0));
        assert_eq!(all.infinite(off_axis(179.0 - f64::from(size) * 0.5)).count(), 0);
    }
}

#[test]
fn a_sun_without_size_is_one_direction() {
    let sun = Light::Sun(SunLight::new(DVec3::new(0.0, -1e-9, 0.0), Vec3::ONE, 0.0));
    let s = sun.sample(&facing_up(Vec3::ZERO), Vec2::splat(0.3)).unwrap();
    assert_eq!((s.wi, s.radiance, s.pdf, s.delta), (Vec3::Y, Vec3::ONE, 1.0, true));
    assert_eq!(Lights::new(vec![sun], &Aabb::EMPTY).infinite(Vec3::Y).count(), 0);
}

#[test]
fn a_sun_that_sets_is_still_chosen() {
    for (below, chosen) in [(-0.2, true), (0.0, true), (0.2, true), (0.3, false)] {
        // Half a degree across, its centre below the horizon by so many degrees.
        let (sin, cos) = libm::sincos(f64::to_radians(below));
        let sun = Light::Sun(SunLight::new(DVec3::new(-cos, 0.0, sin), Vec3::ONE, 0.5));
        let all = Lights::new(vec![sun], &Aabb::EMPTY);
        assert_eq!(all.choose(&facing_up(Vec3::ZERO), 0.5).is_some(), chosen, "{below}");
    }
}
