//! The choice among lights: probabilities, and sums over many lights.

use super::{facing_up, numbers, points, rectangle, scattered, triangle, vector_irradiance};
use crate::light::{
    EnvironmentLight, Light, Lights, PointLight, Receiver, Side, SphereLight, SpotFalloff, SpotLight,
    SunLight,
};
use crate::math::Aabb;
use glam::{DVec3, Vec2, Vec3};

/// One of each kind, all around the origin.
fn one_of_each() -> Vec<Light> {
    let falloff = SpotFalloff::Linear { beam_width: 30.0, cutoff_angle: 80.0 };
    vec![
        triangle([Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 2.0), Vec3::new(1.0, 1.0, 2.0)]),
        rectangle(Vec3::new(0.0, 0.0, 1.0), [Vec3::Y, Vec3::X]),
        Light::Sphere(SphereLight { center: -Vec3::X, radius: 0.9, radiance: Vec3::ONE }),
        Light::Unsampled(Vec3::ONE),
        Light::Point(PointLight { position: Vec3::Y, intensity: Vec3::ONE }),
        Light::Spotlight(SpotLight::new(Vec3::Z * 3.0, DVec3::NEG_Z, Vec3::ONE, falloff)),
        Light::Sun(SunLight::new(DVec3::NEG_Z, Vec3::ONE, 0.5)),
        Light::Environment(EnvironmentLight::constant(Vec3::ONE)),
    ]
}

/// Random small triangles, and here and there another light.
fn many(count: u32) -> Vec<(Light, Vec<Vec3>)> {
    let random: Vec<Vec3> = scattered(count * 3).collect();
    let light = |(i, at): (usize, &[Vec3])| {
        let center = at[0] + Vec3::Z * 1.5;
        let corners = vec![center, center + at[1] * 0.05, center + at[2] * 0.05];
        let intensity = Vec3::splat(at[1].x.abs() * 0.01);
        match i % 50 {
            7 => (Light::Point(PointLight { position: center, intensity }), Vec::new()),
            8 => {
                let falloff = SpotFalloff::Focus { focus: 4.0, cutoff_angle: 30.0 };
                (Light::Spotlight(SpotLight::new(center, at[2].as_dvec3(), intensity, falloff)), Vec::new())
            }
            _ => (triangle([corners[0], corners[1], corners[2]]), corners),
        }
    };
    random.chunks(3).enumerate().map(light).collect()
}

fn whole() -> Aabb {
    Aabb { min: Vec3::splat(-3.0), max: Vec3::splat(3.0) }
}

fn receivers() -> impl Iterator<Item = Receiver> {
    let around = scattered(60).zip(scattered(120).skip(60));
    around.map(|(p, n)| Receiver { p: p * 1.5, n: n.normalize() })
}

