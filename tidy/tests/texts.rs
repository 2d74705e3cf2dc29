//! What every file begins with, which words no file contains, and whether links lead somewhere.

use std::path::Path;

use karst_tidy::root;
use karst_tidy::source::{Source, files};

/// Files that are not ours to word.
const GENERATED: [&str; 2] = ["Cargo.lock", "LICENSE-APACHE"];

fn own_files() -> Vec<Source> {
    let mut list = files(&root());
    list.retain(|file| !GENERATED.contains(&file.path.as_str()));
    assert!(list.len() > 20, "the sources are not where they are looked for");
    list
}

/// The first line that is not `#!…`.
fn first_line(text: &str) -> &str {
    text.lines().find(|line| !line.starts_with("#!/")).unwrap_or_default()
}

#[test]
fn every_source_file_begins_with_what_it_owns() {
    for file in own_files() {
        let begins: &[&str] = match Path::new(&file.path).extension().and_then(|extension| extension.to_str())
        {
            Some("rs") => &["//! "],
            Some("py") => &["\"\"\"", "# "],
            Some("proto") => &["// "],
            Some("sql") => &["-- "],
            Some("sh") => &["# "],
            None if file.text.starts_with("#!") => &["# "],
            _ => continue,
        };
        let line = first_line(&file.text);
        let good = begins.iter().any(|begin| line.starts_with(begin)) && line.len() > 12;
        assert!(good, "{}: begins with {line:?}, expected {begins:?} and what the file owns", file.path);
    }
}

/// Words that no file contains, and why. Split, so that this file does not contain them either.
fn forbidden() -> Vec<(String, &'static str)> {
    let join = |parts: &[&str]| parts.concat();
    vec![
        (join(&["TO", "DO"]), "finish it or leave it out"),
        (join(&["FIX", "ME"]), "finish it or leave it out"),
        (join(&["XX", "X:"]), "finish it or leave it out"),
        (join(&["/wo", "rk/"]), "a path of one machine"),
        (join(&["/ro", "ot/"]), "a path of one machine"),
        (join(&["/ho", "me/"]), "a path of one machine"),
        (join(&["index.", "crates.io"]), "the host of a registry"),
        (join(&["static.", "crates.io"]), "the host of a registry"),
        (join(&["pypi", ".org"]), "the host of a registry"),
        (join(&["files.", "pythonhosted"]), "the host of a registry"),
        (join(&["proxy.", "golang.org"]), "the host of a registry"),
        (join(&["registry.", "npmjs"]), "the host of a registry"),
    ]
}

#[test]
fn no_file_contains_what_ages_or_leaks() {
    let mut wrong = Vec::new();
    let forbidden = forbidden();
    for file in own_files() {
        for (number, line) in file.text.lines().enumerate() {
            let found = forbidden.iter().filter(|(word, _)| line.contains(word.as_str()));
            wrong.extend(found.map(|(word, why)| format!("{}:{}: {word}: {why}", file.path, number + 1)));
            if file.has_extension("md") && line.contains("/tmp/") {
                wrong.push(format!("{}:{}: a path of one machine", file.path, number + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn links_in_pages_lead_to_files() {
    let (mut links, mut wrong) = (0, Vec::new());
    // Pages among the sources are parts of generated pages, which are checked where they end up.
    let page = |file: &&Source| file.has_extension("md") && !file.path.contains("/src/");
    for file in own_files().iter().filter(page) {
        let folder = root().join(&file.path);
        let folder = folder.parent().unwrap_or(Path::new("."));
        for link in targets(&file.text) {
            let path = link.split('#').next().unwrap_or_default();
            if path.is_empty() || path.contains("://") || path.starts_with("mailto:") {
                continue;
            }
            links += 1;
            if !folder.join(path).exists() {
                wrong.push(format!("{}: {link}", file.path));
            }
        }
    }
    assert!(links > 4, "found only {links} links");
    assert!(wrong.is_empty(), "links that lead nowhere\n{}", wrong.join("\n"));
}

/// What stands in the round brackets of `[text](target)`, outside code blocks.
fn targets(text: &str) -> Vec<&str> {
    let prose = text.split("```").step_by(2);
    prose.flat_map(|part| part.split("](").skip(1)).filter_map(|rest| rest.split(')').next()).collect()
}
