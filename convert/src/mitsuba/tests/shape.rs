//! Shapes and lights of small scenes.

use glam::Vec3;
use serde_json::{Value, json};

use super::{SENSOR, TRIANGLE, document, folder, near, notes, older, scene, within};
use crate::{Asset, Converted};

/// The same triangle without normals.
const BARE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
/// The same as PLY, without normals and with texture coordinates.
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    property float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 0.25\n3 0 1 2\n";

fn with_meshes(inner: &str) -> Converted {
    let text = format!("<scene version='3.0.0'>{SENSOR}{inner}</scene>");
    let files = [
        ("scene.xml", text.as_str()),
        ("n.obj", TRIANGLE),
        ("bare.obj", BARE),
        ("a.ply", PLY),
        ("i.png", ""),
    ];
    within(&folder(&files)).unwrap()
}

fn file(kind: &str, name: &str, inner: &str) -> String {
    format!("<shape type='{kind}' id='s'><string name='filename' value='{name}'/>{inner}</shape>")
}

const MIRROR: &str = "<transform name='to_world'><scale x='-1'/></transform>";
const FLAT: &str = "<boolean name='face_normals' value='true'/>";
const FLIP: &str = "<boolean name='flip_normals' value='true'/>";

#[test]
fn mirrored_meshes_keep_the_side_that_mitsuba_sees() {
    for (shape, flipped) in [
        (file("obj", "n.obj", ""), false),
        (file("obj", "n.obj", MIRROR), false),
        (file("obj", "n.obj", FLIP), true),
        (file("obj", "n.obj", &format!("{MIRROR}{FLAT}")), true),
        (file("obj", "n.obj", &format!("{MIRROR}{FLAT}{FLIP}")), false),
        (file("obj", "bare.obj", ""), false),
        (file("obj", "bare.obj", MIRROR), true),
        (format!("<shape type='rectangle' id='s'>{MIRROR}</shape>"), false),
        (format!("<shape type='cube' id='s'>{MIRROR}{FLIP}</shape>"), true),
        (format!("<shape type='disk' id='s'>{MIRROR}</shape>"), false),
        (format!("<shape type='cylinder' id='s'>{MIRROR}</shape>"), true),
        (format!("<shape type='sphere' id='s'>{MIRROR}</shape>"), true),
        (format!("<shape type='sphere' id='s'>{MIRROR}{FLIP}</shape>"), false),
    ] {
        let found = with_meshes(&shape).document;
        let table = if shape.contains("sphere") { "spheres" } else { "instances" };
        let thing = &found[table]["s"];
        assert!(thing.is_object(), "{shape}: {found}");
        assert_eq!(thing.get("flip_normals") == Some(&json!(true)), flipped, "{shape}");
    }
}

#[test]
fn meshes_without_normals_get_smooth_ones() {
    let found = with_meshes(&file("ply", "a.ply", ""));
    assert_eq!(found.document["meshes"], json!({"a": {"file": "meshes/a-smooth.ply"}}));
    let Asset::Bytes(bytes) = &found.assets["meshes/a-smooth.ply"] else { panic!() };
    let mesh = karst_core::mesh::read(bytes, "a.ply", 9).unwrap();
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    assert_eq!(mesh.uvs[2].to_array(), [0.0, 0.25]);
    let flat = with_meshes(&file("ply", "a.ply", FLAT)).document;
    assert_eq!(flat["meshes"], json!({"a": {"file": "meshes/a.ply", "face_normals": true}}));
}

