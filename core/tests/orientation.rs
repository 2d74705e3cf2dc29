//! Every light over a floor with a ball, in front of what the scene format's page says of it: which way it shines, how
//! far, and what it brings. `UPDATE_DOCS=1` writes the pictures to `docs/images/lights.png`.

mod support;

use glam::{DVec3, Vec3};
use karst_core::color::View;
use karst_core::encode::png;
use karst_core::film::Picture;
use std::cmp::Ordering;
use std::f64::consts::PI;
use std::path::Path;
use support::{render, scene_in};

const WIDTH: u32 = 160;
const HEIGHT: u32 = 120;
const EYE: DVec3 = DVec3::new(0.0, 5.0, 7.0);
const TARGET: DVec3 = DVec3::new(0.0, 0.6, 0.0);
const VFOV: f64 = 42.0;
const BALL: DVec3 = DVec3::new(0.5, 0.6, 0.3);
const RADIUS: f64 = 0.6;
const ALBEDO: f64 = 0.8;

/// A light as a document has it, and the irradiance of the floor at a point by what the page says.
struct Case {
    name: &'static str,
    /// Entries of `lights`.
    lights: String,
    /// More entries of `instances` and `spheres`, each ending with a comma.
    instances: &'static str,
    spheres: &'static str,
    floor: Box<dyn Fn(DVec3) -> f64>,
}

/// Whether the ball is between a point and another one.
fn shadowed(from: DVec3, to: DVec3) -> bool {
    let (d, to_ball) = (to - from, BALL - from);
    let along = (to_ball.dot(d) / d.length_squared()).clamp(0.0, 1.0);
    (from + d * along).distance(BALL) < RADIUS
}

/// Irradiance at `p` on the floor by a point light of intensity 1 at `at`, the ball in between.
fn by_point(p: DVec3, at: DVec3) -> f64 {
    let d = at - p;
    if d.y <= 0.0 || shadowed(p, at) { 0.0 } else { d.y / d.length().powi(3) }
}

/// Cosine of the angle between the axis and the way from `at` to `p`.
fn off_axis(p: DVec3, at: DVec3, axis: DVec3) -> f64 {
    (p - at).normalize().dot(axis.normalize())
}

/// A spotlight with the members `falloff`, whose intensity over the angle in degrees off the axis is `share`.
fn spotlight(name: &'static str, falloff: &str, share: impl Fn(f64) -> f64 + 'static) -> Case {
    let (at, axis) = (DVec3::new(-2.0, 3.0, 0.5), DVec3::new(3.0, -4.0, -1.0));
    Case {
        name,
        lights: format!(
            r#""spot": {{"type": "spotlight", "position": [-2, 3, 0.5], "direction": [3, -4, -1],
            "intensity": [30, 30, 30], {falloff}}}"#
        ),
        instances: "",
        spheres: "",
        floor: Box::new(move |p| {
            30.0 * by_point(p, at) * share(libm::acos(off_axis(p, at, axis).min(1.0)).to_degrees())
        }),
    }
}

fn point() -> Case {
    let at = DVec3::new(-1.5, 1.5, 0.8);
    Case {
        name: "point",
        lights: r#""p": {"type": "point", "position": [-1.5, 1.5, 0.8], "intensity": [8, 8, 8]}"#.to_owned(),
        instances: "",
        spheres: "",
        floor: Box::new(move |p| 8.0 * by_point(p, at)),
    }
}

fn sun() -> Case {
    Case {
        name: "sun",
        lights:
            r#""s": {"type": "sun", "direction": [2, -3, -1], "irradiance": [4, 4, 4], "angular_size": 0}"#
                .to_owned(),
        instances: "",
        spheres: "",
        floor: Box::new(|p| {
            let towards = -DVec3::new(2.0, -3.0, -1.0).normalize();
            if shadowed(p, p + towards * 100.0) { 0.0 } else { 4.0 * towards.y }
        }),
    }
}

/// Mean over points of a rectangle of what they bring, where they are not hidden; its front shines along `n`.
fn by_rectangle(p: DVec3, corner: DVec3, u: DVec3, v: DVec3, half: bool) -> f64 {
    const STEPS: u32 = 24;
    let n = u.cross(v);
    let mut sum = 0.0;
    for i in 0..STEPS * STEPS {
        let [a, b] = [i % STEPS, i / STEPS].map(|step| (f64::from(step) + 0.5) / f64::from(STEPS));
        // Cells on the longest side of a triangle are in by half.
        let share = match (i % STEPS + i / STEPS + 1).cmp(&STEPS) {
            Ordering::Greater if half => 0.0,
            Ordering::Equal if half => 0.5,
            Ordering::Less | Ordering::Equal | Ordering::Greater => 1.0,
        };
        let q = corner + u * a + v * b;
        let d = q - p;
        let cos = -d.dot(n) / d.length();
        if cos > 0.0 && d.y > 0.0 && !shadowed(p, q) {
            sum += share * cos * d.y / d.length().powi(3);
        }
    }
    sum / f64::from(STEPS * STEPS)
}

