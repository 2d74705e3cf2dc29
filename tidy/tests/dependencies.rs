//! Crates and modules depend one way, and the drawn graph is fresh.
#![allow(clippy::unwrap_used, reason = "a step that fails is a test that fails")]

use std::collections::BTreeSet;
use std::fmt::Write as _;

use karst_tidy::graph::{Graph, crates, cycles, mermaid, modules, uses};
use karst_tidy::paths::{module_of, named};
use karst_tidy::root;
use karst_tidy::source::rust_files;

/// What each crate may use of the others.
const CRATES: [(&str, &[&str]); 7] = [
    ("karst-client", &["karst-convert", "karst-core", "karst-denoise", "karst-proto"]),
    ("karst-convert", &["karst-core"]),
    ("karst-core", &[]),
    ("karst-denoise", &[]),
    ("karst-proto", &["karst-core"]),
    ("karst-server", &["karst-core", "karst-denoise", "karst-proto"]),
    ("karst-tidy", &[]),
];

/// Inside `core` a module uses only what stands to its left.
const CORE: &str = "cpu math color | sampler warp | sdf mesh bvh | texture | bsdf medium | light film camera | scene | \
                    integrator | render | encode";

/// Folders of the crates whose modules are drawn and must be free of cycles.
const DRAWN: [&str; 6] = ["core", "convert", "proto", "server", "client", "denoise"];

#[test]
fn crates_depend_one_way() {
    let allowed: Graph = CRATES
        .iter()
        .map(|(name, uses)| ((*name).to_owned(), uses.iter().map(|other| (*other).to_owned()).collect()))
        .collect();
    for (name, uses) in crates(&root()) {
        let may = allowed.get(&name).unwrap_or_else(|| panic!("{name}: not in the table of this test"));
        let more: Vec<_> = uses.difference(may).collect();
        assert!(more.is_empty(), "{name} must not depend on {more:?}");
    }
}

#[test]
fn a_module_of_core_uses_only_what_stands_to_its_left() {
    let order: Vec<&str> = CORE.split_whitespace().filter(|word| *word != "|").collect();
    let place = |module: &str| {
        order.iter().position(|other| *other == module).unwrap_or_else(|| {
            panic!("core::{module} has no place in the order: {CORE}");
        })
    };
    let (modules, uses) = uses(&root(), "core");
    for module in &modules {
        place(module);
    }
    let wrong: Vec<String> = uses
        .iter()
        .filter(|edge| place(&edge.to) >= place(&edge.from))
        .map(|edge| format!("{}: {} must not use {}", edge.place, edge.from, edge.to))
        .collect();
    assert!(wrong.is_empty(), "order: {CORE}\n{}", wrong.join("\n"));
}

#[test]
fn no_module_depends_on_itself_through_others() {
    for folder in DRAWN {
        let cycles = cycles(&modules(&root(), folder));
        assert!(cycles.is_empty(), "{folder}: a cycle through {cycles:?}");
    }
    assert!(cycles(&crates(&root())).is_empty());
}

/// Parts of the standard library that `core` must not touch, and the files that may all the same.
const IMPURE: [(&str, &[&str]); 6] = [
    ("env", &[]),
    ("fs", &["core/src/scene/assets.rs", "core/src/scene/source.rs"]),
    ("net", &[]),
    ("process", &[]),
    ("thread", &[]),
    ("time", &[]),
];

#[test]
fn core_reads_no_clock_no_environment_and_no_files_but_through_its_loaders() {
    let mut wrong = Vec::new();
    for (source, file) in rust_files(&root()).into_iter().filter(|(source, _)| !source.is_test()) {
        let Some(below) = source.path.strip_prefix("core/src/") else { continue };
        for path in named(&file, &module_of(below)) {
            let [first, second, ..] = path.segments.as_slice() else { continue };
            let banned = IMPURE.iter().find(|(module, _)| first == "std" && second == module);
            if banned.is_some_and(|(_, files)| !files.contains(&source.path.as_str())) {
                wrong.push(format!("{}:{}: std::{second}", source.path, path.line));
            }
        }
    }
    assert!(wrong.is_empty(), "core is pure\n{}", wrong.join("\n"));
}

#[test]
fn the_drawn_graph_is_fresh() {
    let mut text = String::from(
        "# Crates and modules\n\nDrawn from the sources by a test; `UPDATE_DOCS=1 cargo test --release -p karst-tidy` \
         draws it again.\nAn arrow means \"uses\"; arrows that follow from others are left out.\n\n## Crates\n\n",
    );
    text += &mermaid(&crates(&root()));
    for folder in DRAWN {
        let graph = modules(&root(), folder);
        if graph.is_empty() {
            continue;
        }
        let _ = write!(text, "\n## {folder}\n\n{}\n| module | uses |\n|---|---|\n", mermaid(&graph));
        for (module, uses) in &graph {
            let uses: BTreeSet<String> = uses.iter().map(|other| format!("`{other}`")).collect();
            let uses = uses.into_iter().collect::<Vec<_>>().join(" ");
            let _ = writeln!(text, "| `{module}` | {uses} |");
        }
    }
    let path = root().join("docs/modules.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &text).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == text,
        "docs/modules.md is stale\nhint: UPDATE_DOCS=1 cargo test --release -p karst-tidy"
    );
}