#[test]
fn texture_coordinates_run_upwards() {
    let texture = "<bsdf type='diffuse'><texture name='reflectance' type='bitmap'><string name='filename' \
        value='i.png'/></texture></bsdf>";
    let flips = |shape: &str| {
        let found = with_meshes(shape).document;
        found["meshes"].as_object().unwrap().values().next().unwrap().get("flip_v").cloned()
    };
    let no = "<boolean name='flip_tex_coords' value='false'/>";
    let yes = "<boolean name='flipTexCoords' value='true'/>";
    assert_eq!(flips(&file("ply", "a.ply", texture)), Some(json!(true)));
    assert_eq!(flips(&file("ply", "a.ply", "")), None, "nobody looks");
    assert_eq!(flips(&file("ply", "a.ply", &format!("{texture}{yes}"))), None);
    assert_eq!(flips(&file("obj", "n.obj", texture)), None);
    assert_eq!(flips(&file("obj", "n.obj", &format!("{texture}{no}"))), Some(json!(true)));
    assert_eq!(flips(&format!("<shape type='rectangle'>{texture}</shape>")), None, "made with v upwards");
}

#[test]
fn spheres_stay_spheres_where_they_can() {
    let placed = "<shape type='sphere' id='s'><point name='center' x='1' y='2' z='3'/><float name='radius' value='0.1'/>";
    let found = document(&format!("{placed}</shape>"));
    assert_eq!(
        found["spheres"]["s"],
        json!({"center": [1.0, 2.0, 3.0], "radius": 0.1, "material": "default"})
    );
    let turned =
        "<transform name='to_world'><rotate z='1' angle='90'/><scale value='2'/></transform></shape>";
    let found = document(&format!("{placed}{turned}"));
    near(&found["spheres"]["s"]["center"][0], -4.0);
    near(&found["spheres"]["s"]["radius"], 0.2);
    let stretched =
        scene(&format!("{placed}<transform name='to_world'><scale x='2'/></transform></shape>")).unwrap();
    assert_eq!(stretched.document["instances"]["s"]["mesh"], "sphere");
    assert!(notes(&stretched)[0].contains("Differs a sphere that its transform stretches"));
    let board = "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'/></bsdf></shape>";
    let textured = scene(&format!("{placed}{board}")).unwrap().document;
    let matrix =
        json!([[0.1, 0.0, 0.0, 1.0], [0.0, 0.1, 0.0, 2.0], [0.0, 0.0, 0.1, 3.0], [0.0, 0.0, 0.0, 1.0]]);
    assert_eq!(textured["instances"]["s"]["transform"]["matrix"], matrix);
}

#[test]
fn cylinders_run_from_point_to_point() {
    let found = document(
        "<shape type='cylinder' id='s'><point name='p0' x='1'/><point name='p1' x='1' y='4'/><float name='radius' \
         value='0.5'/></shape>",
    );
    let rows: Vec<Vec<f64>> =
        serde_json::from_value(found["instances"]["s"]["transform"]["matrix"].clone()).unwrap();
    let column = |at: usize| [rows[0][at], rows[1][at], rows[2][at]];
    assert_eq!((column(2), column(3)), ([0.0, 4.0, 0.0], [1.0, 0.0, 0.0]));
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((length(column(0)) - 0.5).abs() < 1e-12 && (length(column(1)) - 0.5).abs() < 1e-12);
}

#[test]
fn shapes_share_meshes_and_have_names_of_their_own() {
    let two = "<shape type='rectangle' id='a.b'/><shape type='rectangle' id='a,b'/><shape type='cube'/><shape type='cube'/>";
    let found = scene(two).unwrap();
    let names: Vec<&String> = found.document["instances"].as_object().unwrap().keys().collect();
    assert_eq!(names, ["a_b", "a_b 2", "cube", "cube 2"]);
    assert_eq!(found.document["meshes"].as_object().unwrap().len(), 2);
    assert_eq!(found.assets.len(), 2);
}

