//! Sizes of files and functions, and what code may not contain.
#![allow(clippy::print_stdout, reason = "the tables are for whoever runs the tests with --nocapture")]

use karst_tidy::root;
use karst_tidy::source::{Findings, Source, files, inspect, rust_files};

/// Most lines of a source file.
const FILE_LINES: usize = 600;

/// Most lines of a function.
const FUNCTION_LINES: usize = 100;

/// Calls of `expect` outside tests: how many in which file, and why they cannot fail.
const EXPECTS: &[(&str, usize, &str)] = &[
    ("client/src/commands/render.rs", 1, "a render ends early only when it is told to stop, and nobody does"),
    ("core/src/bvh/build.rs", 1, "two or more places can always be split"),
    ("core/src/sdf/tape.rs", 1, "a tape is checked for balance when it is compiled"),
    ("server/src/state/mod.rs", 1, "plain data with text keys always becomes JSON"),
    ("tidy/src/graph.rs", 2, "part of the tests"),
];

/// Files that may contain `unsafe`, and why.
const UNSAFE: &[(&str, &str)] = &[("denoise/src/bin/karst-oidn/filter.rs", "calls into a C library")];

fn inspected() -> Vec<(Source, Findings)> {
    rust_files(&root())
        .into_iter()
        .map(|(source, file)| {
            let found = inspect(&source, &file);
            (source, found)
        })
        .collect()
}

fn print_largest(title: &str, mut entries: Vec<(usize, String)>, budget: usize) -> Vec<(usize, String)> {
    entries.sort_by(|a, b| b.cmp(a));
    let median = entries.get(entries.len() / 2).map_or(0, |entry| entry.0);
    println!("{title}: {} in all, median {median} lines, budget {budget}", entries.len());
    for (lines, name) in entries.iter().take(12) {
        println!("  {lines:5}  {name}");
    }
    entries
}

#[test]
fn files_are_small() {
    let code = ["rs", "py", "proto", "sh", "sql"];
    let entries = files(&root())
        .into_iter()
        .filter(|file| code.iter().any(|extension| file.has_extension(extension)) || file.path == "run")
        .map(|file| (file.text.lines().count(), file.path))
        .collect();
    let entries = print_largest("files", entries, FILE_LINES);
    assert!(entries.first().is_none_or(|(lines, _)| *lines <= FILE_LINES), "{:?}", entries.first());
}

#[test]
fn functions_are_small() {
    let mut entries = Vec::new();
    for (source, found) in inspected() {
        let name = |function: &karst_tidy::source::Function| {
            (function.lines, format!("{}:{} {}", source.path, function.line, function.name))
        };
        entries.extend(found.functions.iter().map(name));
    }
    let entries = print_largest("functions", entries, FUNCTION_LINES);
    assert!(entries.first().is_none_or(|(lines, _)| *lines <= FUNCTION_LINES), "{:?}", entries.first());
}

#[test]
fn nothing_unwraps_outside_tests_but_what_is_listed() {
    let mut wrong = Vec::new();
    let mut total = 0;
    for (source, found) in inspected() {
        let allowed =
            EXPECTS.iter().find(|(path, ..)| *path == source.path).map_or(0, |(_, count, _)| *count);
        total += found.unwraps.len();
        if found.unwraps.len() != allowed {
            let lines = &found.unwraps;
            wrong.push(format!(
                "{}: found {} at lines {lines:?}, listed {allowed}",
                source.path,
                lines.len()
            ));
        }
    }
    println!("unwrap and expect outside tests: {total}, each listed with its reason");
    assert!(wrong.is_empty(), "unwrap or expect\n{}", wrong.join("\n"));
}

#[test]
fn unsafe_stays_where_it_is_listed() {
    for (source, found) in inspected() {
        let listed = UNSAFE.iter().any(|(path, _)| *path == source.path);
        assert!(listed || found.unsafes.is_empty(), "{}: unsafe at lines {:?}", source.path, found.unsafes);
    }
}

#[test]
fn every_public_item_is_documented() {
    let (mut public, mut wrong) = (0, Vec::new());
    for (source, found) in inspected() {
        public += found.public;
        wrong.extend(found.undocumented.iter().map(|(line, name)| format!("{}:{line} {name}", source.path)));
    }
    println!("public items: {public}, without documentation: {}", wrong.len());
    assert!(wrong.is_empty(), "without documentation\n{}", wrong.join("\n"));
}
