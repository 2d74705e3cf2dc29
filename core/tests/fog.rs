//! Fog against what is known of it: transmittance, single scattering by quadrature in f64, furnaces, limits, and ways of
//! finding light that must agree.
#![allow(clippy::print_stdout, reason = "figures beside their expectations are what these tests are run for")]

mod support;

use glam::{DVec3, Vec3};
use karst_core::film::Film;
use karst_core::scene::{Assets, Document, Folder, Limits, Scene, Strategy};
use std::f64::consts::PI;
use std::path::Path;
use support::{render, scene};

/// A document of a camera at the origin that looks along −z through so narrow a lens that all of its rays are one.
fn looking(spp: u32, depth: u32, members: &str) -> String {
    format!(
        r#"{{"version": 1, "camera": {{"type": "perspective", "vfov": 0.001}},
            "film": {{"width": 16, "height": 16}}, "sampling": {{"spp": {spp}}},
            "integrator": {{"max_depth": {depth}, "roulette_depth": {depth}}},
            "materials": {{"black": {{"type": "diffuse", "reflectance": [0, 0, 0]}},
                           "grey": {{"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}}, "nothing": {{"type": "null"}}}},
            {members}}}"#
    )
}

/// A black wall across the view, 4 away.
const WALL: &str = r#""sdf_objects": {"wall": {"material": "black", "transform": {"translate": [0, 0, -4.5]},
    "tree": {"type": "box", "size": [20, 20, 1]}}}"#;

/// A coloured fog that also absorbs.
struct Fog {
    sigma_a: [f64; 3],
    sigma_s: [f64; 3],
    g: f64,
}

const FOG: Fog = Fog { sigma_a: [0.1, 0.05, 0.2], sigma_s: [0.3, 0.5, 0.9], g: 0.4 };

