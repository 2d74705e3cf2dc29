//! Noise against its bounds, and displacement against the sum without short cuts.

use glam::{DVec3, Vec3};

use super::{Random, tape};
use crate::sdf::noise::{Noise, gradient_noise};
use crate::sdf::{NoiseParameters, Point};

const NOISE: NoiseParameters =
    NoiseParameters { amplitude: 0.2, frequency: 2.0, octaves: 5, gain: 0.5, lacunarity: 2.0, seed: 3 };

fn octave(p: DVec3) -> f64 {
    gradient_noise(Point::new(p.x, p.y, p.z), 0x1234_5678)
}

#[test]
fn an_octave_stays_within_its_bounds_and_comes_close_to_them() {
    let mut random = Random(11);
    let (mut largest, mut steepest) = (0.0_f64, 0.0_f64);
    let h = 1e-4;
    for _ in 0..400_000 {
        let cell = Vec3::new(
            random.within(-500.0, 500.0),
            random.within(-500.0, 500.0),
            random.within(-500.0, 500.0),
        );
        // Close to the middle of a cell, where both are greatest.
        let off = Vec3::new(random.within(0.3, 0.7), random.within(0.3, 0.7), random.within(0.3, 0.7));
        let p = cell.floor().as_dvec3() + off.as_dvec3();
        let slope = |axis: DVec3| (octave(p + axis * h) - octave(p - axis * h)) / (2.0 * h);
        let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
        (largest, steepest) = (largest.max(octave(p).abs()), steepest.max(gradient.length()));
    }
    println!("largest {largest}, steepest {steepest}");
    assert!((0.85..1.0364).contains(&largest), "{largest}");
    assert!((2.8..3.75).contains(&steepest), "{steepest}");
}

#[test]
fn there_is_no_edge_between_cells() {
    let mut random = Random(12);
    for _ in 0..10_000 {
        let mut p = DVec3::from_array([0; 3].map(|_| f64::from(random.within(-9.0, 9.0))));
        let axis = (random.next() * 3.0) as usize;
        p[axis] = p[axis].floor();
        let step = DVec3::AXES[axis] * 1e-3;
        let (before, here, after) = (octave(p - step), octave(p), octave(p + step));
        assert!((after - here).abs() < 3.75e-3, "a jump at {p}");
        // A fold would be of the order of a step, a curve is of its square.
        assert!((after - 2.0 * here + before).abs() < 40e-6, "a fold at {p}");
    }
}

#[test]
fn bits_are_those_of_every_machine() {
    let mut random = Random(13);
    let noise = Noise::new(NOISE).expect("valid");
    let hash = (0..4000).fold(0xcbf2_9ce4_8422_2325_u64, |hash, _| {
        let p = Point::new(random.within(-40.0, 40.0), random.within(-4.0, 4.0), random.within(-0.4, 0.4));
        noise.octaves().fold(hash, |hash, octave| {
            let value: f32 = octave.at(p);
            (hash ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3)
        })
    });
    assert_eq!(hash, 0x7337_411b_76b4_f45d, "{hash:016x}");
}

/// The value of a displaced ball with every octave, and the sum itself.
fn with_every_octave(noise: &Noise, base: f64, p: DVec3) -> (f64, f64) {
    let (mut sum, mut slope) = (base, 1.0);
    let mut bound = f64::from(noise.bound());
    let (mut outside, mut inside) = (base - bound, base + bound);
    for octave in noise.octaves() {
        sum -= octave.at(Point::new(p.x, p.y, p.z));
        slope += f64::from(octave.slope);
        bound = f64::from(octave.rest);
        (outside, inside) = (outside.max((sum - bound) / slope), inside.min((sum + bound) / slope));
    }
    (if outside > 0.0 { outside } else { inside.min(0.0) }, sum)
}

#[test]
fn octaves_that_are_left_out_change_nothing() {
    let mut random = Random(14);
    for parameters in [
        NOISE,
        NoiseParameters { octaves: 1, ..NOISE },
        NoiseParameters { octaves: 12, lacunarity: 2.7, ..NOISE },
        NoiseParameters { gain: 1.0, amplitude: 0.02, ..NOISE },
        NoiseParameters { gain: 0.0, ..NOISE },
        NoiseParameters { amplitude: 0.0, ..NOISE },
    ] {
        let noise = Noise::new(parameters).expect("valid");
        let ball = tape(|t| {
            let ball = t.sphere(1.0);
            t.fbm_noise(ball, parameters)
        });
        for _ in 0..20_000 {
            let p = random.direction().as_dvec3() * f64::from(random.within(0.2, 1.8));
            let value: f64 = ball.distance(Point::new(p.x, p.y, p.z));
            let (expected, sum) = with_every_octave(&noise, p.length() - 1.0, p);
            // What is left of the amplitudes is rounded to f32.
            assert!(
                (value - expected).abs() <= 1e-7 * f64::from(noise.bound()),
                "{parameters:?} at {p}: {value}, expected {expected}"
            );
            // Inside and outside are where the sum says.
            if sum.abs() > 1e-6 {
                assert!(value * sum > 0.0, "{parameters:?} at {p}: {value} for {sum}");
            }
        }
    }
}
