//! Files of the repository and what a Rust file contains: functions, public items, calls that may panic, `unsafe`.

use std::fs;
use std::path::{Path, PathBuf};

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use walkdir::WalkDir;

/// A text file of the repository.
#[derive(Debug, Clone)]
pub struct Source {
    /// Path relative to the root, with `/`.
    pub path: String,
    /// Its text.
    pub text: String,
}

/// Folders of the root that hold nothing of our own.
const FOREIGN: [&str; 3] = ["target", "third_party", "out"];

/// Hidden names that are looked at all the same.
const HIDDEN: [&str; 2] = [".ci", ".cargo"];

/// Every file of the repository that is text, in the order of its path.
pub fn files(root: &Path) -> Vec<Source> {
    let ours = |entry: &walkdir::DirEntry| {
        let name = entry.file_name().to_string_lossy();
        let hidden = name.starts_with('.') && !HIDDEN.contains(&&*name);
        let foreign = entry.depth() == 1 && FOREIGN.contains(&&*name);
        entry.depth() == 0 || !(hidden || foreign || name == "__pycache__" || name == "node_modules")
    };
    let read = |path: PathBuf| {
        let relative = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
        Some(Source { path: relative, text: fs::read_to_string(path).ok()? })
    };
    WalkDir::new(root)
        .sort_by_file_name()
        .into_iter()
        .filter_entry(ours)
        .filter_map(Result::ok)
        .filter(|entry| entry.file_type().is_file())
        .filter_map(|entry| read(entry.into_path()))
        .collect()
}

/// Every Rust file of the repository, parsed.
///
/// # Panics
/// When a file does not parse.
pub fn rust_files(root: &Path) -> Vec<(Source, syn::File)> {
    files(root)
        .into_iter()
        .filter(|source| source.has_extension("rs"))
        .map(|source| match syn::parse_file(&source.text) {
            Ok(parsed) => (source, parsed),
            Err(error) => panic!("{}:{}: {error}", source.path, error.span().start().line),
        })
        .collect()
}

impl Source {
    /// Whether the file's name ends in `.extension`.
    pub fn has_extension(&self, extension: &str) -> bool {
        Path::new(&self.path).extension().is_some_and(|found| found == extension)
    }

    /// Whether the whole file is for tests or benchmarks.
    pub fn is_test(&self) -> bool {
        let test =
            |part: &str| matches!(part, "tests" | "tests.rs" | "benches") || part.ends_with("_tests.rs");
        self.path.split('/').any(test)
    }
}

/// A function and where it stands.
#[derive(Debug, Clone)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// First line, without documentation and attributes.
    pub line: usize,
    /// Lines to the closing brace.
    pub lines: usize,
}

/// What [`inspect`] finds in one file.
#[derive(Debug, Default)]
pub struct Findings {
    /// Every function with a body, tests included.
    pub functions: Vec<Function>,
    /// Lines of `unwrap` and `expect` calls outside tests.
    pub unwraps: Vec<usize>,
    /// Lines of `unsafe` blocks, functions and impls, tests included.
    pub unsafes: Vec<usize>,
    /// Number of `pub` items, fields and variants left to their parents.
    pub public: usize,
    /// `pub` items without documentation: line and name.
    pub undocumented: Vec<(usize, String)>,
}

/// Looks through one parsed file.
pub fn inspect(source: &Source, file: &syn::File) -> Findings {
    let mut inspector = Inspector { found: Findings::default(), in_test: source.is_test() };
    inspector.visit_file(file);
    inspector.found
}

/// Whether the attributes say `#[test]`, `#[tokio::test]` or `#[cfg(test)]`.
pub(crate) fn is_test_item(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let path = attribute.path();
        let named_test = path.segments.last().is_some_and(|segment| segment.ident == "test");
        let cfg_test = path.is_ident("cfg")
            && matches!(&attribute.meta, syn::Meta::List(list) if list.tokens.to_string() == "test");
        named_test || cfg_test
    })
}

struct Inspector {
    found: Findings,
    in_test: bool,
}