impl Fog {
    fn document(&self) -> String {
        let Self { sigma_a, sigma_s, g } = self;
        format!(r#""media": {{"fog": {{"sigma_a": {sigma_a:?}, "sigma_s": {sigma_s:?}, "g": {g}}}}}"#)
    }

    fn sigma_t(&self, channel: usize) -> f64 {
        self.sigma_a[channel] + self.sigma_s[channel]
    }

    fn phase(&self, cos: f64) -> f64 {
        let g = self.g;
        (1.0 - g * g) / (4.0 * PI * libm::pow(1.0 + g * g - 2.0 * g * cos, 1.5))
    }

    /// What a light at a point scatters once towards the origin from the first `length` of the −z axis, by channel.
    fn once(&self, light: DVec3, length: f64, intensity: impl Fn(DVec3) -> f64) -> [f64; 3] {
        let steps = 400_000;
        let width = length / f64::from(steps);
        let mut sums = [0.0; 3];
        for step in 0..steps {
            let t = (f64::from(step) + 0.5) * width;
            let from = DVec3::new(0.0, 0.0, -t) - light;
            let r = from.length();
            // Light that travels along `from` goes on along +z.
            let scattered = self.phase(from.z / r) * intensity(from / r) / (r * r) * width;
            for (channel, sum) in sums.iter_mut().enumerate() {
                *sum += self.sigma_s[channel] * libm::exp(-self.sigma_t(channel) * (t + r)) * scattered;
            }
        }
        sums
    }
}

/// The means of the three channels.
fn channels(film: &Film) -> [f64; 3] {
    let picture = film.picture();
    let sum = picture.color.iter().fold(DVec3::ZERO, |sum, color| sum + Vec3::as_dvec3(*color));
    (sum / picture.color.len() as f64).to_array()
}

/// Renders and compares, to a part of the expected value.
fn agrees(name: &str, document: &str, expected: [f64; 3], within: f64) {
    let film = render(&scene(document), 16, 2);
    let found = channels(&film);
    let error = film.summary().rmse.unwrap_or(0.0) / 16.0;
    println!("{name}: {found:?}, expected {expected:?}, standard error about {error:.2e}");
    assert_eq!(film.summary().counters.nan_samples + film.summary().counters.infinite_samples, 0, "{name}");
    for (found, expected) in found.into_iter().zip(expected) {
        assert!((found - expected).abs() <= within * expected.abs() + 1e-9, "{name}: {found} {expected}");
    }
}

#[test]
fn slabs_let_through_what_the_exponential_says() {
    let lamp = r#""spheres": {"lamp": {"center": [0, 0, -5], "radius": 1, "material": "black", "emission": [1, 2, 4]}}"#;
    let behind = |thick: f64| {
        let radiance = [1.0, 2.0, 4.0];
        std::array::from_fn(|c| radiance[c] * libm::exp(-FOG.sigma_t(c) * thick))
    };
    // All around, to the lamp; nothing is scattered on a path of one edge.
    let document = looking(4, 1, &format!(r#"{}, "medium": "fog", {lamp}"#, FOG.document()));
    agrees("all around", &document, behind(4.0), 1e-5);
    // A slab of 1.5 between two nothings.
    let slab = r#""sdf_objects": {"slab": {"material": "nothing", "interior": "fog", "transform": {"translate": [0, 0, -2]},
        "tree": {"type": "box", "size": [9, 9, 1.5]}}}"#;
    let document = looking(4, 1, &format!("{}, {slab}, {lamp}", FOG.document()));
    agrees("slab", &document, behind(1.5), 1e-5);
}

#[test]
fn a_point_scatters_once_as_by_quadrature() {
    for (name, place) in [
        ("beside", DVec3::new(1.0, 0.5, -2.0)),
        ("very close", DVec3::new(0.01, 0.0, -1.0)),
        ("behind the camera", DVec3::new(0.0, 0.0, 0.7)),
        ("behind and beside", DVec3::new(-1.0, 0.2, 3.0)),
    ] {
        let expected = FOG.once(place, 4.0, |_| 2.0);
        let light = format!(
            r#""lights": {{"lamp": {{"type": "point", "position": {:?}, "intensity": [2, 2, 2]}}}}"#,
            place.to_array()
        );
        let members = format!(r#"{}, "medium": "fog", {WALL}, {light}"#, FOG.document());
        agrees(name, &looking(256, 2, &members), expected, 2e-3);
    }
}

#[test]
fn a_spotlight_scatters_once_as_by_quadrature() {
    // Across the view, towards the camera, away from it, from beside so that the ray runs along the edge of the cone.
    for (name, place, towards, edge) in [
        ("across", DVec3::new(1.5, 0.0, -2.0), DVec3::new(-1.0, 0.1, 0.0), 20.0_f64),
        ("towards", DVec3::new(0.1, 0.0, -3.5), DVec3::new(-0.03, 0.0, 1.0), 15.0),
        ("away", DVec3::new(0.0, 0.0, 0.5), DVec3::new(0.0, 0.0, -1.0), 10.0),
        ("along the edge", DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.0, 0.0, -1.0), 45.001),
        ("wide", DVec3::new(0.3, 0.4, -1.0), DVec3::new(0.0, -1.0, -0.3), 85.0),
    ] {
        let axis = towards.normalize();
        let (beam, edge_radians) = (0.5 * edge.to_radians(), edge.to_radians());
        let intensity = |d: DVec3| {
            let angle = libm::acos(d.dot(axis).clamp(-1.0, 1.0));
            3.0 * ((edge_radians - angle) / (edge_radians - beam)).clamp(0.0, 1.0)
        };
        let expected = FOG.once(place, 4.0, intensity);
        let light = format!(
            r#""lights": {{"lamp": {{"type": "spotlight", "position": {:?}, "direction": {:?}, "intensity": [3, 3, 3],
                "beam_width": {}, "cutoff_angle": {edge}}}}}"#,
            place.to_array(),
            towards.to_array(),
            0.5 * edge
        );
        let members = format!(r#"{}, "medium": "fog", {WALL}, {light}"#, FOG.document());
        agrees(name, &looking(1024, 2, &members), expected, 2e-3);
    }
}

#[test]
fn the_sun_is_scattered_once_as_by_the_integral() {
    // A slab across the view, 1.5 thick and 9 high, under a sun at its zenith: sunlight comes 4.5 deep to the line of sight.
    for (name, density) in [("mist", 1.0), ("thin mist, where few places are looked at", 0.02)] {
        let slab = r#""sdf_objects": {"slab": {"material": "nothing", "interior": "fog", "transform": {"translate": [0, 0, -2]},
            "tree": {"type": "box", "size": [9, 9, 1.5]}}}"#;
        let Fog { sigma_a, sigma_s, g } = FOG;
        let members = format!(
            r#""media": {{"fog": {{"sigma_a": {sigma_a:?}, "sigma_s": {sigma_s:?}, "g": {g}, "density": {density}}}}}, {slab},
               "lights": {{"sun": {{"type": "sun", "direction": [0, -1, 0], "irradiance": [2, 2, 2], "angular_size": 0}}}}"#
        );
        let expected = std::array::from_fn(|c| {
            let (sigma_t, albedo) = (density * FOG.sigma_t(c), FOG.sigma_s[c] / FOG.sigma_t(c));
            2.0 * FOG.phase(0.0) * albedo * libm::exp(-sigma_t * 4.5) * -libm::expm1(-sigma_t * 1.5)
        });
        agrees(name, &looking(1024, 2, &members), expected, 2e-3);
    }
}

