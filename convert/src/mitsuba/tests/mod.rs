//! Whole scenes: what small documents become, and what bad ones are answered with.

mod bad;
mod material;
mod shape;

use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::{Asset, Converted, convert};

const SENSOR: &str = "<sensor type='perspective'><film type='hdrfilm'><rfilter type='box'/></film></sensor>";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    folder
}

fn within(folder: &TempDir) -> Result<Converted, String> {
    let root = folder.path().display().to_string();
    convert(&folder.path().join("scene.xml")).map_err(|error| error.to_string().replace(&root, "DIR"))
}

/// The scene around what is given.
fn scene(inner: &str) -> Result<Converted, String> {
    within(&folder(&[("scene.xml", &format!("<scene version='3.0.0'>{SENSOR}\n{inner}</scene>"))]))
}

/// The same of version 0.6.
fn older(inner: &str) -> Result<Converted, String> {
    within(&folder(&[("scene.xml", &format!("<scene version='0.6.0'>{SENSOR}\n{inner}</scene>"))]))
}

fn document(inner: &str) -> Value {
    scene(inner).unwrap().document
}

fn notes(converted: &Converted) -> Vec<String> {
    converted.notes.iter().map(|note| format!("{} {:?} {}", note.line, note.kind, note.text)).collect()
}

/// The only material of a scene with this one.
fn material(bsdf: &str) -> Value {
    let found = document(bsdf);
    found["materials"].as_object().unwrap().values().next().unwrap().clone()
}

fn near(found: &Value, expected: f64) {
    assert!((found.as_f64().unwrap() - expected).abs() < 1e-12, "{found} is not {expected}");
}

#[test]
fn a_small_scene_becomes_this_document() {
    let files = [("scene.xml", include_str!("small.xml")), ("meshes/tri.obj", TRIANGLE), ("sky.exr", "")];
    let folder = folder(&files);
    let found = within(&folder).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/mitsuba/tests/small.json");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, found.text()).unwrap();
    }
    assert_eq!(found.text(), std::fs::read_to_string(&path).unwrap());
    let names: Vec<&str> = found.assets.keys().map(String::as_str).collect();
    assert_eq!(names, ["meshes/rectangle.ply", "meshes/tri.obj", "textures/sky.exr"]);
    assert_eq!(found.assets["meshes/tri.obj"], Asset::File(folder.path().join("meshes/tri.obj")));
    assert!(notes(&found).is_empty(), "{:?}", notes(&found));
    assert_eq!(within(&folder).unwrap(), found, "the same scene gives the same document");
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";

#[test]
fn both_spellings_say_the_same() {
    let new = "<bsdf type='roughplastic'><float name='int_ior' value='2'/><rgb name='diffuse_reflectance' value='.1'/></bsdf>";
    let old = "<bsdf type='roughplastic'><float name='intIOR' value='2'/><rgb name='diffuseReflectance' value='.1'/></bsdf>";
    assert_eq!(material(new), material(old));
    assert_eq!(material(new)["ior"], 2.0 / 1.000_277);
}

#[test]
fn angles_of_view_follow_their_axis() {
    let vfov = |size: [u32; 2], inner: &str| {
        let [width, height] = size;
        let film = format!(
            "<film type='hdrfilm'><integer name='width' value='{width}'/><integer name='height' value='{height}'/>\
             <rfilter type='box'/></film>"
        );
        let text =
            format!("<scene version='3.0.0'><sensor type='perspective'>{film}{inner}</sensor></scene>");
        within(&folder(&[("scene.xml", &text)])).map(|found| found.document["camera"]["vfov"].clone())
    };
    let of = |axis: &str| format!("<float name='fov' value='90'/><string name='fov_axis' value='{axis}'/>");
    let down = 2.0 * libm::atan(0.5_f64).to_degrees();
    for (size, axis, expected) in [
        ([200, 100], "x", down),
        ([200, 100], "y", 90.0),
        ([200, 100], "smaller", 90.0),
        ([200, 100], "larger", down),
        ([100, 200], "smaller", 2.0 * libm::atan(2.0_f64).to_degrees()),
        ([100, 200], "larger", 90.0),
        ([300, 400], "diagonal", 2.0 * libm::atan(0.8_f64).to_degrees()),
    ] {
        near(&vfov(size, &of(axis)).unwrap(), expected);
    }
    near(&vfov([200, 100], "<float name='fov' value='90'/>").unwrap(), down);
    let lens = 2.0 * libm::atan(libm::hypot(36.0, 24.0) / 100.0 / libm::hypot(1.25, 1.0)).to_degrees();
    near(&vfov([125, 100], "<string name='focalLength' value='50mm'/>").unwrap(), lens);
    for wrong in [&of("z"), "<float name='fov' value='180'/>", "<string name='focal_length' value='long'/>"] {
        assert!(vfov([200, 100], wrong).unwrap_err().contains("DIR/scene.xml:1: found"), "{wrong}");
    }
}

