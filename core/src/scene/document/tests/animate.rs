//! Owns the tests of animation.

use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::{check, parse, scene};
use crate::scene::document::{Camera, Description, SdfNode};

const STONE: &str = r#""materials":{"m":{"type":"diffuse"}},
"spheres":{"lamp":{"center":[0,0,0],"radius":1,"material":"m","emission":[0,0,0]}},
"sdf_objects":{"o":{"material":"m","tree":{"type":"mandelbulb","power":8,"iterations":9}}},
"#;

/// A scene with tracks on line 5, over the frames 0 to 10.
fn animated(tracks: &str) -> String {
    scene(&format!(r#"{STONE}"animation":{{"frames":[0,10],"tracks":{{{tracks}}}}}"#))
}

/// A scene with a track on line 5.
fn track(path: &str, rest: &str) -> String {
    animated(&format!(r#""{path}":{{{rest}}}"#))
}

fn at(text: &str, frame: i32) -> Description {
    parse(text).at(frame).unwrap_or_else(|problems| panic!("{problems}"))
}

#[test]
fn numbers_and_vectors_change() {
    let text = animated(
        r#""spheres.lamp.radius":{"interpolation":"step","keys":[{"frame":2,"value":1},{"frame":4,"value":3}]},
        "spheres.lamp.emission":{"keys":[{"frame":2,"value":[0,0,8]},{"frame":6,"value":[4,0,0]}]}"#,
    );
    for (frame, radius, emission) in [
        (-7, 1.0, [0.0, 0.0, 8.0]),
        (2, 1.0, [0.0, 0.0, 8.0]),
        (3, 1.0, [1.0, 0.0, 6.0]),
        (4, 3.0, [2.0, 0.0, 4.0]),
        (6, 3.0, [4.0, 0.0, 0.0]),
        (99, 3.0, [4.0, 0.0, 0.0]),
    ] {
        let scene = at(&text, frame);
        let lamp = scene.spheres.get("lamp").unwrap();
        assert_eq!((lamp.radius, lamp.emission), (radius, Vec3::from(emission)), "frame {frame}");
    }
    let frames = parse(&text).frames();
    assert_eq!((frames.first, frames.last, frames.count(), frames.fps), (0, 10, 11, 24.0));
}

/// The camera's transform at a frame, when its track has these keys.
fn camera(base: &str, path: &str, keys: &str, frame: i32) -> DAffine3 {
    let text = format!(
        r#"{{"version":1,"film":{{"width":8,"height":6}},
        "camera":{{"type":"perspective","vfov":40,"transform":{base}}},
        "animation":{{"frames":[0,10],"tracks":{{"{path}":{{"keys":{keys}}}}}}}}}"#
    );
    let Camera::Perspective { transform, .. } = at(&text, frame).camera;
    transform
}

#[test]
fn transforms_change() {
    let near = |a: DAffine3, b: DAffine3| assert!(a.abs_diff_eq(b, 1.0e-12), "{a} {b}");
    let keys = r#"[{"frame":0,"value":{"look_at":{"eye":[0,0,4],"target":[0,0,0]}}},
        {"frame":10,"value":{"look_at":{"eye":[0,0,8],"target":[0,0,0]}}}]"#;
    let map = camera(r#"{"scale":1}"#, "camera.transform", keys, 5);
    near(map, DAffine3::from_translation(DVec3::new(0.0, 0.0, 6.0)));
    let map = camera(
        r#"{"rotate":[0,0,0]}"#,
        "camera.transform.rotate",
        r#"[{"frame":0,"value":[0,0,0]},{"frame":10,"value":[0,0,90]}]"#,
        5,
    );
    near(map, DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_4));
    // Matrices: half of a quarter turn about z, half way from scale 1 to 3 and from x = 0 to 8.
    let from = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let to = "[[0,-3,0,8],[3,0,0,0],[0,0,3,0],[0,0,0,1]]";
    let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
    let expected = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::X * 4.0);
    let keys = format!(r#"[{{"frame":0,"value":{from}}},{{"frame":10,"value":{to}}}]"#);
    near(camera(&format!(r#"{{"matrix":{from}}}"#), "camera.transform.matrix", &keys, 5), expected);
    let keys =
        format!(r#"[{{"frame":0,"value":{{"matrix":{from}}}}},{{"frame":10,"value":{{"matrix":{to}}}}}]"#);
    near(camera("{\"scale\":1}", "camera.transform", &keys, 5), expected);
    // The mirrored turn of a mirrored matrix stays mirrored on its way.
    let mirror = "[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let turned = "[[0,-1,0,0],[-1,0,0,0],[0,0,1,0],[0,0,0,1]]";
    let keys = format!(r#"[{{"frame":0,"value":{mirror}}},{{"frame":10,"value":{turned}}}]"#);
    let map = camera(&format!(r#"{{"matrix":{mirror}}}"#), "camera.transform.matrix", &keys, 5);
    assert!((map.matrix3.determinant() + 1.0).abs() < 1.0e-12, "{map}");
}

#[test]
fn integers_step() {
    let path = "sdf_objects.o.tree.iterations";
    let text = track(path, r#""interpolation":"step","keys":[{"frame":0,"value":8},{"frame":10,"value":4}]"#);
    let SdfNode::Mandelbulb { iterations, .. } = at(&text, 9).sdf_objects.get("o").unwrap().tree else {
        panic!()
    };
    assert_eq!(iterations, 8);
    check(
        &track(path, r#""keys":[{"frame":0,"value":①8},{"frame":10,"value":②4}]"#),
        "\
① sdf_objects.o.tree.iterations: found linear interpolation between integers (at frame 0)
  hint: an integer changes by \"interpolation\": \"step\"
② sdf_objects.o.tree.iterations: found linear interpolation between integers (at frame 10)
  hint: an integer changes by \"interpolation\": \"step\"",
    );
}

#[test]
fn targets() {
    let keys = r#""keys":[{"frame":1,"value":1}]"#;
    let fixed = "hint: the same in all frames: version, sampling, meshes, animation, film.width, film.height, \
                 film.crop, files and names";
    let fixed = |path: &str| format!("found {path:?}, which cannot be animated\n  {fixed}");
    let unwritten = "found no such value in the document\n  hint: a track changes a value that the document contains: \
                     write its field there";
    let kind =
        |kind: &str| format!("found the path of {kind}, expected that of a number, a vector or a transform");
    let meant = |path: &str| format!("found no such value in the document\n  hint: did you mean {path:?}?");
    for (path, expected) in [
        ("film.width", fixed("film.width")),
        ("film.crop.x", fixed("film.crop.x")),
        ("sampling.spp", fixed("sampling.spp")),
        ("version", fixed("version")),
        ("spheres.lmap.radius", meant("spheres.lamp.radius")),
        ("spheres.lamp.raduis", meant("spheres.lamp.radius")),
        ("sphere.lamp.radius", meant("spheres.lamp.radius")),
        ("film.exposure", unwritten.to_owned()),
        ("", unwritten.to_owned()),
        ("spheres.lamp.center.x", unwritten.to_owned()),
        ("spheres.lamp.material", kind("a string")),
        ("camera.type", kind("a string")),
        ("spheres.lamp", kind("an object that is no transform")),
    ] {
        let text = animated(&format!(r#"①"{path}":{{{keys}}}"#));
        check(&text, &format!("① animation.tracks.{path}: {expected}"));
    }
}

#[test]
fn keys() {
    let shape = "found a value of another shape than that of the key before\n  \
                 hint: both keys need the same fields and lengths, or use \"step\"";
    for (keys, expected) in [
        ("①[]", "① keys: found a list of 0, expected a list of at least 1"),
        (
            r#"[{"frame":1,"value":[0,0,0]},{"frame":①1,"value":[0,0,0]}]"#,
            "① keys[1].frame: found frame 1 after frame 1, expected a later one",
        ),
        (r#"[{"frame":1,"value":[0,0,0]},{"frame":2,"value":①5}]"#, "① keys[1].value: SHAPE"),
        (r#"[{"frame":1,"value":[0,0,-1]},{"frame":30,"value":①[0,0]}]"#, "① keys[1].value: SHAPE"),
        (
            r#"[{"frame":①1.5,"value":[0,0,②1e999]},{"frame":2,"value":[③"a"]}]"#,
            "① keys[0].frame: found 1.5, expected an integer from -100000000 to 100000000\n\
             ② keys[0].value[2]: found 1e999, expected a finite number\n\
             ③ keys[1].value[0]: found \"a\", expected a number, a vector or a transform",
        ),
    ] {
        let tracks = "animation.tracks.spheres.lamp.emission.";
        let expected = expected.replace("SHAPE", shape).replace(" keys", &format!(" {tracks}keys"));
        check(&track("spheres.lamp.emission", &format!(r#""keys":{keys}"#)), &expected);
    }
    // Values are checked where they go, once each, in all frames and beyond them.
    check(
        &track(
            "spheres.lamp.emission",
            r#""keys":[{"frame":1,"value":[0,0,①-1]},{"frame":30,"value":[0,0,②-2]}]"#,
        ),
        "\
① spheres.lamp.emission[2]: found -1, expected a number of at least 0 (at frame 0)
② spheres.lamp.emission[2]: found -2, expected a number of at least 0 (at frame 30)",
    );
}

#[test]
fn matrices_that_have_no_way_between_them() {
    let keys = |from: &str, to: &str| {
        format!(
            r#"{{"version":1,"film":{{"width":8,"height":6}},
"camera":{{"type":"perspective","vfov":40,"transform":{{"scale":1}}}},
"animation":{{"frames":[0,10],"tracks":{{"camera.transform":{{"keys":[
{{"frame":0,"value":{{"matrix":{from}}}}},
{{"frame":10,"value":②{{"matrix":{to}}}}}]}}}}}}}}"#
        )
    };
    let one = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let place = "② animation.tracks.camera.transform.keys[1].value:";
    check(
        &keys(one, "[[1,0.1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"),
        &format!(
            "{place} found a sheared or singular matrix, which cannot be interpolated\n  hint: write translate, rotate \
             and scale, or use \"step\""
        ),
    );
    check(
        &keys(one, "[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"),
        &format!(
            "{place} found a mirrored matrix next to one that is not\n  hint: mirror both keys or none, or use \"step\""
        ),
    );
}

#[test]
fn frames_between_keys_are_checked() {
    let text = format!(
        r#"{{"version":1,"film":{{"width":8,"height":6}},
"camera":{{"type":"perspective","vfov":40,"transform":{{"scale":1}}}},
"animation":{{"frames":[0,10],"tracks":{{"camera.transform.scale":{{"keys":[
{{"frame":0,"value":①-1}},{{"frame":10,"value":1}}]}}}}}}}}"#
    );
    check(&text, "① camera.transform.scale: found 0, expected a number other than 0 (at frame 5)");
}

#[test]
fn tracks_do_not_overlap() {
    let keys = r#"{"keys":[{"frame":1,"value":[0,0,0]}]}"#;
    let object = r#"{"keys":[{"frame":1,"value":{"scale":2}}]}"#;
    let text = format!(
        r#"{{"version":1,"film":{{"width":8,"height":6}},
"camera":{{"type":"perspective","vfov":40,"transform":{{"translate":[0,0,0]}}}},
"animation":{{"frames":[0,10],"tracks":{{
①"camera.transform.translate":{keys},
"camera.transform":{object}}}}}}}"#
    );
    check(
        &text,
        "① animation.tracks.camera.transform.translate: changes a part of what the track \
         \"camera.transform\" changes\n  hint: merge the two tracks",
    );
}

#[test]
fn a_film_of_many_keys_stays_fast() {
    let keys: Vec<String> =
        (0..2000).map(|frame| format!(r#"{{"frame":{frame},"value":[{frame},0,1]}}"#)).collect();
    let text = animated(&format!(r#""spheres.lamp.center":{{"keys":[{}]}}"#, keys.join(",")));
    assert_eq!(at(&text, 1234).spheres.get("lamp").unwrap().center, Vec3::new(1234.0, 0.0, 1.0));
}
