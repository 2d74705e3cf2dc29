//! Owns the tests that the schema and the reference page are those of the code.

use std::path::Path;

use super::parse;
use crate::scene::document::reference::{EXAMPLE, json_schema, reference_page};

#[test]
fn the_example_is_valid() {
    let document = parse(EXAMPLE);
    assert_eq!(document.frames().count(), 48);
    let paths: Vec<&str> = document.assets().iter().map(|asset| asset.path.as_str()).collect();
    assert_eq!(paths, ["textures/tiles.png", "meshes/floor.obj"]);
    let frame = document.at(48).unwrap();
    assert_eq!(frame.spheres.get("lamp").unwrap().emission, glam::Vec3::ZERO);
}

#[test]
#[expect(
    clippy::disallowed_methods,
    reason = "UPDATE_DOCS is how a person asks this test to write the files"
)]
fn the_docs_are_those_of_the_code() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    for (name, fresh) in [("scene-format.md", reference_page()), ("scene.schema.json", json_schema())] {
        let file = docs.join(name);
        if std::env::var("UPDATE_DOCS").is_ok() {
            std::fs::write(&file, &fresh).unwrap();
        }
        let written = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(
            written == fresh,
            "docs/{name} is out of date: run `UPDATE_DOCS=1 cargo test -p karst-core docs`"
        );
    }
}

#[test]
fn every_field_says_what_it_is() {
    let schema: serde_json::Value = serde_json::from_str(&json_schema()).unwrap();
    let mut fields = 0;
    for (title, definition) in schema["$defs"].as_object().unwrap() {
        assert!(!definition["description"].is_null() || !definition["oneOf"].is_null(), "{title}");
        let variants = definition["oneOf"].as_array().cloned().unwrap_or_default();
        for object in variants.iter().chain([definition]) {
            for (name, field) in object["properties"].as_object().into_iter().flatten() {
                fields += 1;
                assert!(
                    name == "type" || field["description"].as_str().is_some_and(|d| d.len() > 6),
                    "{title}.{name}"
                );
            }
        }
    }
    assert!(fields > 60, "{fields}");
}
