//! Owns the tests of what is said about documents that are wrong.

use super::{check, scene};
use crate::scene::document::{Document, Limits};

/// Checks what is wrong with a scene that has these members too; they begin on line 2.
#[track_caller]
fn wrong(rest: &str, expected: &str) {
    check(&scene(rest), expected);
}

#[test]
fn text_that_is_no_json() {
    for (text, expected) in [
        ("", "scene.json:1:1: found nothing, expected a JSON object"),
        ("[1, 2", "scene.json:1:1: not JSON: unterminated array"),
        ("{\"a\": 1,}", "scene.json:1:8: not JSON: trailing commas are not allowed"),
        ("{} // done", "scene.json:1:4: not JSON: comments are not allowed"),
        ("{\"a\" 1}", "scene.json:1:6: not JSON: expected colon after the string or word in object property"),
        ("{'a': 1}", "scene.json:1:2: not JSON: single-quoted strings are not allowed"),
        (
            "{\"a\": .5}",
            "scene.json:1:7: not JSON: leading or trailing decimal points on numbers are not allowed",
        ),
        ("{\n\"é\": NaN}", "scene.json:2:6: not JSON: unexpected token"),
        ("{} {}", "scene.json:1:4: not JSON: text cannot contain more than one JSON value"),
        ("[]", "scene.json:1:1: found a list of 0, expected a scene object"),
        ("7", "scene.json:1:1: found 7, expected a scene object"),
    ] {
        check(text, expected);
    }
}

#[test]
fn all_problems_at_once() {
    check(
        r#"{
  "version": ②2,
  "camera": { "type": ③"perspectiv", "vfov": 40 },
  "film": { "width": ⑤0, "height": ⑥1.5, ④"widht": 640, "view": ⑦"Filmic" },
  "spheres": { "lamp": { "center": [0, ⓐ"up", ⓑ1e999], "radius": ⓒ-1, ①"radius": 1, "material": ⓓ"stne" } },
  "materials": { "stone": { "type": "diffuse", "reflectance": [⑧2, 0, ⑨-1] } }
}"#,
        "\
① spheres.lamp.radius: found the name a second time, it stands at 5:54 already
② version: found 2, expected an integer from 1 to 1
③ camera.type: found \"perspectiv\", expected a camera type
  hint: did you mean \"perspective\"?
④ film.widht: unknown field of film
  hint: did you mean \"width\"?
⑤ film.width: found 0, expected an integer from 1 to 65536
⑥ film.height: found 1.5, expected an integer from 1 to 65536
⑦ film.view: found \"Filmic\", expected \"standard\" or \"filmic\"
  hint: did you mean \"filmic\"?
⑧ materials.stone.reflectance[0]: found 2, expected a number from 0 to 1
⑨ materials.stone.reflectance[2]: found -1, expected a number from 0 to 1
ⓐ spheres.lamp.center[1]: found \"up\", expected a number
ⓑ spheres.lamp.center[2]: found 1e999, expected a finite number
ⓒ spheres.lamp.radius: found -1, expected a number above 0
ⓓ spheres.lamp.material: found \"stne\", expected the name of a material
  hint: did you mean \"stone\"?",
    );
}

#[test]
fn what_is_missing() {
    check(
        "①{}",
        "\
① version: found nothing, expected an integer from 1 to 1
① camera: found nothing, expected a camera object
① film: found nothing, expected a film object",
    );
    wrong(
        r#""lights":{"sky":③{}},"sdf_objects":{"a":①{"tree":②{"type":"transform"}}}"#,
        "\
① sdf_objects.a.material: found nothing, expected the name of a material
② sdf_objects.a.tree.child: found nothing, expected an SDF node object
③ lights.sky.type: found nothing, expected the type of the light
  hint: light types: environment, point, spotlight, sun",
    );
}

#[test]
fn names_and_references() {
    wrong(
        r#""spheres":{①"a.b":{"center":[0,0,0],"radius":1,"material":②"x"},③"":④{}}"#,
        "\
① spheres.a.b: expected a name of 1 to 128 letters, digits, '_', '-' and spaces
  hint: animation addresses things by their names, joined with '.'
② spheres.a.b.material: found \"x\", expected the name of a material
  hint: add it to \"materials\"
③ spheres.: expected a name of 1 to 128 letters, digits, '_', '-' and spaces
  hint: animation addresses things by their names, joined with '.'
④ spheres..center: found nothing, expected a list of 3 numbers
④ spheres..radius: found nothing, expected a number above 0
④ spheres..material: found nothing, expected the name of a material",
    );
    wrong(
        r#""materials":{"m":{"type":"diffuse"}},"instances":{"a":{"mesh":①"m","material":"m"}}"#,
        "① instances.a.mesh: found \"m\", expected the name of a mesh\n  hint: add it to \"meshes\"",
    );
}