/// A surface of a mesh (file `square.obj` or `triangle.obj`: corners (0,0,0), (1,0,0), (1,1,0), (0,1,0), its front
/// towards +z) that stands upright on the floor and shines towards +x only.
fn upright(name: &'static str, half: bool) -> Case {
    // The local frame's x becomes -z, y stays, and so z becomes +x ... as the matrix in `instances` says.
    let (corner, u, v) = (DVec3::new(-2.2, 0.2, 1.0), DVec3::new(0.0, 0.0, -2.0), DVec3::new(0.0, 1.5, 0.0));
    assert!(u.cross(v).normalize().abs_diff_eq(DVec3::X, 1e-12), "it shines towards +x");
    Case {
        name,
        lights: String::new(),
        instances: if half {
            r#""lamp": {"mesh": "triangle", "material": "gray", "emission": [10, 10, 10],
            "transform": {"matrix": [[0, 0, 1, -2.2], [0, 1.5, 0, 0.2], [-2, 0, 0, 1], [0, 0, 0, 1]]}},"#
        } else {
            r#""lamp": {"mesh": "square", "material": "gray", "emission": [6, 6, 6],
            "transform": {"matrix": [[0, 0, 1, -2.2], [0, 1.5, 0, 0.2], [-2, 0, 0, 1], [0, 0, 0, 1]]}},"#
        },
        spheres: "",
        floor: Box::new(move |p| if half { 10.0 } else { 6.0 } * by_rectangle(p, corner, u, v, half)),
    }
}

fn sphere() -> Case {
    Case {
        name: "sphere",
        lights: String::new(),
        instances: "",
        spheres: r#""lamp": {"center": [-1.6, 1.4, 0], "radius": 0.3, "material": "gray", "emission": [25, 25, 25]},"#,
        floor: Box::new(|p| {
            // Points of the ball's great disk that faces the receiver stand for it, as far as shadows go.
            let at = DVec3::new(-1.6, 1.4, 0.0);
            let (d, distance) = (at - p, at.distance(p));
            let (s, t) = (d / distance).any_orthonormal_pair();
            let points = (0..256).map(|i| {
                let r = 0.3 * ((f64::from(i) + 0.5) / 256.0).sqrt();
                let turn = f64::from(i) * 2.399_963_229_728_653;
                at + (s * libm::cos(turn) + t * libm::sin(turn)) * r
            });
            let seen = points.filter(|q| !shadowed(p, *q)).count() as f64 / 256.0;
            25.0 * PI * (0.3 / distance).powi(2) * d.y / distance * seen
        }),
    }
}

fn cases() -> Vec<Case> {
    vec![
        point(),
        spotlight("spotlight: focus", r#""focus": 5, "cutoff_angle": 20"#, |angle| {
            if angle < 20.0 { libm::cos(angle.to_radians()).powi(25) } else { 0.0 }
        }),
        spotlight("spotlight: beam width", r#""beam_width": 12, "cutoff_angle": 24"#, |angle| {
            ((24.0 - angle) / 12.0).clamp(0.0, 1.0)
        }),
        spotlight("spotlight: cone angle", r#""cone_angle": 44, "blend": 0.5"#, |angle| {
            let (edge, cos) = (libm::cos(22.0_f64.to_radians()), libm::cos(angle.to_radians()));
            let x = ((cos - edge) / ((1.0 - edge) * 0.5)).clamp(0.0, 1.0);
            x * x * (3.0 - 2.0 * x)
        }),
        sun(),
        sphere(),
        upright("rectangle", false),
        upright("triangle", true),
    ]
}

/// A document with the stage and what is added.
fn document(camera: &str, members: &str, spp: u32) -> String {
    format!(
        r#"{{"version": 1, "camera": {{"type": "perspective", {camera}}},
        "film": {{"width": {WIDTH}, "height": {HEIGHT}, "filter": {{"type": "box"}}}},
        "sampling": {{"spp": {spp}, "seed": 3}},
        "integrator": {{"max_depth": 2}},
        "materials": {{"gray": {{"type": "diffuse", "reflectance": [{ALBEDO}, {ALBEDO}, {ALBEDO}]}}}},
        {members}}}"#
    )
}

