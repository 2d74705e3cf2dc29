//! Owns the tests that documents and assets that ask for too much are refused.

use super::scene;
use crate::scene::document::{Document, Limits};

fn refused(text: &str, limits: &Limits) -> String {
    Document::parse(text, "s", limits).map_or_else(|problems| problems.to_string(), |_| "nothing".to_owned())
}

#[test]
fn documents() {
    let limits = Limits::default();
    for (text, limits, expected) in [
        (
            scene(""),
            Limits { max_document_bytes: 50, ..limits.clone() },
            "s: the document has 86 bytes, the limit is 50",
        ),
        (scene(""), Limits { max_values: 4, ..limits.clone() }, "s:1:1: found 8 JSON values, the limit is 4"),
        (
            scene(r#""lights":{"a":{},"b":{}}"#),
            Limits { max_names: 1, ..limits.clone() },
            "s:2:10: lights: found 2 names, the limit is 1",
        ),
        (
            scene(""),
            Limits { max_pixels: 47, ..limits.clone() },
            "s:1:63: film: found 8 x 6 = 48 pixels, the limit is 47",
        ),
        (
            scene(r#""animation":{"frames":[-2147483648,2147483647]}"#),
            limits.clone(),
            "s:2:24: animation.frames[0]: found -2147483648, expected an integer from -100000000 to 100000000\n\
             s:2:36: animation.frames[1]: found 2147483647, expected an integer from -100000000 to 100000000",
        ),
        (
            scene(r#""animation":{"frames":[0,100000]}"#),
            limits.clone(),
            "s:2:23: animation.frames: found 100001 frames, the limit is 100000",
        ),
    ] {
        assert_eq!(refused(&text, &limits), expected);
    }
}

/// An object whose tree has `depth` nodes above each other.
fn nested(depth: usize) -> String {
    let (open, close) = (r#"{"type":"union","children":{"a":"#, "}}");
    let tree =
        format!("{}{}{}", open.repeat(depth - 1), r#"{"type":"sphere","radius":1}"#, close.repeat(depth - 1));
    scene(&format!(
        r#""materials":{{"m":{{"type":"diffuse"}}}},"sdf_objects":{{"o":{{"material":"m","tree":{tree}}}}}"#
    ))
}

/// Runs on a stack as small as that of any thread that may read documents.
fn on_small_stack(work: impl FnOnce() + Send + 'static) {
    std::thread::Builder::new().stack_size(1 << 20).spawn(work).unwrap().join().unwrap();
}

#[test]
fn deep_trees() {
    on_small_stack(|| {
        let limits = Limits::default();
        assert_eq!(refused(&nested(64), &limits), "nothing");
        let expected = "s:2:80: sdf_objects.o.tree: found nodes nested 65 deep, the limit is 64";
        assert_eq!(refused(&nested(65), &limits), expected);
        for depth in [95, 100, 1000, 100_000] {
            let found = refused(&nested(depth), &limits);
            assert!(found.contains("deep"), "{depth}: {found}");
        }
        let arrays = "[".repeat(1 << 20);
        let expected = "s:1:201: found brackets nested deeper than 200, the most that is allowed";
        assert_eq!(refused(&arrays, &limits), expected);
        // As deep as brackets may be, where `child` nests with one bracket a level.
        let deep = r#"{"type":"transform","child":"#.repeat(190) + "1" + &"}".repeat(190);
        let text =
            scene(&format!(r#""materials":{{}},"sdf_objects":{{"o":{{"material":"m","tree":{deep}}}}}"#));
        assert!(refused(&text, &limits).contains("found 1, expected an SDF node object"));
    });
}

#[test]
fn wide_trees() {
    let children: Vec<String> =
        (0..10_000).map(|i| format!(r#""s{i}":{{"type":"sphere","radius":1}}"#)).collect();
    let tree = format!(r#"{{"type":"union","children":{{{}}}}}"#, children.join(","));
    let text = scene(&format!(
        r#""materials":{{"m":{{"type":"diffuse"}}}},"sdf_objects":{{"o":{{"material":"m","tree":{tree}}}}}"#
    ));
    assert_eq!(refused(&text, &Limits::default()), "nothing");
    let limits = Limits { max_sdf_nodes: 10_000, ..Limits::default() };
    let expected = "s:2:80: sdf_objects.o.tree: found 10001 SDF nodes up to here, the limit is 10000 in all objects \
                    together";
    assert_eq!(refused(&text, &limits), expected);
}

#[test]
fn many_misspelt_references_cost_little() {
    // 20 000 names, and as many references that are one letter off.
    let names: Vec<String> = (0..20_000).map(|i| format!(r#""material_{i}":{{"type":"diffuse"}}"#)).collect();
    let spheres: Vec<String> = (0..20_000)
        .map(|i| format!(r#""s{i}":{{"center":[0,0,0],"radius":1,"material":"materia_{i}"}}"#))
        .collect();
    let text = scene(&format!(r#""materials":{{{}}},"spheres":{{{}}}"#, names.join(","), spheres.join(",")));
    let found = Document::parse(&text, "s", &Limits::default()).unwrap_err();
    assert_eq!((found.problems.len(), found.total), (50, 20_000));
}