#[test]
fn types() {
    wrong(
        r#""materials":④[],"integrator":{"max_depth":②"16","roulette_depth":③null},
        "lights":{"a":⑤true},"sampling":①4"#,
        "\
① sampling: found 4, expected a sampling object
② integrator.max_depth: found \"16\", expected an integer from 1 to 1024
③ integrator.roulette_depth: found null, expected an integer from 1 to 1024
④ materials: found a list of 0, expected an object with a name for each entry
⑤ lights.a: found true, expected a light object",
    );
    wrong(
        r#""materials":{"a":{"type":"diffuse","reflectance":①0.5},"b":{"type":"diffuse","reflectance":②[1,1]}}"#,
        "\
① materials.a.reflectance: found 0.5, expected a list of 3 numbers, each from 0 to 1 or a texture object
② materials.b.reflectance: found a list of 2, expected a list of 3 numbers, each from 0 to 1",
    );
}

#[test]
fn numbers_beyond_single_precision() {
    wrong(
        r#""materials":{"m":{"type":"diffuse"}},
        "spheres":{"s":{"center":[①1e39,0,0],"radius":②1e-60,"material":"m"}}"#,
        "\
① spheres.s.center[0]: found 1e39, which single precision rounds to inf
② spheres.s.radius: found 1e-60, which single precision rounds to 0",
    );
}