#[test]
fn nothing_is_lost_in_a_furnace() {
    // Walls that reflect half and shine as much as they lack; fog that absorbs nothing changes nothing.
    for (name, sigma, g) in
        [("thin", 0.1, 0.0), ("thick", 1.0, 0.0), ("forwards", 1.0, 0.8), ("chromatic", 1.0, -0.5)]
    {
        let sigma_s = if name == "chromatic" { [0.0, 0.4, 1.2] } else { [sigma; 3] };
        let members = format!(
            r#""media": {{"fog": {{"sigma_s": {sigma_s:?}, "g": {g}}}}}, "medium": "fog",
               "spheres": {{"box": {{"center": [0, 0, 0], "radius": 2, "material": "grey", "emission": [0.5, 0.5, 0.5],
                                    "flip_normals": true}}}}"#
        );
        let spp = if name == "thin" { 128 } else { 512 };
        agrees(name, &looking(spp, 200, &members), [1.0; 3], 2e-3);
    }
    // The same in a ball under an even sky.
    let members = r#""media": {"fog": {"sigma_s": [0.5, 1, 2], "g": 0.3}},
        "spheres": {"ball": {"center": [0, 0, -3], "radius": 1, "material": "nothing", "interior": "fog"}},
        "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}}"#;
    agrees("ball", &looking(2048, 100, members), [1.0; 3], 2e-3);
}

#[test]
fn fog_that_vanishes_is_no_fog() {
    let members = |media: &str| {
        format!(
            r#"{media} "spheres": {{"floor": {{"center": [0, 0, -4], "radius": 1, "material": "grey"}}}},
               "lights": {{"lamp": {{"type": "point", "position": [1, 2, 0], "intensity": [5, 5, 5]}},
                           "sky": {{"type": "environment", "radiance": [0.5, 0.5, 0.5]}}}}"#
        )
    };
    let clear = channels(&render(&scene(&looking(1024, 6, &members(""))), 16, 2));
    for density in ["0", "1e-9"] {
        let fog = format!(
            r#""media": {{"fog": {{"sigma_a": [1, 1, 1], "sigma_s": [1, 2, 3], "density": {density}}}}}, "medium": "fog","#
        );
        agrees("vanishing", &looking(1024, 6, &members(&fog)), clear, 2e-3);
    }
}

#[test]
fn ways_to_find_light_agree() {
    let fog = r#""media": {"fog": {"sigma_a": [0.05, 0.02, 0.1], "sigma_s": [0.3, 0.5, 0.2], "g": 0.5}}, "medium": "fog","#;
    let lamp =
        r#""ball": {"center": [1.2, 1, -2.5], "radius": 0.8, "material": "black", "emission": [3, 2.5, 2]},"#;
    let scenes = [
        (
            "lamp under a dim sky",
            format!(
                r#"{fog} "spheres": {{{lamp} "floor": {{"center": [0, -12, -3], "radius": 11, "material": "grey"}}}},
                   "lights": {{"sky": {{"type": "environment", "radiance": [0.05, 0.1, 0.2]}}}}"#
            ),
        ),
        (
            "sky and sun",
            format!(
                r#"{fog} "spheres": {{"floor": {{"center": [0, -12, -3], "radius": 11, "material": "grey"}}}},
                   "lights": {{"sky": {{"type": "environment", "radiance": [0.3, 0.4, 0.6]}},
                               "sun": {{"type": "sun", "direction": [1, -2, 0.5], "irradiance": [0.5, 0.5, 0.5], "angular_size": 60}}}}"#
            ),
        ),
    ];
    for (name, members) in scenes {
        let document = looking(4096, 6, &members);
        let document = document.replace("\"vfov\": 0.001", "\"vfov\": 60");
        let found = |strategy| {
            let film = render(&scene(&document).with_strategy(strategy), 16, 2);
            let (mean, error) = support::pooled_mean(&film);
            println!("{name}, {strategy:?}: {mean:.5} ± {error:.5}");
            (mean, error)
        };
        let (both, error) = found(Strategy::Both);
        for strategy in [Strategy::Scattering, Strategy::Lights, Strategy::BlindChoice] {
            let (mean, other) = found(strategy);
            let sigma = (error * error + other * other).sqrt();
            assert!((mean - both).abs() < 4.0 * sigma, "{name}, {strategy:?}: {mean} {both} ± {sigma}");
            assert!(sigma < 2.5e-3 * both, "{name}, {strategy:?}: too noisy to tell, {sigma}");
        }
    }
}