impl Inspector {
    fn function(&mut self, signature: &syn::Signature, block: &syn::Block) {
        let line = signature.span().start().line;
        let lines = block.span().end().line - line + 1;
        self.found.functions.push(Function { name: signature.ident.to_string(), line, lines });
        if signature.unsafety.is_some() {
            self.found.unsafes.push(line);
        }
    }

    fn public(
        &mut self,
        visibility: &syn::Visibility,
        attributes: &[syn::Attribute],
        name: &dyn std::fmt::Display,
    ) {
        if self.in_test || !matches!(visibility, syn::Visibility::Public(_)) {
            return;
        }
        self.found.public += 1;
        if !attributes.iter().any(|attribute| attribute.path().is_ident("doc")) {
            self.found.undocumented.push((visibility.span().start().line, name.to_string()));
        }
    }

    fn within(&mut self, attributes: &[syn::Attribute], visit: impl FnOnce(&mut Self)) {
        let before = self.in_test;
        self.in_test |= is_test_item(attributes);
        visit(self);
        self.in_test = before;
    }
}

impl<'ast> Visit<'ast> for Inspector {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        // The file of `pub mod name;` documents itself.
        self.within(&item.attrs, |this| visit::visit_item_mod(this, item));
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.within(&item.attrs, |this| {
            this.public(&item.vis, &item.attrs, &item.sig.ident);
            this.function(&item.sig, &item.block);
            visit::visit_item_fn(this, item);
        });
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.within(&item.attrs, |this| {
            this.public(&item.vis, &item.attrs, &item.sig.ident);
            this.function(&item.sig, &item.block);
            visit::visit_impl_item_fn(this, item);
        });
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if item.unsafety.is_some() {
            self.found.unsafes.push(item.span().start().line);
        }
        self.within(&item.attrs, |this| visit::visit_item_impl(this, item));
    }

    fn visit_item_struct(&mut self, item: &'ast syn::ItemStruct) {
        self.public(&item.vis, &item.attrs, &item.ident);
        // Fields of a type that the crate keeps to itself are not public, whatever they say.
        let fields = item.fields.iter().filter(|_| matches!(item.vis, syn::Visibility::Public(_)));
        for (field, name) in fields.filter_map(|field| Some((field, field.ident.as_ref()?))) {
            self.public(&field.vis, &field.attrs, name);
        }
        visit::visit_item_struct(self, item);
    }

    fn visit_item_enum(&mut self, item: &'ast syn::ItemEnum) {
        self.public(&item.vis, &item.attrs, &item.ident);
        for variant in &item.variants {
            self.public(&item.vis, &variant.attrs, &variant.ident);
        }
        visit::visit_item_enum(self, item);
    }

    fn visit_item_trait(&mut self, item: &'ast syn::ItemTrait) {
        self.public(&item.vis, &item.attrs, &item.ident);
        visit::visit_item_trait(self, item);
    }

    fn visit_item_type(&mut self, item: &'ast syn::ItemType) {
        self.public(&item.vis, &item.attrs, &item.ident);
    }

    fn visit_item_const(&mut self, item: &'ast syn::ItemConst) {
        self.public(&item.vis, &item.attrs, &item.ident);
        visit::visit_item_const(self, item);
    }

    fn visit_item_static(&mut self, item: &'ast syn::ItemStatic) {
        self.public(&item.vis, &item.attrs, &item.ident);
        visit::visit_item_static(self, item);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        // A method of our own may be called `expect` too; the one that panics is given a text.
        let text = call.args.iter().all(|given| matches!(given, syn::Expr::Lit(_) | syn::Expr::Reference(_)));
        let panics =
            text && ["unwrap", "expect", "unwrap_err", "expect_err"].iter().any(|name| call.method == name);
        if panics && !self.in_test {
            self.found.unwraps.push(call.method.span().start().line);
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_expr_unsafe(&mut self, block: &'ast syn::ExprUnsafe) {
        self.found.unsafes.push(block.span().start().line);
        visit::visit_expr_unsafe(self, block);
    }
}