#[test]
fn few_lights_have_probabilities_that_sum_to_1() {
    let lights = one_of_each();
    let all = Lights::new(lights, &whole());
    for from in receivers().chain(receivers().map(|r| Receiver { n: Vec3::ZERO, ..r })) {
        let pdfs: Vec<f32> = (0..all.all().len()).map(|i| all.choice_pdf(&from, i)).collect();
        assert!((pdfs.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{pdfs:?}");
        assert_choices_follow(&all, &from, 1024);
    }
}

/// Every choice tells the probability that is told elsewhere, and is made as often as that.
fn assert_choices_follow(all: &Lights, from: &Receiver, n: u32) {
    let mut counts = vec![0.0; all.all().len()];
    for u in numbers(0, n) {
        if let Some((index, pdf)) = all.choose(from, u) {
            let want = all.choice_pdf(from, index);
            assert!((pdf / want - 1.0).abs() < 1e-5, "light {index} from {from:?}: {pdf}, told {want}");
            counts[index] += 1.0;
        }
    }
    for (index, count) in counts.iter().enumerate() {
        let want = f64::from(all.choice_pdf(from, index)) * f64::from(n);
        // A stratified number lies in an interval as often as its length says, but for its ends.
        assert!((count - want).abs() <= 2.01, "light {index} from {from:?}: {count}, expected {want}");
    }
}

#[test]
fn many_lights_are_chosen_as_often_as_is_told() {
    let mut lights: Vec<Light> = many(300).into_iter().map(|(light, _)| light).collect();
    for beside in [None, Some(Light::Sun(SunLight::new(DVec3::NEG_Z, Vec3::ONE, 0.5)))] {
        lights.extend(beside);
        let all = Lights::new(lights.clone(), &whole());
        for from in receivers() {
            let sum: f32 = (0..all.all().len()).map(|i| all.choice_pdf(&from, i)).sum();
            let none = numbers(1, 1024).filter(|u| all.choose(&from, *u).is_none()).count();
            assert!((sum + none as f32 / 1024.0 - 1.0).abs() < 0.02, "{sum} {none}");
            assert_choices_follow(&all, &from, 4096);
        }
    }
}

#[test]
fn kinds_are_chosen_from_as_often_as_is_told() {
    let mut lights: Vec<Light> = many(300).into_iter().map(|(light, _)| light).collect();
    lights.push(Light::Sun(SunLight::new(DVec3::NEG_Z, Vec3::splat(3.0), 0.5)));
    lights.push(Light::Environment(EnvironmentLight::constant(Vec3::splat(0.1))));
    for lights in [one_of_each(), lights] {
        let all = Lights::new(lights, &whole());
        assert!(all.has_both_sides());
        for from in receivers().chain(receivers().map(|r| Receiver { n: Vec3::ZERO, ..r })) {
            assert_kinds_follow(&all, &from, 4096);
        }
    }
}

/// The same of choices among lights of a kind.
fn assert_kinds_follow(all: &Lights, from: &Receiver, n: u32) {
    let mut counts = vec![0.0; all.all().len()];
    for side in [Side::Near, Side::Infinite] {
        for (light, pdf) in numbers(0, n).filter_map(|u| all.choose_of(side, from, u)) {
            assert_eq!(Side::of(&all.all()[light]), side);
            let told = all.choice_of_pdf(from, light);
            assert!((pdf / told - 1.0).abs() < 1e-4, "light {light}: {pdf}, told {told}");
            counts[light] += 1.0;
        }
    }
    for (light, count) in counts.into_iter().enumerate() {
        let expected = f64::from(all.choice_of_pdf(from, light)) * f64::from(n);
        assert!((count - expected).abs() <= 2.1, "light {light}: {count}, expected {expected}");
    }
}

/// Irradiance of a receiver by one light: closed forms for triangles above the horizon, else sampled.
fn irradiance(light: &Light, corners: &[Vec3], from: &Receiver) -> f64 {
    let above = corners.iter().all(|c| (*c - from.p).dot(from.n) > 0.0);
    if above && !corners.is_empty() {
        let vector = vector_irradiance(corners, from.p);
        let front = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(from.p - corners[0]) > 0.0;
        return if front { vector.dot(from.n.as_dvec3()) } else { 0.0 };
    }
    let n = if corners.is_empty() { 1 } else { 256 };
    let samples = points(0, n).filter_map(|u| light.sample(from, u));
    samples.map(|s| f64::from(s.radiance.x * s.wi.dot(from.n).max(0.0) / s.pdf)).sum::<f64>() / f64::from(n)
}

#[test]
fn a_thousand_lights_by_the_tree_bring_the_sum_of_them() {
    let lights = many(1000);
    let all = Lights::new(lights.iter().map(|(light, _)| light.clone()).collect(), &whole());
    // On the ground below all lights, and among them.
    for (p, n) in [(Vec3::ZERO, 1 << 14), (Vec3::new(0.5, -0.2, 1.3), 1 << 16)] {
        let from = facing_up(p);
        let each: Vec<f64> = lights.iter().map(|(light, c)| irradiance(light, c, &from)).collect();
        let want: f64 = each.iter().sum();
        let chosen = numbers(0, n).filter_map(|u| all.choose(&from, u));
        let found = chosen.map(|(i, pdf)| each[i] / f64::from(pdf)).sum::<f64>() / f64::from(n);
        assert!((found / want - 1.0).abs() < 0.01, "{p}: {found}, expected {want}");
        // And light that is never chosen is light that is not there.
        let missed: f64 = (0..each.len()).filter(|&i| all.choice_pdf(&from, i) == 0.0).map(|i| each[i]).sum();
        assert!(missed <= 1e-6 * want, "{p}: {missed} of {want}");
    }
}

#[test]
fn what_brings_light_has_weight() {
    let lights = many(200);
    let few = lights.chunks(40).map(|few| few.iter().map(|(l, _)| l.clone()).collect());
    for lights in few.chain([one_of_each()]) {
        let all = Lights::new(lights, &whole());
        for from in receivers() {
            for (index, light) in all.all().iter().enumerate() {
                let brings = points(0, 32)
                    .filter_map(|u| light.sample(&from, u))
                    .any(|s| s.wi.dot(from.n) > 1e-4 && s.radiance.x > 0.0);
                assert!(!brings || all.choice_pdf(&from, index) > 0.0, "{light:?} from {from:?}");
            }
        }
    }
}

#[test]
fn lights_without_power_are_never_chosen() {
    let dark = || Light::Point(PointLight { position: Vec3::Z, intensity: Vec3::ZERO });
    let shines = Light::Point(PointLight { position: Vec3::Z, intensity: Vec3::ONE });
    for count in [0, 1, 64, 65, 200] {
        let mut lights: Vec<Light> = (0..count).map(|_| dark()).collect();
        let from = facing_up(Vec3::ZERO);
        let all = Lights::new(lights.clone(), &Aabb::EMPTY);
        assert_eq!(all.choose(&from, 0.3), None);
        assert!((0..count).all(|i| all.choice_pdf(&from, i) == 0.0));
        lights.push(shines.clone());
        let all = Lights::new(lights, &Aabb::EMPTY);
        assert_eq!(all.choose(&from, 0.3), Some((count, 1.0)));
    }
}

#[test]
fn lights_in_one_place_or_at_the_receiver_are_no_trouble() {
    let light = |p: Vec3| Light::Point(PointLight { position: p, intensity: Vec3::ONE });
    let far = f32::MAX * 0.5;
    for lights in [
        vec![light(Vec3::Z); 500],
        (0..500).map(|i| light(Vec3::X * 2.0_f32.powi(i / 4 - 60))).collect(),
        (0..500).map(|i| light(Vec3::Z * if i % 2 == 0 { far } else { -far })).collect::<Vec<_>>(),
    ] {
        let all = Lights::new(lights, &Aabb::EMPTY);
        for p in [Vec3::Z, Vec3::ZERO, Vec3::X, Vec3::splat(far)] {
            let from = Receiver { p, n: Vec3::ZERO };
            for u in numbers(0, 64) {
                let Some((index, pdf)) = all.choose(&from, u) else { continue };
                assert!(pdf > 0.0 && pdf <= 1.0 && (all.choice_pdf(&from, index) / pdf - 1.0).abs() < 1e-5);
                let sample = all.all()[index].sample(&from, Vec2::splat(0.5));
                assert!(sample.is_none_or(|s| s.radiance.is_finite()));
            }
        }
    }
    // 500 lights in one place are equally likely.
    let all = Lights::new(vec![light(Vec3::Z); 512], &Aabb::EMPTY);
    assert_eq!(all.choice_pdf(&facing_up(Vec3::ZERO), 77), 1.0 / 512.0);
}