#[test]
fn cameras_turn_around_and_lose_their_scale() {
    let camera = |inner: &str| {
        let film = "<film type='hdrfilm'><rfilter type='box'/></film>";
        let text = format!("<scene version='3.0.0'><sensor type='thinlens'>{film}{inner}</sensor></scene>");
        within(&folder(&[("scene.xml", &text)])).unwrap().document["camera"].clone()
    };
    let look = "<transform name='toWorld'><scale value='3'/><lookat origin='1 2 3' target='1 2 9' up='0 1 0'/></transform>";
    let lens = "<float name='apertureRadius' value='.1'/><float name='focusDistance' value='6'/>";
    let found = camera(&format!("{look}{lens}"));
    let rows =
        json!([[-1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, -1.0, 3.0], [0.0, 0.0, 0.0, 1.0]]);
    assert_eq!(found["transform"]["matrix"], rows);
    assert_eq!((&found["lens_radius"], &found["focus_distance"]), (&json!(0.1), &json!(6.0)));
    assert!(camera("").get("lens_radius").is_none());
}

#[test]
fn films_filters_samplers_and_integrators() {
    let text = "<scene version='0.6.0'><integrator type='volpath'><integer name='maxDepth' value='9'/><integer \
        name='rrDepth' value='3'/></integrator><sensor type='perspective'><sampler type='ldsampler'><integer \
        name='sampleCount' value='256'/></sampler><film type='ldrfilm'><integer name='width' value='64'/><integer \
        name='height' value='32'/><integer name='cropOffsetX' value='8'/><integer name='cropWidth' value='16'/><integer \
        name='cropHeight' value='32'/><rfilter type='gaussian'><float name='stddev' value='0.4'/></rfilter></film>\
        </sensor></scene>";
    let found = within(&folder(&[("scene.xml", text)])).unwrap();
    let film = json!({"width": 64, "height": 32, "crop": {"x": 8, "y": 0, "width": 16, "height": 32},
        "filter": {"type": "gaussian", "radius": 3.0 * 0.4}, "view": "standard"});
    assert_eq!(found.document["film"], film);
    assert_eq!(found.document["sampling"], json!({"spp": 256}));
    assert_eq!(found.document["integrator"], json!({"max_depth": 9}));
    assert_eq!(notes(&found).len(), 1, "{:?}", notes(&found));
    assert!(notes(&found)[0].starts_with("1 Differs a Gaussian filter"));
    assert_eq!(document("")["integrator"], json!({"max_depth": 1024}));
    let direct = document("<integrator type='direct'/>");
    assert_eq!(direct["integrator"]["max_depth"], 2);
}

#[test]
fn variables_includes_and_aliases_are_resolved() {
    let folder = folder(&[
        (
            "scene.xml",
            "<scene version='3.0.0'><default name='r' value='0.1'/><default name='rest' value='0.2'/>\
             <path value='more'/><include filename='parts.xml'/><alias id='grey' as='gray'/>\
             <shape type='sphere' id='$name'><ref id='gray'/></shape></scene>",
        ),
        (
            "more/parts.xml",
            &format!(
                "<scene version='3.0.0'>{SENSOR}<default name='r' value='0.9'/><default name='name' value='ball'/>\
             <bsdf type='diffuse' id='grey'><rgb name='reflectance' value='$r $rest $r'/></bsdf></scene>"
            ),
        ),
    ]);
    let found = within(&folder).unwrap().document;
    assert_eq!(found["materials"]["grey"]["reflectance"], json!([0.1, 0.2, 0.1]));
    assert_eq!(found["spheres"]["ball"]["material"], "grey");
}

#[test]
fn notes_stand_in_the_order_in_which_files_were_opened() {
    let folder = folder(&[
        (
            "scene.xml",
            &format!(
                "<scene>\n<include filename='b.xml'/>{SENSOR}\n<include filename='a.xml'/>\n<foo/></scene>"
            ),
        ),
        ("a.xml", "<scene>\n<foo/>\n<include filename='b.xml'/></scene>"),
        ("b.xml", "<scene>\n\n<foo/>\n<foo/></scene>"),
    ]);
    let found = within(&folder).unwrap();
    let places: Vec<(&str, u32)> =
        found.notes.iter().map(|note| (note.file.rsplit('/').next().unwrap(), note.line)).collect();
    assert_eq!(places, [("scene.xml", 4), ("b.xml", 3), ("b.xml", 4), ("a.xml", 2)]);
}
