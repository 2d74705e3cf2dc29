//! Owns changes of a scene that must not change its picture: another unit, another place, another cut of a lamp.

use super::furnace::material;
use super::oracle::Disney;
use super::scenes::{Shot, Shown, list, matrix};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// How a scene is placed.
#[derive(Debug, Clone, Copy)]
struct Placing {
    scale: f64,
    turn: DMat3,
    shift: DVec3,
    /// Lamp as one rectangle or as two halves.
    halves: bool,
}

const HERE: Placing = Placing { scale: 1.0, turn: DMat3::IDENTITY, shift: DVec3::ZERO, halves: false };

impl Placing {
    fn map(&self) -> DAffine3 {
        DAffine3 {
            matrix3: self.turn * DMat3::from_diagonal(DVec3::splat(self.scale)),
            translation: self.shift,
        }
    }

    fn point(&self, x: f64, y: f64, z: f64) -> String {
        list(self.map().transform_point3(DVec3::new(x, y, z)))
    }

    fn direction(&self, x: f64, y: f64, z: f64) -> String {
        list(self.turn * DVec3::new(x, y, z))
    }

    /// A unit square of the plane z = 0 around the origin, placed in the scene by a scaling, then a turn about x, then a
    /// shift.
    fn square(&self, scale: DVec3, about_x: f64, shift: DVec3) -> String {
        let local = DAffine3 {
            matrix3: DMat3::from_rotation_x(about_x.to_radians()) * DMat3::from_diagonal(scale),
            translation: shift,
        };
        matrix(&(self.map() * local))
    }

    /// The scene: balls of three kinds on a floor, a lamp, a point, a spotlight, a sun.
    fn members(&self) -> String {
        let brown = Disney { base_color: [0.7, 0.4, 0.2], ..Disney::PLAIN };
        let metal = material(&Disney { metallic: 1.0, roughness: 0.3, ..brown });
        let coat = material(&Disney { clearcoat: 1.0, clearcoat_gloss: 0.5, roughness: 0.6, ..brown });
        let (r, s2) = (self.scale * 0.7, self.scale * self.scale);
        let centers = [self.point(-1.6, 0.7, 0.0), self.point(0.0, 0.7, 0.0), self.point(1.6, 0.7, 0.0)];
        let floor = self.square(DVec3::splat(12.0), -90.0, DVec3::ZERO);
        let lamp = |width: f64, x: f64, name: &str| {
            let place = self.square(DVec3::new(width, 1.0, 1.0), 90.0, DVec3::new(x, 3.0, 0.5));
            format!(
                r#""{name}": {{"mesh": "square", "material": "gray", "transform": {place}, "emission": [8, 7, 6]}}"#
            )
        };
        let lamps = if self.halves {
            format!("{}, {}", lamp(1.0, -0.5, "left"), lamp(1.0, 0.5, "right"))
        } else {
            lamp(2.0, 0.0, "lamp")
        };
        let intensity = |i: f64| list(DVec3::splat(i * s2));
        format!(
            r#""materials": {{"metal": {metal}, "coat": {coat}, "glass": {{"type": "dielectric", "alpha": 0.3}}, "gray": {{"type": "diffuse", "reflectance": [0.5, 0.5, 0.4]}}}},
            "meshes": {{"square": {{"file": "square.obj"}}}},
            "instances": {{"floor": {{"mesh": "square", "material": "gray", "transform": {floor}}}, {lamps}}},
            "spheres": {{"a": {{"center": {}, "radius": {r:?}, "material": "metal"}}, "b": {{"center": {}, "radius": {r:?}, "material": "glass"}},
            "c": {{"center": {}, "radius": {r:?}, "material": "coat"}}}},
            "lights": {{"point": {{"type": "point", "position": {}, "intensity": {}}},
            "spot": {{"type": "spotlight", "position": {}, "direction": {}, "intensity": {}, "focus": 3}},
            "sun": {{"type": "sun", "direction": {}, "irradiance": [1, 1, 1], "angular_size": 3}}}}"#,
            centers[0],
            centers[1],
            centers[2],
            self.point(3.0, 2.0, 2.0),
            intensity(3.0),
            self.point(-3.0, 3.0, 2.0),
            self.direction(2.0, -3.0, -1.0),
            intensity(20.0),
            self.direction(0.3, -1.0, -0.6)
        )
    }