#[test]
fn lights_become_these() {
    let light = |emitter: &str| {
        let found = document(emitter);
        found["lights"].as_object().unwrap().values().next().unwrap().clone()
    };
    let spot = "<emitter type='spot'><transform name='to_world'><translate y='3'/></transform><float name='cutoffAngle' \
        value='40'/></emitter>";
    let expected = json!({"type": "spotlight", "position": [0.0, 3.0, 0.0], "direction": [0.0, 0.0, 1.0],
        "intensity": [1.0, 1.0, 1.0], "beam_width": 30.0, "cutoff_angle": 40.0});
    assert_eq!(light(spot), expected);
    let sun = "<emitter type='directional'><transform name='to_world'><rotate x='1' angle='180'/></transform></emitter>";
    near(&light(sun)["direction"][2], -1.0);
    assert_eq!(light(sun)["angular_size"], 0.0);
    let constant = "<emitter type='constant'><rgb name='radiance' value='0.5 0.25 0'/></emitter>";
    assert_eq!(light(constant), json!({"type": "environment", "radiance": [0.5, 0.25, 0.0]}));
}

#[test]
fn what_is_missing_is_said_with_its_line() {
    let inner = "<medium type='homogeneous' id='fog'/>\n\
        <shape type='hair'/>\n\
        <bsdf type='phong' id='p'><float name='exponent' value='3'/></bsdf>\n\
        <shape type='sphere'><ref name='interior' id='fog'/><bsdf type='diffuse'><float name='shine' value='1'/></bsdf>\n\
        <emitter type='area'><texture name='radiance' type='checkerboard'/></emitter></shape>\n\
        <bsdf type='blendbsdf' id='b'><float name='weight' value='0.1'/><bsdf type='null'/><bsdf type='diffuse'/></bsdf>\n\
        <bsdf type='diffuse' id='d'><rgb name='reflectance' value='2 1 0'/></bsdf>\n\
        <foo bar='1'/>\n\
        <emitter type='sunsky'><float name='turbidity' value='3'/></emitter>\n\
        <integrator type='bdpt'><integer name='maxDepth' value='7'/></integrator>";
    let expected = [
        "3 Untranslated a shape of type \"hair\"",
        "4 Untranslated a bsdf of type \"phong\": a grey diffuse material stands in for it",
        "5 Untranslated float \"shine\" of a bsdf of type \"diffuse\"",
        "6 Untranslated a texture of type \"checkerboard\" as the radiance of a emitter of type \"area\": the shape does not \
         shine",
        "7 Untranslated a bsdf of type \"blendbsdf\": its first bsdf stands in for it",
        "8 Differs reflectance is 2, karst has 0 to 1: taken as 1",
        "9 Untranslated <foo>, which karst does not know",
        "10 Untranslated a emitter of type \"sunsky\"",
        "11 Differs a integrator of type \"bdpt\" is replaced by path tracing, which converges to the same picture",
    ];
    let found = scene(inner).unwrap();
    assert_eq!(notes(&found), expected);
    let lines: Vec<String> = found.notes.iter().map(ToString::to_string).collect();
    assert!(lines[0].ends_with("scene.xml:3: not translated: a shape of type \"hair\""));
    assert!(lines[5].contains("scene.xml:8: differs: reflectance"));
    assert_eq!(found.document["materials"]["b"], json!({"type": "null"}));
    assert_eq!(found.document["materials"]["d"]["reflectance"], json!([1.0, 1.0, 0.0]));
    assert_eq!(found.document["integrator"]["max_depth"], 7);
    let nothing: Option<&Value> = found.document.get("lights");
    assert!(nothing.is_none());
}

#[test]
fn shapes_without_a_material_get_that_of_their_version() {
    let lamp = "<emitter type='area'><rgb name='radiance' value='0'/></emitter>";
    let fog = "<medium type='homogeneous' name='interior'/>";
    let own = format!("{lamp}<bsdf type='diffuse'/>");
    let shade =
        |shade: f64| json!({"type": "diffuse", "reflectance": [shade, shade, shade], "two_sided": false});
    for (inner, new, old) in [
        ("", shade(0.5), shade(0.5)),
        (lamp, shade(0.0), shade(0.0)),
        (fog, shade(0.5), json!({"type": "null"})),
        (&format!("{fog}{lamp}"), shade(0.0), shade(0.0)),
        (&own, shade(0.5), shade(0.5)),
    ] {
        for (kind, table) in [("sphere", "spheres"), ("cube", "instances")] {
            let text = format!("<shape type='{kind}' id='s'>{inner}</shape>");
            for (found, expected) in [(scene(&text), &new), (older(&text), &old)] {
                let found = found.unwrap().document;
                let name = found[table]["s"]["material"].as_str().unwrap();
                assert_eq!(&found["materials"][name], expected, "{text}");
            }
        }
    }
}

