//! Bad scenes: an error that says where and what, no panic, no hang.

use std::fmt::Write as _;

use super::{SENSOR, folder, scene, within};

#[test]
fn bad_values_are_refused_with_their_line() {
    for (inner, expected) in [
        (
            "<shape type='sphere'><float name='radius' value='big'/></shape>",
            "scene.xml:2: found \"big\", expected a number",
        ),
        (
            "<shape type='sphere'><float name='radius' value='$r'/></shape>",
            "scene.xml:2: found \"$r\", expected a variable",
        ),
        (
            "\n<shape type='sphere'><ref id='gray'/></shape><bsdf type='diffuse' id='grey'/>",
            "scene.xml:3: found a reference to \"gray\", expected the id of an object\n  hint: the nearest id is \"grey\"",
        ),
        (
            "<bsdf type='diffuse' id='a'/>\n<bsdf type='diffuse' id='a'/>",
            "scene.xml:3: found the id \"a\", which the object at DIR/scene.xml:2 has",
        ),
        ("<shape type='ply'/>", "scene.xml:2: found a shape of type \"ply\" without \"filename\""),
        (
            "<shape type='ply'><string name='filename' value='no.ply'/></shape>",
            "scene.xml:2: found the file \"no.ply\", which does not exist",
        ),
        (
            "<shape type='ply'><string name='filename' value='scene.xml'/></shape>",
            "scene.xml:2: found the file \"scene.xml\", expected a name that ends in .ply",
        ),
        (
            "<shape type='sphere'><string name='radius' value='1'/></shape>",
            "scene.xml:2: found a string as \"radius\" of a shape of type \"sphere\", expected a number",
        ),
        (
            "<shape type='cube'><transform name='to_world'><scale x='0'/></transform></shape>",
            "scene.xml:2: found a transform that cannot be inverted",
        ),
        (
            "<shape type='cube'><transform name='to_world'><rotate angle='3'/></transform></shape>",
            "scene.xml:2: found a rotation about no axis",
        ),
        (
            "<bsdf type='dielectric' id='g'><string name='int_ior' value='glas'/></bsdf>",
            "scene.xml:2: found the substance \"glas\", expected a number or one of vacuum",
        ),
        (
            "<bsdf type='dielectric' id='g'><float name='int_ior' value='0'/></bsdf>",
            "scene.xml:2: found 0 as \"int_ior\"",
        ),
        (
            "<bsdf type='twosided' id='t'/>",
            "scene.xml:2: found a bsdf of type \"twosided\" without a bsdf in it",
        ),
        (
            "<bsdf type='diffuse' id='t'><string name='reflectance' value='red'/></bsdf>",
            "scene.xml:2: found a string as \"reflectance\", expected a colour",
        ),
        (
            "<emitter type='spot'><float name='beam_width' value='30'/></emitter>",
            "scene.xml:2: found a beam_width of 30 and a cutoff_angle of 20",
        ),
        (
            "<emitter type='directional'><vector name='direction' value='0'/></emitter>",
            "scene.xml:2: found the direction 0 0 0",
        ),
        (
            "<integrator type='path'><integer name='max_depth' value='-2'/></integrator>",
            "scene.xml:2: found -2 as \"max_depth\"",
        ),
        ("<include filename='no.xml'/>", "scene.xml:2: found the file \"no.xml\", which does not exist"),
        ("<include/>", "scene.xml:2: found <include> without \"filename\""),
        ("<path value='nowhere'/>", "scene.xml:2: found the folder \"nowhere\", which does not exist"),
        ("<alias id='a' as='b'/>", "scene.xml:2: found an alias of \"a\""),
        (
            "<bsdf type='twosided' id='a'><ref id='a'/></bsdf>",
            "scene.xml:2: found objects that refer to each other in a circle",
        ),
        (
            "<bsdf type='mask' id='a'><ref id='b'/></bsdf><bsdf type='mask' id='b'><ref id='a'/></bsdf>",
            "scene.xml:2: found objects that refer to each other in a circle",
        ),
    ] {
        let error = scene(inner).unwrap_err();
        assert!(error.starts_with(&format!("DIR/{expected}")), "{inner}\n{error}");
    }
}

#[test]
fn what_is_no_scene_is_refused() {
    for (text, expected) in [
        ("<html/>", "DIR/scene.xml:1: found <html>, expected <scene>: a Mitsuba scene"),
        ("<scene version='3.0.0'/>", "DIR/scene.xml:1: found no sensor"),
        ("{\"version\": 1}", "DIR/scene.xml:1: found text between elements"),
    ] {
        let error = within(&folder(&[("scene.xml", text)])).unwrap_err();
        assert!(error.starts_with(expected), "{text}: {error}");
    }
    let folder = folder(&[]);
    std::fs::write(folder.path().join("scene.xml"), b"<scene>\n\xff</scene>").unwrap();
    assert!(within(&folder).unwrap_err().starts_with("DIR/scene.xml:2: found bytes that are not UTF-8"));
    let unknown = crate::convert("a.blend".as_ref()).unwrap_err().to_string();
    assert!(unknown.starts_with("a.blend: expected a scene whose name ends in one of .xml"), "{unknown}");
}