#[test]
fn paths_of_files() {
    let hint =
        "\n  hint: put the file in the document's folder or below and name it relative to the document";
    let long = format!("{}.obj", "a/".repeat(300));
    let parts = "no part of a path is empty, '.' or '..'";
    for (path, expected) in [
        ("../m.obj", format!("found \"../m.obj\", {parts}{hint}")),
        ("a/../../m.obj", format!("found \"a/../../m.obj\", {parts}{hint}")),
        ("/etc/m.obj", format!("found \"/etc/m.obj\", a path is relative to the document{hint}")),
        ("C:m.obj", format!("found \"C:m.obj\", a path is relative to the document{hint}")),
        ("a//m.obj", format!("found \"a//m.obj\", {parts}{hint}")),
        ("./m.obj", format!("found \"./m.obj\", {parts}{hint}")),
        (r"a\\m.obj", format!("found \"a\\\\m.obj\", the parts of a path are separated by '/'{hint}")),
        (r"m\u0000.obj", format!("found \"m\\0.obj\", a path has no control characters{hint}")),
        ("", format!("found \"\", a path has 1 to 512 bytes{hint}")),
        (&long, format!("found {:?}, a path has 1 to 512 bytes{hint}", format!("{}…", &long[..64]))),
        ("m.gltf", "found \"m.gltf\", expected the path of a mesh file (.obj or .ply)".to_owned()),
        ("obj", "found \"obj\", expected the path of a mesh file (.obj or .ply)".to_owned()),
    ] {
        wrong(&format!(r#""meshes":{{"m":{{"file":①"{path}"}}}}"#), &format!("① meshes.m.file: {expected}"));
    }
}

#[test]
fn films() {
    for (written, expected) in [
        (
            r#"①{"width":65536,"height":32768}"#,
            "film: found 65536 x 32768 = 2147483648 pixels, the limit is 268435456",
        ),
        (
            r#"{"width":①4294967296,"height":1}"#,
            "film.width: found 4294967296, expected an integer from 1 to 65536",
        ),
        (
            r#"{"width":8,"height":8,"crop":①{"x":4,"y":0,"width":5,"height":8}}"#,
            "film.crop: found a crop to (9, 8) of a film of 8 x 8",
        ),
        (
            r#"{"width":8,"height":8,"crop":{"x":0,"y":0,"width":①0,"height":8}}"#,
            "film.crop.width: found 0, expected an integer from 1 to 65536",
        ),
        (
            r#"{"width":8,"height":8,"filter":{"type":①"gauss","radius":2}}"#,
            "film.filter.type: found \"gauss\", expected a filter type\n  \
             hint: filter types: box, gaussian, blackman_harris",
        ),
    ] {
        let text = format!(r#"{{"version":1,"camera":{{"type":"perspective","vfov":40}},"film":{written}}}"#);
        check(&text, &format!("① {expected}"));
    }
}

#[test]
fn sampling() {
    for (written, expected) in [
        (
            r#"{"spp":①4,"target_error":0.1}"#,
            "① sampling.spp: found together with \"target_error\", expected one of them\n  \
             hint: with \"target_error\" use \"min_spp\" and \"max_spp\"",
        ),
        (
            r#"{"max_spp":①4}"#,
            "① sampling.max_spp: has a meaning only with \"target_error\"\n  \
             hint: give \"target_error\" too, or \"spp\" instead",
        ),
        (r#"①{"target_error":0.1,"max_spp":16}"#, "① sampling: found max_spp 16 below min_spp 32"),
        (r#"{"spp":①0}"#, "① sampling.spp: found 0, expected an integer from 1 to 16777216"),
        (r#"{"seed":①-1}"#, "① sampling.seed: found -1, expected an integer from 0 to 4294967295"),
        (
            r#"{"target_error":①0,"time_limit":②-5}"#,
            "① sampling.target_error: found 0, expected a number above 0 and of at most 1000000\n\
             ② sampling.time_limit: found -5, expected a number above 0 and of at most 1000000000",
        ),
    ] {
        wrong(&format!(r#""sampling":{written}"#), expected);
    }
}

#[test]
fn transforms() {
    let singular = ": found a singular transform, expected one with an inverse\n  \
                    hint: a transform must not flatten or blow up what it places";
    let direction = ".look_at: found no direction: \"eye\" and \"target\" coincide, or \"up\" is along the line of \
                     sight\n  hint: move \"target\", or give another \"up\" such as [0, 0, 1]";
    for (written, expected) in [
        (r#"{"scale":①0}"#, ".scale: found 0, expected a number other than 0"),
        (r#"{"scale":[1,①0,1]}"#, ".scale[1]: found 0, expected a number other than 0"),
        (r#"①{"scale":1e-200}"#, singular),
        (r#"①{"matrix":[[1,0,0,0],[0,1,0,0],[1,1,0,0],[0,0,0,1]]}"#, singular),
        (
            r#"{"matrix":[[1,0,0,0],[0,1,0,0],[1,1,0,0],①[0,0,1,1]]}"#,
            ".matrix[3]: found another last row than [0, 0, 0, 1]",
        ),
        (
            r#"{"matrix":①[[1,0,0,0],[0,1,0,0],[1,1,0]]}"#,
            ".matrix: found a list of 3, expected a list of 4 rows, each a list of 4 numbers",
        ),
        (
            r#"{"matrix":[[1,0,0,0],[0,1,0,0],[1,1,①"",0],[0,0,0,1]]}"#,
            ".matrix[2][2]: found \"\", expected a number",
        ),
        (r#"{"look_at":①{"eye":[1,1,1],"target":[1,1,1]}}"#, direction),
        (r#"{"look_at":①{"eye":[0,0,0],"target":[0,1,0]}}"#, direction),
        (
            r#"{①"translation":[0,0,0]}"#,
            ".translation: unknown field of transform components\n  hint: did you mean \"translate\"?",
        ),
        (
            r#"{"matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]],①"scale":2}"#,
            ".scale: unknown field of transform by matrix\n  hint: fields of transform by matrix: matrix",
        ),
    ] {
        let text = format!(
            r#"{{"version":1,"film":{{"width":8,"height":6}},
"camera":{{"type":"perspective","vfov":40,"transform":{written}}}}}"#
        );
        check(&text, &format!("① camera.transform{expected}"));
    }
}

#[test]
fn distance_functions() {
    for (written, expected) in [
        (
            r#""tree":{"type":"union","children":①{}}"#,
            "① tree.children: found no entries, expected at least 1",
        ),
        (
            r#""tree":{"type":"smooth_union","k":①-0.5,"children":{"a":{"type":"sphere","radius":②0}}}"#,
            "① tree.k: found -0.5, expected a number from 0 to 1e12\n\
             ② tree.children.a.radius: found 0, expected a number from 1e-12 to 1e12",
        ),
        (
            r#""tree":{"type":"mandelbulb","power":①1.5,"iterations":②2.5}"#,
            "① tree.power: found 1.5, expected a number from 2 to 64\n\
             ② tree.iterations: found 2.5, expected an integer from 1 to 256",
        ),
        (
            r#""settings":{"max_steps":②-3,"hit_epsilon":①"automatic"},"tree":{"type":"box","size":[1,1,1]}"#,
            "① settings.hit_epsilon: found \"automatic\", expected a number above 0 or \"auto\"\n\
             ② settings.max_steps: found -3, expected an integer from 1 to 65536 or \"auto\"",
        ),
        (
            r#""bounds":①{"min":[0,0,0],"max":[1,0,1]},"tree":{"type":"box","size":[1,②1e-60,1]}"#,
            "① bounds: found \"min\" that is not below \"max\" in every axis\n\
             ② tree.size[1]: found 1e-60, expected a number from 1e-12 to 1e12",
        ),
        (
            r#""tree":②{"type":"torus","major_radius":1,①"minor":0.2}"#,
            "① tree.minor: unknown field of torus SDF node\n  \
             hint: fields of torus SDF node: type, major_radius, minor_radius\n\
             ② tree.minor_radius: found nothing, expected a number from 1e-12 to 1e12",
        ),
    ] {
        let object = format!(r#""sdf_objects":{{"o":{{"material":"m",{written}}}}}"#);
        let expected = expected.replace("① ", "① sdf_objects.o.").replace("② ", "② sdf_objects.o.");
        wrong(&format!(r#""materials":{{"m":{{"type":"diffuse"}}}},{object}"#), &expected);
    }
}

#[test]
fn long_values_are_cut() {
    let long = "x".repeat(5000);
    let found = super::problems(&scene(&format!(r#""{long}":{{"{long}":1}},"sampling":"{long}""#)));
    assert!(found.len() < 700 && found.contains('…'), "{} {found}", found.len());
}

#[test]
fn the_first_fifty_are_kept_and_all_are_counted() {
    let many: Vec<String> = (0..80).map(|index| format!(r#""a{index}":1"#)).collect();
    let text = scene(&many.join(","));
    let found = Document::parse(&text, "s", &Limits::default()).unwrap_err();
    assert_eq!((found.problems.len(), found.total), (50, 80));
    assert!(found.to_string().ends_with("\nand 30 more"), "{found}");
}