#[test]
fn area_lights_belong_to_the_shapes_that_refer_to_them() {
    let lamp = "<emitter type='area' id='lamp'><rgb name='radiance' value='2'/></emitter>";
    let found = scene(&format!("{lamp}<shape type='sphere' id='s'><ref id='lamp'/></shape>")).unwrap();
    assert_eq!(found.document["spheres"]["s"]["emission"], json!([2.0, 2.0, 2.0]));
    assert!(found.document.get("lights").is_none());
    assert!(notes(&found).is_empty(), "{:?}", notes(&found));
    let alone = scene(lamp).unwrap();
    assert_eq!(notes(&alone), ["2 Untranslated a emitter of type \"area\" that no shape refers to"]);
}

#[test]
fn parts_of_mesh_files_are_said_to_be_missing() {
    let with = |inner: &str| notes(&with_meshes(&file("obj", "n.obj", inner)));
    let some = "<integer name='shapeIndex' value='0'/><boolean name='loadMaterials' value='true'/>";
    let expected = [
        "1 Untranslated shape_index: the whole file is placed, not one of its meshes",
        "1 Untranslated load_materials: the materials of the .mtl file",
    ];
    assert_eq!(with(some), expected);
    let whole = "<integer name='shapeIndex' value='-1'/><boolean name='loadMaterials' value='false'/>";
    assert!(with(whole).is_empty());
}

#[test]
fn hot_bodies_shine_in_both_versions() {
    let spectrum =
        "<spectrum type='blackbody' name='intensity'><float name='temperature' value='5000'/></spectrum>";
    let point = |light: &str| format!("<emitter type='point' id='l'>{light}</emitter>");
    let new = scene(&point(spectrum)).unwrap();
    let black = |attributes: &str| older(&point(&format!("<blackbody name='intensity' {attributes}/>")));
    let old = black("temperature=' 5000 K' scale='0.001'").unwrap();
    assert!(notes(&new).is_empty() && notes(&old).is_empty(), "{:?} {:?}", notes(&new), notes(&old));
    let intensity = |found: &Converted| -> [f64; 3] {
        serde_json::from_value(found.document["lights"]["l"]["intensity"].clone()).unwrap()
    };
    let (new, old) = (intensity(&new), intensity(&old));
    assert!(new[0] > new[1] && new[1] > new[2] && new[2] > 1000.0, "{new:?}");
    for (new, old) in new.into_iter().zip(old) {
        assert!((old / new - 0.001).abs() < 1e-9, "{old} {new}");
    }
    for (attributes, expected) in [
        ("", "found <blackbody> without \"temperature\""),
        ("temperature='hot'", "found \"hot\", expected a number"),
        ("temperature='-3K'", "found a temperature of -3 K, expected one above 0"),
    ] {
        let error = black(attributes).unwrap_err();
        assert!(error.starts_with(&format!("DIR/scene.xml:2: {expected}")), "{attributes}: {error}");
    }
    let varying = spectrum.replace(
        "<float name='temperature' value='5000'/>",
        "<texture name='temperature' type='checkerboard'/>",
    );
    let dark = scene(&point(&varying)).unwrap();
    assert_eq!(
        notes(&dark),
        [
            "2 Untranslated a spectrum of type \"blackbody\" as the intensity of a emitter of type \"point\": it does not shine"
        ]
    );
    assert_eq!(intensity(&dark), [0.0; 3]);
}

