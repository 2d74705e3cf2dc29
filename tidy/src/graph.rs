//! Graphs of crates and modules: edges, cycles, and their drawing.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use crate::paths::{module_of, named};
use crate::source::rust_files;

/// Who uses whom; every node is a key.
pub type Graph = BTreeMap<String, BTreeSet<String>>;

/// A use of one top-level module by another, with the place that names it.
#[derive(Debug, Clone)]
pub struct Use {
    /// The module that uses.
    pub from: String,
    /// The module that is used.
    pub to: String,
    /// File and line.
    pub place: String,
}

/// The crates of the workspace and their dependencies among themselves, without those of tests.
///
/// # Panics
/// When `cargo metadata` fails.
pub fn crates(root: &Path) -> Graph {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root)
        .output()
        .expect("cargo runs this test");
    assert!(output.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("cargo writes JSON");
    let list = |value: &serde_json::Value| value.as_array().cloned().unwrap_or_default();
    let name = |value: &serde_json::Value| value["name"].as_str().unwrap_or_default().to_owned();
    let packages = list(&metadata["packages"]);
    let own: BTreeSet<String> = packages.iter().map(name).collect();
    packages
        .iter()
        .map(|package| {
            let uses = list(&package["dependencies"])
                .iter()
                .filter(|dependency| dependency["kind"] != "dev")
                .map(name)
                .filter(|other| own.contains(other))
                .collect();
            (name(package), uses)
        })
        .collect()
}

/// Every use between the top-level modules of the crate in `folder`, outside tests.
///
/// The crate's root (`lib.rs`, `main.rs`) only puts the modules together and is not part of the graph.
pub fn uses(root: &Path, folder: &str) -> (BTreeSet<String>, Vec<Use>) {
    let prefix = format!("{folder}/src/");
    let files: Vec<_> = rust_files(root)
        .into_iter()
        .filter(|(source, _)| !source.is_test())
        .filter_map(|(source, file)| {
            let module = module_of(source.path.strip_prefix(&prefix)?);
            Some((source, file, module))
        })
        .filter(|(_, _, module)| module.first().is_some_and(|first| first != "bin"))
        .collect();
    let modules: BTreeSet<String> = files.iter().map(|(_, _, module)| module[0].clone()).collect();
    let mut uses = Vec::new();
    for (source, file, module) in &files {
        for path in named(file, module) {
            let Some(to) = path.module().filter(|to| modules.contains(*to) && *to != module[0]) else {
                continue;
            };
            let place = format!("{}:{}", source.path, path.line);
            uses.push(Use { from: module[0].clone(), to: to.to_owned(), place });
        }
    }
    (modules, uses)
}

/// The graph of the modules of the crate in `folder`.
pub fn modules(root: &Path, folder: &str) -> Graph {
    let (modules, uses) = uses(root, folder);
    let mut graph: Graph = modules.into_iter().map(|module| (module, BTreeSet::new())).collect();
    for edge in uses {
        graph.entry(edge.from).or_default().insert(edge.to);
    }
    graph
}

/// All nodes that can be reached from `node`.
pub fn reachable(graph: &Graph, node: &str) -> BTreeSet<String> {
    let (mut seen, mut open) = (BTreeSet::new(), vec![node.to_owned()]);
    while let Some(next) = open.pop() {
        for other in graph.get(&next).into_iter().flatten() {
            if seen.insert(other.clone()) {
                open.push(other.clone());
            }
        }
    }
    seen
}

/// Nodes that reach themselves.
pub fn cycles(graph: &Graph) -> Vec<String> {
    graph.keys().filter(|node| reachable(graph, node).contains(*node)).cloned().collect()
}

/// The graph as Mermaid; edges that follow from others are left out, so that the drawing can be read.
pub fn mermaid(graph: &Graph) -> String {
    let mut text = String::from("```mermaid\ngraph TD\n");
    for (from, targets) in graph {
        if targets.is_empty() {
            let _ = writeln!(text, "  {from}");
        }
        for to in targets {
            let implied = targets.iter().any(|other| other != to && reachable(graph, other).contains(to));
            if !implied {
                let _ = writeln!(text, "  {from} --> {to}");
            }
        }
    }
    text + "```\n"
}

#[cfg(test)]
mod tests {
    use super::{Graph, cycles, mermaid};

    fn graph(edges: &[(&str, &str)]) -> Graph {
        let mut graph = Graph::new();
        for (from, to) in edges {
            graph.entry((*from).into()).or_default().insert((*to).into());
            graph.entry((*to).into()).or_default();
        }
        graph
    }

    #[test]
    fn cycles_are_found_with_all_their_members() {
        assert!(cycles(&graph(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
        assert_eq!(cycles(&graph(&[("a", "b"), ("b", "c"), ("c", "b"), ("c", "d")])), ["b", "c"]);
    }

    #[test]
    fn the_drawing_leaves_out_what_follows() {
        let text = mermaid(&graph(&[("a", "b"), ("b", "c"), ("a", "c")]));
        assert_eq!(text, "```mermaid\ngraph TD\n  a --> b\n  b --> c\n  c\n```\n");
    }
}
