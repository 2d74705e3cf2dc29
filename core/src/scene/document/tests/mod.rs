//! Owns the tests of the scene document.

mod animate;
mod fuzz;
mod limit;
mod overriding;
mod pages;
mod problem;
mod valid;

use crate::scene::document::{Description, Document, Limits};

/// A camera and a film, and what else a test needs.
pub(super) fn scene(rest: &str) -> String {
    let comma = if rest.is_empty() { "" } else { "," };
    format!(
        r#"{{"version":1,"camera":{{"type":"perspective","vfov":40}},"film":{{"width":8,"height":6}}{comma}
{rest}}}"#
    )
}

/// The document, which must be valid.
pub(super) fn parse(text: &str) -> Document {
    Document::parse(text, "scene.json", &Limits::default())
        .unwrap_or_else(|problems| panic!("{problems}\n{text}"))
}

/// The first frame of a document, which must be valid.
pub(super) fn frame(text: &str) -> Description {
    parse(text).at(1).unwrap_or_else(|problems| panic!("{problems}\n{text}"))
}

/// What is wrong with a document.
pub(super) fn problems(text: &str) -> String {
    match Document::parse(text, "scene.json", &Limits::default()) {
        Ok(_) => "nothing".to_owned(),
        Err(problems) => problems.to_string(),
    }
}

/// What marks the places in a document where something is wrong.
const MARKS: &str = "①②③④⑤⑥⑦⑧⑨ⓐⓑⓒⓓ";

/// Checks that exactly this is wrong with a document. A mark in the text is not part of it; the same mark in
/// `expected` stands for its place.
#[track_caller]
pub(super) fn check(text: &str, expected: &str) {
    let (mut plain, mut expected) = (String::new(), expected.to_owned());
    for c in text.chars() {
        if MARKS.contains(c) {
            let column = plain.chars().rev().take_while(|&c| c != '\n').count() + 1;
            let place = format!("scene.json:{}:{column}:", plain.matches('\n').count() + 1);
            expected = expected.replace(c, &place);
        } else {
            plain.push(c);
        }
    }
    let text = &plain;
    let found = problems(text);
    assert_eq!(found, expected, "\n--- found\n{found}\n--- expected\n{expected}\n--- in\n{text}");
}
