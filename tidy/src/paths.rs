//! Which paths a Rust file names, outside its tests, resolved as far as its place in the crate says.

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};

use crate::source::is_test_item;

/// A path named in a file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Named {
    /// Its segments; paths into the own crate begin with `crate`.
    pub segments: Vec<String>,
    /// The line that names it.
    pub line: usize,
}

impl Named {
    /// The top-level module of the own crate that the path enters.
    pub fn module(&self) -> Option<&str> {
        match self.segments.as_slice() {
            [first, second, ..] if first == "crate" => Some(second),
            _ => None,
        }
    }
}

/// The module path of a file, from its path below `src`: `light/mod.rs` is `["light"]`, `lib.rs` is `[]`.
pub fn module_of(below_src: &str) -> Vec<String> {
    let mut parts: Vec<String> = below_src.trim_end_matches(".rs").split('/').map(String::from).collect();
    if matches!(parts.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        parts.pop();
    }
    parts
}

/// Every path that `file`, which is the module `module`, names outside `#[cfg(test)]` and `#[test]`.
///
/// `super` and `self` are resolved; what macros are given is searched for `crate::…` only.
pub fn named(file: &syn::File, module: &[String]) -> Vec<Named> {
    let mut collector = Collector { module: module.to_vec(), found: Vec::new() };
    collector.visit_file(file);
    collector.found.sort();
    collector.found.dedup();
    collector.found
}

struct Collector {
    module: Vec<String>,
    found: Vec<Named>,
}

impl Collector {
    fn add(&mut self, segments: &[String], line: usize) {
        let Some(first) = segments.first() else { return };
        let supers = segments.iter().take_while(|segment| *segment == "super").count();
        let start = match first.as_str() {
            "self" => self.module.clone(),
            "super" => self.module[..self.module.len().saturating_sub(supers)].to_vec(),
            _ => return self.found.push(Named { segments: segments.to_vec(), line }),
        };
        let rest = segments.iter().skip(supers.max(1)).cloned();
        let segments = std::iter::once("crate".to_owned()).chain(start).chain(rest).collect();
        self.found.push(Named { segments, line });
    }

    fn use_tree(&mut self, prefix: &[String], tree: &syn::UseTree) {
        let with = |ident: &syn::Ident| [prefix, &[ident.to_string()]].concat();
        match tree {
            syn::UseTree::Path(path) => self.use_tree(&with(&path.ident), &path.tree),
            syn::UseTree::Name(name) => self.add(&with(&name.ident), name.ident.span().start().line),
            syn::UseTree::Rename(name) => self.add(&with(&name.ident), name.ident.span().start().line),
            syn::UseTree::Glob(glob) => self.add(prefix, glob.star_token.spans[0].start().line),
            syn::UseTree::Group(group) => group.items.iter().for_each(|item| self.use_tree(prefix, item)),
        }
    }

    /// Finds `crate::name` in the tokens given to a macro.
    fn tokens(&mut self, tokens: TokenStream) {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        for (at, tree) in trees.iter().enumerate() {
            match tree {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(ident) if ident == "crate" => {
                    if let Some(TokenTree::Ident(next)) = trees.get(at + 3) {
                        self.add(&["crate".into(), next.to_string()], ident.span().start().line);
                    }
                }
                TokenTree::Ident(_) | TokenTree::Punct(_) | TokenTree::Literal(_) => {}
            }
        }
    }
}

impl<'ast> Visit<'ast> for Collector {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !is_test_item(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if !is_test_item(&item.attrs) {
            visit::visit_item_impl(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_test_item(&item.attrs) {
            self.module.push(item.ident.to_string());
            visit::visit_item_mod(self, item);
            self.module.pop();
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if !is_test_item(&item.attrs) {
            self.use_tree(&[], &item.tree);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        let line = path.segments[0].ident.span().start().line;
        self.add(&segments, line);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.tokens(item.tokens.clone());
        visit::visit_macro(self, item);
    }
}

#[cfg(test)]
mod tests {
    use super::{module_of, named};

    #[test]
    fn paths_are_found_and_resolved() {
        let text = r#"
            use crate::{film::{Film, Picture}, math};
            use super::store as other;
            mod inner { use super::super::camera::Camera; fn f() { self::g() } }
            fn f() -> crate::scene::Scene { println!("{}", crate::warp::x(std::env::args())); light::g() }
            #[cfg(test)] mod tests { use crate::render::render_tile; }
            #[test] fn t() { crate::encode::exr() }
        "#;
        let found = named(&syn::parse_file(text).unwrap(), &module_of("film/grid.rs"));
        let mut modules: Vec<&str> = found.iter().filter_map(super::Named::module).collect();
        modules.sort_unstable();
        modules.dedup();
        assert_eq!(modules, ["film", "math", "scene", "warp"]);
        let paths: Vec<String> = found.iter().map(|named| named.segments.join("::")).collect();
        for expected in ["crate::film::store", "crate::film::camera::Camera", "crate::film::grid::inner::g"] {
            assert!(paths.iter().any(|path| path == expected), "{expected} in {paths:?}");
        }
    }

    #[test]
    fn the_module_of_a_file_follows_from_its_place() {
        assert_eq!(module_of("lib.rs"), [""; 0]);
        assert_eq!(module_of("light/mod.rs"), ["light"]);
        assert_eq!(module_of("light/sphere.rs"), ["light", "sphere"]);
        assert_eq!(module_of("camera.rs"), ["camera"]);
    }
}