#[test]
fn includes_that_include_themselves_end() {
    let scene = |inner: &str| format!("<scene version='3.0.0'>{SENSOR}\n{inner}</scene>");
    let files = [
        ("scene.xml", scene("<include filename='a.xml'/>")),
        ("a.xml", scene("<include filename='b.xml'/>")),
        ("b.xml", scene("<include filename='a.xml'/>")),
    ];
    let files: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
    let error = within(&folder(&files)).unwrap_err();
    assert_eq!(error, "DIR/b.xml:2: found \"a.xml\", which includes itself");
    // Two times two times two …: the limit is the bytes that are read.
    let name = |level: u32| if level == 0 { "scene.xml".to_owned() } else { format!("{level}.xml") };
    let twice = |level: u32| {
        let include = format!("<include filename='{}'/>", name(level + 1)).repeat(2);
        format!(
            "<scene><!--{}-->{}</scene>",
            " ".repeat(20_000),
            if level < 14 { include } else { String::new() }
        )
    };
    let many: Vec<(String, String)> = (0..15).map(|level| (name(level), twice(level))).collect();
    let files: Vec<(&str, &str)> = many.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
    let error = within(&folder(&files)).unwrap_err();
    assert!(error.contains("are left of the limit of 67108864 for all XML"), "{error}");
}

#[test]
fn long_chains_of_references_end() {
    let mut text = String::from("<bsdf type='diffuse' id='b0'/>");
    for link in 1..5000 {
        let _ = write!(text, "<bsdf type='twosided' id='b{link}'><ref id='b{}'/></bsdf>", link - 1);
    }
    assert!(scene(&text).unwrap_err().contains("nested more than 64 deep"));
    let mut wide = String::from("<bsdf type='diffuse' id='b0'/>");
    for link in 1..60 {
        let _ = write!(
            wide,
            "<bsdf type='twosided' id='b{link}'><ref id='b{0}'/><ref id='b{0}'/></bsdf>",
            link - 1
        );
    }
    assert!(scene(&wide).is_ok(), "every object is looked at once");
}

#[test]
fn variables_of_variables_end() {
    // Twice as much text on every line.
    let mut text = String::from("<default name='a0' value='xxxxxxxxxx'/>\n");
    for level in 1..40 {
        let _ = writeln!(text, "<default name='a{level}' value='$a{0}$a{0}'/>", level - 1);
    }
    let error = scene(&text).unwrap_err();
    assert!(error.starts_with("DIR/scene.xml:24: found $a21, which stands for 20971520 bytes, "), "{error}");
    assert!(error.ends_with(" are left of the limit of 67108864 for all XML"), "{error}");
    // One long one that is used often, also in transforms.
    let long = format!("<default name='zero' value='0{}'/>\n", " ".repeat(1 << 20));
    let uses = |count: usize| {
        let shape =
            "<shape type='cube'><transform name='to_world'><translate x='$zero'/></transform></shape>";
        format!("{long}{}", shape.repeat(count))
    };
    assert!(scene(&uses(60)).is_ok());
    let error = scene(&uses(64)).unwrap_err();
    assert!(error.starts_with("DIR/scene.xml:3: found $zero, which stands for 1048577 bytes, "), "{error}");
}

#[test]
fn variables_and_folders_have_limits() {
    let defaults = |count: u32| {
        let mut text = String::new();
        for at in 0..count {
            let _ = write!(text, "<default name='v{at}' value='1'/>");
        }
        text
    };
    assert!(scene(&defaults(4096)).is_ok());
    assert!(scene(&format!("{0}{0}", defaults(4096))).is_ok(), "the first value stays");
    let error = scene(&defaults(4097)).unwrap_err();
    assert_eq!(error, "DIR/scene.xml:2: found more than 4096 variables, which is the limit");
    for (name, length) in [(String::new(), 0), ("n".repeat(101), 101)] {
        let error = scene(&format!("<default name='{name}' value='1'/>")).unwrap_err();
        let expected = format!("found a <default> whose name has {length} bytes, expected 1 to 100");
        assert_eq!(error, format!("DIR/scene.xml:2: {expected}"));
    }
    let error = scene(&format!("{}<float name='x' value='$w'/>", defaults(30))).unwrap_err();
    assert!(
        error
            .starts_with("DIR/scene.xml:2: found \"$w\", expected a variable that has a <default>: v0, v1, ")
    );
    assert!(error.ends_with(", …") && error.len() < 250, "{error}");
    assert!(scene(&"<path value='.'/>".repeat(64)).is_ok());
    let error = scene(&"<path value='.'/>".repeat(65)).unwrap_err();
    assert_eq!(error, "DIR/scene.xml:2: found more than 64 <path>, which is the limit");
}

#[test]
fn names_of_variables_may_begin_alike() {
    let text = "<default name='a' value='1'/><default name='ab' value='2'/><default name='ä' value='3'/>\
        <bsdf type='diffuse' id='m'><rgb name='reflectance' value='0.$a 0.$abc 0.$ä'/></bsdf>";
    assert_eq!(scene(text).unwrap_err(), "DIR/scene.xml:2: found \"0.2c\", expected a number");
    let found = scene(&text.replace("abc", "ab")).unwrap().document;
    assert_eq!(found["materials"]["m"]["reflectance"], serde_json::json!([0.1, 0.2, 0.3]));
}

#[test]
fn long_ids_are_not_compared() {
    let long = "i".repeat(30_000);
    let text = format!("<bsdf type='diffuse' id='{long}'/><shape type='cube'><ref id='{long}x'/></shape>");
    let error = scene(&text).unwrap_err();
    assert!(error.starts_with("DIR/scene.xml:2: found a reference to \"iii") && !error.contains("hint"));
}