/// What a document without assets is refused for.
fn refused(document: &str, folder: &Path) -> String {
    let limits = Limits::default();
    let document = Document::parse(document, "test.json", &limits).unwrap_or_else(|p| panic!("{p}"));
    let source = Folder::new(folder).unwrap_or_else(|e| panic!("{e}"));
    let assets = Assets::load(&document, &source, &limits).unwrap_or_else(|p| panic!("{p}"));
    let description = document.at(1).unwrap_or_else(|p| panic!("{p}"));
    Scene::build(&description, &assets, 1).err().map_or_else(String::new, |problems| problems.to_string())
}

#[test]
fn media_that_cannot_be_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    // A tetrahedron without its bottom.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::write(folder.path().join("open.obj"), text).unwrap_or_else(|e| panic!("{e}"));
    let members = r#""media": {"fog": {"sigma_s": [1, 1, 1]}}, "meshes": {"tent": {"file": "open.obj"}},
        "instances": {"tent": {"mesh": "tent", "material": "nothing", "interior": "fog"}}"#;
    let found = refused(&looking(1, 2, members), folder.path());
    assert!(found.contains("instances.tent.interior: found a mesh with 3 open edges"), "{found}");
    let members = r#""media": {"fog": {"sigma_s": [1e30, 1, 1], "density": 1e30}}, "medium": "fog""#;
    let found = refused(&looking(1, 2, members), folder.path());
    assert!(found.contains("media.fog.density: found a medium that takes"), "{found}");
}

#[test]
fn dense_and_distant_fog_is_finite() {
    let lamp = r#""lights": {"lamp": {"type": "point", "position": [1, 1, -2], "intensity": [3, 3, 3]},
        "sky": {"type": "environment", "radiance": [1, 1, 1]}}"#;
    for sigma in ["[0, 0, 0]", "[1e-9, 1e-9, 1e-9]", "[1e4, 1e4, 1e4]", "[0, 1, 3]", "[0, 0, 1e8]"] {
        // Around everything, and around a camera inside of a ball; with a wall, and into nothing.
        for place in [
            r#""medium": "fog""#,
            r#""spheres": {"ball": {"center": [0, 0, 0], "radius": 1.5, "material": "nothing", "interior": "fog"}}"#,
        ] {
            for wall in [WALL, r#""sdf_objects": {}"#] {
                for lights in [
                    lamp,
                    r#""lights": {"lamp": {"type": "point", "position": [0, 0, -1], "intensity": [1, 1, 1]}}"#,
                ] {
                    let media = format!(r#""media": {{"fog": {{"sigma_s": {sigma}, "g": 0.99}}}}"#);
                    let document = looking(16, 12, &format!("{media}, {place}, {wall}, {lights}"));
                    let film = render(&scene(&document), 16, 2);
                    let counters = film.summary().counters;
                    assert_eq!(counters.nan_samples + counters.infinite_samples, 0, "{document}");
                    let most = channels(&film).into_iter().fold(0.0, f64::max);
                    assert!(most.is_finite() && most >= 0.0, "{document}: {most}");
                }
            }
        }
    }
}

#[test]
fn interiors_nest_and_animation_reaches_them() {
    // Clear in dark in clear: through the shells and not through the middle. The camera is in the middle of all.
    let media = r#""media": {"dark": {"sigma_a": [0.5, 0.5, 0.5], "density": 2}, "clear": {}}"#;
    let shells = r#""spheres": {
        "outer": {"center": [0, 0, 0], "radius": 3, "material": "nothing", "interior": "dark"},
        "inner": {"center": [0, 0, 0], "radius": 2, "material": "nothing", "interior": "clear"}},
        "lights": {"sky": {"type": "environment", "radiance": [1, 1, 1]}}"#;
    agrees("shell", &looking(2, 4, &format!("{media}, {shells}")), [libm::exp(-1.0); 3], 1e-5);
    let animation = r#""animation": {"frames": [1, 3], "tracks": {
        "media.dark.density": {"keys": [{"frame": 1, "value": 2}, {"frame": 3, "value": 6}]}}}"#;
    let document = looking(2, 4, &format!("{media}, {shells}, {animation}"));
    for (frame, thick) in [(1, 1.0), (2, 2.0), (3, 3.0)] {
        let found = channels(&render(&support::scene_in(Path::new("."), &document, frame), 16, 2));
        assert!((found[0] - libm::exp(-thick)).abs() < 1e-5, "frame {frame}: {found:?}");
    }
}
