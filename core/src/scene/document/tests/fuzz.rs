//! Owns the tests that no text makes the document panic.

use proptest::collection::vec;
use proptest::prelude::{Strategy, any, prop_oneof};
use proptest::test_runner::{Config, TestRunner};

use crate::scene::document::reference::EXAMPLE;
use crate::scene::document::{Document, Limits};

/// What replaces a part of a document.
fn pieces() -> impl Strategy<Value = String> {
    let words = [
        "0",
        "-1",
        "1e999",
        "1e-999",
        "0.5",
        "null",
        "true",
        "[]",
        "{}",
        "[0,0,0]",
        "\"auto\"",
        "\"type\"",
        "{",
        "}",
        "[",
        "]",
        ",",
        ":",
        "\"",
        "\\",
        "\n",
        "\u{0}",
        "é",
        "\"..\"",
        "4294967296",
        "{\"matrix\":[[]]}",
        "\"step\"",
    ];
    prop_oneof![
        4 => proptest::sample::select(words.to_vec()).prop_map(str::to_owned),
        1 => any::<String>(),
    ]
}

/// The example with parts cut out, doubled or replaced.
fn mutated() -> impl Strategy<Value = String> {
    let cut = (any::<u16>(), 0_usize..40, pieces());
    vec(cut, 1..6).prop_map(|cuts| {
        let mut text: Vec<char> = EXAMPLE.chars().collect();
        for (at, length, piece) in cuts {
            let start = usize::from(at) % text.len().max(1);
            let end = (start + length).min(text.len());
            text.splice(start.min(end)..end, piece.chars());
        }
        text.into_iter().collect()
    })
}

/// The example with whole values replaced, so that it stays JSON.
fn revalued() -> impl Strategy<Value = String> {
    vec((any::<u16>(), pieces()), 1..4).prop_map(|changes| {
        let mut parts: Vec<String> = EXAMPLE.split(": ").map(str::to_owned).collect();
        for (at, piece) in changes {
            let index = 1 + usize::from(at) % (parts.len() - 1);
            let end = parts[index].find([',', '\n', '}']).unwrap_or(parts[index].len());
            parts[index].replace_range(..end, &piece);
        }
        parts.join(": ")
    })
}

fn run(strategy: impl Strategy<Value = String>) {
    let mut runner = TestRunner::new(Config { cases: 3000, failure_persistence: None, ..Config::default() });
    runner
        .run(&strategy, |text| {
            if let Ok(document) = Document::parse(&text, "fuzz", &Limits::default()) {
                let frames = document.frames();
                for frame in [frames.first, frames.last, 0, 24] {
                    let _ = document.at(frame).map(|description| description.sdf_objects.len());
                }
            }
            Ok(())
        })
        .unwrap();
}

#[test]
fn any_text_is_read_or_refused() {
    run(mutated());
    run(revalued());
    run(any::<String>());
}
