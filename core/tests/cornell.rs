//! Owns the comparison with a picture that another renderer made; skipped where the scenes are not at hand.

mod support;

use karst_core::encode::read_exr;
use std::path::PathBuf;
use support::{pooled_mean, render, scene_in};

const CORNELL: &str = r#"{"version": 1,
    "camera": {"type": "perspective", "vfov": 39.3077, "transform": {"look_at": {"eye": [278, 273, -800], "target": [278, 273, 0], "up": [0, 1, 0]}}},
    "film": {"width": 256, "height": 256, "filter": {"type": "box"}},
    "sampling": {"spp": 64, "seed": 1},
    "integrator": {"max_depth": 256, "roulette_depth": 5},
    "materials": {
        "white": {"type": "diffuse", "reflectance": [0.735013, 0.7356246, 0.7362643]},
        "red": {"type": "diffuse", "reflectance": [0.49132, 0.04922811, 0.0509219]},
        "green": {"type": "diffuse", "reflectance": [0.06828254, 0.3977602, 0.08629087]},
        "lamp": {"type": "diffuse", "reflectance": [0.7763668, 0.77981, 0.7760291]}},
    "meshes": {
        "luminaire": {"file": "meshes/cbox_luminaire.ply"}, "floor": {"file": "meshes/cbox_floor.ply"},
        "ceiling": {"file": "meshes/cbox_ceiling.ply"}, "back": {"file": "meshes/cbox_back.ply"},
        "greenwall": {"file": "meshes/cbox_greenwall.ply"}, "redwall": {"file": "meshes/cbox_redwall.ply"},
        "smallbox": {"file": "meshes/cbox_smallbox.ply"}, "largebox": {"file": "meshes/cbox_largebox.ply"}},
    "instances": {
        "luminaire": {"mesh": "luminaire", "material": "lamp", "transform": {"translate": [0, -0.5, 0]}, "emission": [20.71084, 10.85463, 2.771152]},
        "floor": {"mesh": "floor", "material": "white"}, "ceiling": {"mesh": "ceiling", "material": "white"},
        "back": {"mesh": "back", "material": "white"}, "greenwall": {"mesh": "greenwall", "material": "green"},
        "redwall": {"mesh": "redwall", "material": "red"}, "smallbox": {"mesh": "smallbox", "material": "white"},
        "largebox": {"mesh": "largebox", "material": "white"}}}"#;

#[test]
fn the_cornell_box_agrees_with_another_renderer() {
    let Some(folder) = std::env::var_os("KARST_SCENES").map(|f| {
        // Tests run in the folder of their crate; the variable is relative to the workspace.
        let folder = PathBuf::from(f).join("cbox");
        if folder.is_absolute() { folder } else { PathBuf::from("..").join(folder) }
    }) else {
        println!("skipped: KARST_SCENES is not set");
        return;
    };
    let bytes = std::fs::read(folder.join("reference.exr")).unwrap();
    let reference = read_exr(&bytes).unwrap();
    let channel = |name: &str| {
        let (_, values) = reference.channels.iter().find(|(n, _)| n == name).unwrap();
        values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
    };
    let want = [channel("R"), channel("G"), channel("B")];
    let film = render(&scene_in(&folder, CORNELL, 1), 64, 2);
    let colors = film.picture().color;
    let got: [f64; 3] =
        std::array::from_fn(|c| colors.iter().map(|v| f64::from(v[c])).sum::<f64>() / colors.len() as f64);
    let pooled = got.iter().sum::<f64>() / want.iter().sum::<f64>() - 1.0;
    println!(
        "pooled mean {:+.4} %, by channel {got:?} against {want:?}, ± {:.5}",
        pooled * 100.0,
        pooled_mean(&film).1
    );
    assert!(pooled.abs() < 0.005, "pooled mean differs by {:.3} %", pooled * 100.0);
    assert!(got.iter().zip(&want).all(|(g, w)| (g / w - 1.0).abs() < 0.01), "{got:?} {want:?}");
}