    fn take(&self, seed: u32) -> Shown {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let square = "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
        std::fs::write(folder.path().join("square.obj"), square).unwrap_or_else(|e| panic!("{e}"));
        self.take_in(folder.path(), seed)
    }

    fn take_in(&self, folder: &Path, seed: u32) -> Shown {
        let at = |v: DVec3| self.map().transform_point3(v);
        let (eye, target) = (at(DVec3::new(0.5, 2.0, 6.0)), at(DVec3::new(0.0, 0.7, 0.0)));
        let up = self.turn * DVec3::Y;
        Shot { side: 32, spp: 256, seed, max_depth: 8, vfov: 40.0, eye, target, up, ..Shot::from(DVec3::Z) }
            .take_in(folder, &self.members())
    }
}

/// Most by which the mean of the same random numbers changes where only the unit does.
const SAME: f64 = 1e-3;

/// Same mean within the noise of both.
fn alike(name: &str, a: &Shown, b: &Shown) {
    let part = b.mean / a.mean - 1.0;
    println!(
        "{name}: {:+.4} %, {:+.1} standard errors of {:.3} %: a bias of {:.2} % would fail",
        part * 100.0,
        b.apart(a),
        libm::hypot(a.error, b.error) / a.mean * 100.0,
        4.9 * libm::hypot(a.error, b.error) / a.mean * 100.0
    );
    assert!(a.mean > 0.05 && a.error < 0.004 * a.mean, "{name}: no power: {} ± {}", a.mean, a.error);
    assert!(b.apart(a).abs() < 4.9, "{name}: {} ± {} against {} ± {}", b.mean, b.error, a.mean, a.error);
}

#[test]
fn units_places_and_turns_do_not_show() {
    let here = HERE.take(1);
    let turn = DMat3::from_euler(glam::EulerRot::YXZ, 0.7, 0.4, -1.1);
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    for (name, placing) in [
        ("a thousand times larger", Placing { scale: 1e3, ..HERE }),
        ("a thousand times smaller", Placing { scale: 1e-3, ..HERE }),
        ("moved by 300", Placing { shift: DVec3::new(300.0, -200.0, 100.0), ..HERE }),
        ("moved by 10000", Placing { shift: DVec3::new(1e4, 0.0, -1e4), ..HERE }),
        ("turned", Placing { turn, ..HERE }),
        ("mirrored", Placing { turn: mirror, ..HERE }),
        (
            "turned, mirrored, shrunk and moved",
            Placing { turn: turn * mirror, scale: 0.01, shift: DVec3::new(1.0, 2.0, 3.0), ..HERE },
        ),
        ("a lamp in halves", Placing { halves: true, ..HERE }),
    ] {
        alike(name, &here, &placing.take(2));
    }
}

/// With the same random numbers another unit changes rounding only: here the noise hides nothing.
#[test]
fn another_unit_changes_rounding_only() {
    let here = HERE.take(1);
    for scale in [1e3, 1e-3] {
        let part = Placing { scale, ..HERE }.take(1).mean / here.mean - 1.0;
        println!("scale {scale}: {:+.4} %", part * 100.0);
        assert!(part.abs() < SAME, "scale {scale}: {part}");
    }
}

/// The comparison sees a light that does not scale with the scene, by two hundredths.
#[test]
fn a_changed_scene_does_show() {
    let here = HERE.take(1);
    let larger = Placing { scale: 1.02, ..HERE };
    // Everything but the lights' power scales: as if intensity were not power per solid angle of a larger world.
    let members =
        larger.members().replace(&list(DVec3::splat(20.0 * 1.02 * 1.02)), &list(DVec3::splat(20.0)));
    assert_ne!(members, larger.members());
    let shot = Shot {
        side: 32,
        spp: 256,
        seed: 1,
        max_depth: 8,
        vfov: 40.0,
        ..Shot::from(DVec3::new(0.5, 2.0, 6.0) * 1.02)
    };
    let shot = Shot { target: DVec3::new(0.0, 0.7 * 1.02, 0.0), ..shot };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("square.obj"),
        "v -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n",
    )
    .unwrap();
    let shown = shot.take_in(folder.path(), &members);
    println!("{:+.3} %", (shown.mean / here.mean - 1.0) * 100.0);
    assert!((shown.mean / here.mean - 1.0).abs() > 2.0 * SAME, "{} against {}", shown.mean, here.mean);
}