fn stage(case: &Case) -> String {
    let Case { lights, instances, spheres, .. } = case;
    let camera =
        format!(r#""vfov": {VFOV}, "transform": {{"look_at": {{"eye": [0, 5, 7], "target": [0, 0.6, 0]}}}}"#);
    let members = format!(
        r#""meshes": {{"square": {{"file": "square.obj"}}, "triangle": {{"file": "triangle.obj"}}}},
        "instances": {{{instances} "floor": {{"mesh": "square", "material": "gray",
            "transform": {{"matrix": [[80, 0, 0, -40], [0, 0, 1, 0], [0, -80, 0, 40], [0, 0, 0, 1]]}}}}}},
        "spheres": {{{spheres} "ball": {{"center": [0.5, 0.6, 0.3], "radius": {RADIUS}, "material": "gray"}}}},
        "lights": {{{lights}}}"#
    );
    // Points leave noise at the edges of shadows only.
    document(&camera, &members, if lights.is_empty() { 256 } else { 64 })
}

/// The point of the floor behind a point of the picture, `None` where the ball or nothing is.
fn on_the_floor(x: f64, y: f64, hidden: &dyn Fn(DVec3, DVec3) -> bool) -> Option<DVec3> {
    let z = (EYE - TARGET).normalize();
    let right = DVec3::Y.cross(z).normalize();
    let half = libm::tan(0.5 * VFOV.to_radians()) / f64::from(HEIGHT) * 2.0;
    let (x, y) = (x - 0.5 * f64::from(WIDTH), 0.5 * f64::from(HEIGHT) - y);
    let d = (right * x + z.cross(right) * y) * half - z;
    let p = EYE - d * (EYE.y / d.y);
    (d.y < 0.0 && !shadowed(EYE, p) && !hidden(EYE, p)).then_some(p)
}

/// Whether one of the lamps that are surfaces is between two points.
fn behind_a_lamp(name: &str, from: DVec3, to: DVec3) -> bool {
    let d = to - from;
    match name {
        "sphere" => {
            let at = DVec3::new(-1.6, 1.4, 0.0);
            let along = ((at - from).dot(d) / d.length_squared()).clamp(0.0, 1.0);
            (from + d * along).distance(at) < 0.32
        }
        "rectangle" | "triangle" => {
            let along = (-2.2 - from.x) / d.x;
            let q = from + d * along;
            (0.0..1.0).contains(&along) && (-1.05..1.05).contains(&q.z) && (0.15..1.75).contains(&q.y)
        }
        _ => false,
    }
}

/// Largest part of the brightest value by which a pixel may be off: the noise of 256 samples of the lamps that are
/// surfaces.
const TOLERANCE: f64 = 0.02;

#[test]
fn lights_shine_where_the_page_says() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    write_meshes(folder.path());
    let mut panels = Vec::new();
    for case in cases() {
        let picture = render(&scene_in(folder.path(), &stage(&case), 1), 32, 2).picture();
        let hidden = |from: DVec3, to: DVec3| behind_a_lamp(case.name, from, to);
        let expected = |x: f64, y: f64| on_the_floor(x, y, &hidden).map(|p| (case.floor)(p) * ALBEDO / PI);
        let (mut compared, mut lit, mut brightest, mut worst) = (0, 0, 0.0_f64, (0.0_f64, 0, 0));
        let mut found = Vec::new();
        for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
            // A pixel is compared where all of it is floor.
            let within =
                |i: u32| (f64::from(x) + 0.5 * f64::from(i % 3), f64::from(y) + 0.5 * f64::from(i / 3));
            let values = (0..9).map(within).map(|(x, y)| expected(x, y));
            let Some(values) = values.collect::<Option<Vec<f64>>>() else { continue };
            // Simpson's rule over the pixel.
            let weights = [1.0, 4.0, 1.0, 4.0, 16.0, 4.0, 1.0, 4.0, 1.0];
            let mean = values.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() / 36.0;
            brightest = brightest.max(mean);
            found.push((x, y, mean, values));
        }
        for (x, y, mean, values) in &found {
            // Where the light changes within the pixel, as at the edge of a shadow, its mean is not known well.
            let spread = values.iter().fold(0.0_f64, |most, v| most.max((v - mean).abs()));
            if spread > 0.05 * brightest {
                continue;
            }
            let off = f64::from(picture.color[(y * WIDTH + x) as usize].x) - mean;
            compared += 1;
            lit += u32::from(*mean > 0.05 * brightest);
            if off.abs() > worst.0.abs() {
                worst = (off, *x, *y);
            }
        }
        println!(
            "{}: {compared} pixels, {lit} of them lit, worst {:+.4} of {brightest:.3}",
            case.name, worst.0
        );
        assert!(compared > 9_000 && lit > 200, "{}: {compared} compared, {lit} lit", case.name);
        assert!(
            worst.0.abs() < TOLERANCE * brightest,
            "{}: pixel {},{} is off by {}, the brightest is {brightest}",
            case.name,
            worst.1,
            worst.2,
            worst.0
        );
        panels.push(picture);
    }
    panels.push(look_into(folder.path(), 180.0));
    if std::env::var_os("UPDATE_DOCS").is_some() {
        write_sheet(&panels);
    }
}