#[test]
fn outer_rows_of_images_of_the_sky_lie_as_in_their_version() {
    for (version, at_poles) in [("3.0.0", true), ("0.6.0", false)] {
        let text = format!(
            "<scene version='{version}'>{SENSOR}<emitter type='envmap' id='sky'><string name='filename' value='i.png'/>\
             </emitter></scene>"
        );
        let found = within(&folder(&[("scene.xml", &text), ("i.png", "")])).unwrap();
        assert_eq!(found.document["lights"]["sky"]["rows_at_poles"], at_poles, "{version}");
    }
}

#[test]
fn normal_maps_whose_y_points_the_other_way_are_told() {
    let map = "<bsdf type='normalmap'><texture name='normalmap' type='bitmap'><string name='filename' value='i.png'/>\
        <boolean name='raw' value='true'/></texture><bsdf type='diffuse'/></bsdf>";
    let here = Some("here");
    for (kind, inner, expected) in [
        ("rectangle", "", here),
        ("rectangle", MIRROR, None),
        ("rectangle", FLIP, None),
        ("rectangle", &format!("{MIRROR}{FLIP}"), here),
        ("disk", "", here),
        ("cylinder", "", here),
        ("cylinder", MIRROR, here),
        ("cube", "", None),
        ("cube", MIRROR, here),
        ("sphere", "", None),
        ("sphere", MIRROR, None),
        ("sphere", FLIP, here),
        ("obj", "", Some("where texture coordinates are mirrored")),
    ] {
        let name = if kind == "obj" { "<string name='filename' value='n.obj'/>" } else { "" };
        let found = |material: &str| -> Vec<String> {
            let shape = format!("<shape type='{kind}'>{name}{inner}{material}</shape>");
            let all = notes(&with_meshes(&shape));
            all.into_iter().filter(|note| note.contains("normal map")).collect()
        };
        let start = "1 Differs y of a normal map runs along v, in Mitsuba along the normal × u, which is the other way";
        let expected: Vec<String> = expected.map(|place| format!("{start} {place}")).into_iter().collect();
        assert_eq!(found(map), expected, "{kind} {inner}");
        assert!(found("").is_empty());
    }
}

#[test]
fn media_are_kept() {
    let fog = "<rgb name='sigma_t' value='1 2 4'/><rgb name='albedo' value='0.5 0.25 0.75'/><float name='scale' value='3'/>";
    let inner = format!(
        "<medium type='homogeneous' id='fog'>{fog}<phase type='hg'><float name='g' value='0.995'/></phase></medium>\n\
         <medium type='heterogeneous' id='smoke'/>\n\
         <medium type='homogeneous' id='ink'><rgb name='sigmaA' value='1 1 1'/><rgb name='sigmaS' value='0 0 0'/></medium>\n\
         <shape type='sphere' id='s'><ref name='interior' id='ink'/><ref name='exterior' id='fog'/></shape>\n\
         <shape type='cube' id='c'><ref name='interior' id='smoke'/></shape>"
    );
    let found = scene(&inner).unwrap();
    let document = &found.document;
    assert_eq!(
        document["media"]["fog"],
        json!({"sigma_a": [0.5, 1.5, 1.0], "sigma_s": [0.5, 0.5, 3.0], "density": 3.0, "g": 0.99})
    );
    assert_eq!(document["media"]["ink"], json!({"sigma_a": [1.0, 1.0, 1.0], "sigma_s": [0.0, 0.0, 0.0]}));
    assert_eq!(document["spheres"]["s"]["interior"], "ink");
    assert_eq!(document["instances"]["c"].get("interior"), None);
    assert_eq!(
        notes(&found),
        [
            "2 Differs g is 0.995, karst has -0.99 to 0.99: taken as 0.99",
            "3 Untranslated a medium of type \"heterogeneous\"",
            "5 Untranslated the medium \"fog\" around a shape: neither the sensor nor a shape is in it",
        ]
    );
}