/// The environment's image, 16 by 8 texels: red grows to the right, green upwards, and the middle has blue.
fn texel(column: u32, row: u32) -> Vec3 {
    let middle = (6..10).contains(&column) && (3..5).contains(&row);
    Vec3::new(column as f32 / 15.0, 1.0 - row as f32 / 7.0, if middle { 1.0 } else { 0.0 })
}

/// The environment alone, seen from the origin by a camera that is turned by some degrees about +y; without a turn it
/// looks along -z.
fn look_into(folder: &Path, turn: f64) -> Picture {
    let camera = format!(r#""vfov": 60, "transform": {{"rotate": [0, {turn}, 0]}}"#);
    let members = r#""lights": {"sky": {"type": "environment", "image": "sky.exr"}}"#;
    render(&scene_in(folder, &document(&camera, members, 16), 1), 32, 2).picture()
}

#[test]
fn the_environment_is_where_the_page_says() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    write_meshes(folder.path());
    // Direction +z is the middle of the image, whose upper edge is +y and whose right is -x.
    for (turn, looks, column) in
        [(180.0, "+z", 8.0), (0.0, "-z", 0.0), (90.0, "-x", 12.0), (-90.0, "+x", 4.0)]
    {
        let picture = look_into(folder.path(), turn);
        let at = |x: u32, y: u32| picture.color[(y * WIDTH + x) as usize];
        let (middle, above) = (at(WIDTH / 2, HEIGHT / 2), at(WIDTH / 2, 10));
        // Texels have their values in their middles: the column `c` of the edge between two has the red of both.
        let red = if column == 0.0 { 0.5 } else { (column - 0.5) / 15.0 };
        assert!((middle.x - red as f32).abs() < 0.05, "{looks}: red {}, expected {red}", middle.x);
        assert!((middle.y - 0.5).abs() < 0.05, "{looks}: green {}", middle.y);
        assert!(above.y > middle.y + 0.1, "{looks}: up is {} over {}", above.y, middle.y);
        assert_eq!(middle.z > 0.9, looks == "+z", "{looks}: blue {}", middle.z);
        if looks != "-z" {
            // Seen from inside: what is on the right in the picture is on the right in the image.
            let (left, right) = (at(10, HEIGHT / 2), at(WIDTH - 10, HEIGHT / 2));
            assert!(right.x > left.x + 0.1, "{looks}: right {} over left {}", right.x, left.x);
        }
    }
}

/// The meshes and the environment's image that the documents name.
fn write_meshes(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    };
    write("square.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    write("triangle.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    exr::prelude::write_rgb_file(folder.join("sky.exr"), 16, 8, |x, y| {
        <(f32, f32, f32)>::from(texel(x as u32, y as u32))
    })
    .unwrap_or_else(|e| panic!("sky.exr: {e}"));
}

/// The pictures side by side, three in a row.
fn write_sheet(panels: &[Picture]) {
    let (columns, gap) = (3, 4);
    let rows = panels.len() as u32 / columns;
    let (width, height) = (columns * (WIDTH + gap) - gap, rows * (HEIGHT + gap) - gap);
    let mut sheet = vec![Vec3::ONE; (width * height) as usize];
    for (at, panel) in (0..).zip(panels) {
        let (left, top) = (at % columns * (WIDTH + gap), at / columns * (HEIGHT + gap));
        for (from, row) in panel.color.chunks_exact(WIDTH as usize).enumerate() {
            let start = ((top + from as u32) * width + left) as usize;
            sheet[start..start + WIDTH as usize].copy_from_slice(row);
        }
    }
    let bytes = png(&sheet, width, height, 0.0, View::Standard).unwrap_or_else(|e| panic!("{e}"));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/images/lights.png");
    std::fs::write(&path, bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
