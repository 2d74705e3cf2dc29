//! Owns the walk over a document's tree while it is decoded: where one is, and what is wrong there.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;

use crate::scene::document::asset::AssetRef;
use crate::scene::document::decode::Decode;
use crate::scene::document::limits::Limits;
use crate::scene::document::nearest::nearest;
use crate::scene::document::path::Path;
use crate::scene::document::problem::Problems;
use crate::scene::document::rule::{Rule, Table};
use crate::scene::document::source::Source;
use crate::scene::document::tree::{Node, Value, shorten};

/// What one decoding of a document collects.
#[derive(Debug)]
pub(super) struct Context<'a> {
    pub(super) source: &'a Source,
    pub(super) limits: &'a Limits,
    /// Names in the tables that others refer to.
    materials: BTreeSet<&'a str>,
    meshes: BTreeSet<&'a str>,
    media: BTreeSet<&'a str>,
    /// The frame that is decoded; `None` for the document as it is written.
    frame: Option<i32>,
    pub(super) problems: RefCell<Problems>,
    pub(super) assets: RefCell<Vec<AssetRef>>,
    pub(super) sdf_nodes: Cell<u64>,
}

impl<'a> Context<'a> {
    /// A context for the document whose tree is `root`.
    pub(super) fn new(source: &'a Source, limits: &'a Limits, root: &'a Node, frame: Option<i32>) -> Self {
        let names = |table: Table| {
            let members = root.get(table.field()).map_or(&[][..], Node::members);
            members.iter().map(|member| member.name.as_str()).collect()
        };
        Self {
            source,
            limits,
            materials: names(Table::Materials),
            meshes: names(Table::Meshes),
            media: names(Table::Media),
            frame,
            problems: RefCell::default(),
            assets: RefCell::default(),
            sdf_nodes: Cell::new(0),
        }
    }

    /// The asset files, each once, in the order in which they were met.
    ///
    /// # Errors
    /// What was found wrong.
    pub(super) fn finish(self) -> Result<Vec<AssetRef>, Problems> {
        let mut seen = BTreeSet::new();
        let mut assets = self.assets.into_inner();
        assets.retain(|asset| seen.insert(asset.path.clone()));
        self.problems.into_inner().or(assets)
    }

    /// The known name that a misspelt one meant, for problems that will be kept: the search takes its time.
    pub(super) fn nearest<'n>(
        &self,
        found: &str,
        known: impl IntoIterator<Item = &'n str>,
    ) -> Option<&'n str> {
        let kept = self.problems.borrow().total < Problems::KEPT;
        kept.then(|| nearest(found, known)).flatten()
    }

    /// The names in a table.
    pub(super) fn names(&self, table: Table) -> &BTreeSet<&'a str> {
        match table {
            Table::Materials => &self.materials,
            Table::Meshes => &self.meshes,
            Table::Media => &self.media,
        }
    }
}

/// The name of a type of objects with its article.
pub(super) fn an_object(title: &str) -> String {
    let vowel = title.starts_with(['a', 'e', 'i', 'o', 'u']) || title.starts_with("SDF");
    format!("{} {title} object", if vowel { "an" } else { "a" })
}

/// A place in the tree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cursor<'a> {
    pub(super) node: &'a Node,
    pub(super) path: Path<'a>,
    pub(super) context: &'a Context<'a>,
}

impl<'a> Cursor<'a> {
    /// The whole document.
    pub(super) fn root(node: &'a Node, context: &'a Context<'a>) -> Self {
        Self { node, path: Path::ROOT, context }
    }

    /// The member of that name, when this is an object that has one.
    pub(super) fn member(&'a self, name: &'a str) -> Option<Self> {
        Some(Self { node: self.node.get(name)?, path: self.path.name(name), context: self.context })
    }

    /// An element of this list.
    pub(super) fn element(&'a self, index: usize, node: &'a Node) -> Self {
        Self { node, path: self.path.index(index), context: self.context }
    }

    /// Reports what is wrong here.
    pub(super) fn problem(&self, message: impl Into<String>, hint: Option<String>) {
        self.problem_at(self.node.start, &self.path, message.into(), hint);
    }

    /// Reports what is wrong with a member, at its value or, when it is not there, at this object.
    pub(super) fn member_problem(&self, name: &str, message: impl Into<String>, hint: Option<String>) {
        let start = self.node.get(name).map_or(self.node.start, |node| node.start);
        self.problem_at(start, &self.path.name(name), message.into(), hint);
    }

    pub(super) fn problem_at(&self, start: u32, path: &Path<'_>, message: String, hint: Option<String>) {
        let message = match self.context.frame {
            None => message,
            Some(frame) => format!("{message} (at frame {frame})"),
        };
        let problem = self.context.source.problem(start, path.text(), message, hint);
        self.context.problems.borrow_mut().push(problem);
    }

    /// Reports that something else was found than what is allowed.
    pub(super) fn expected(&self, allowed: &str) {
        self.problem(format!("found {}, expected {allowed}", self.found()), None);
    }

    /// The value here in words.
    pub(super) fn found(&self) -> String {
        match &self.node.value {
            Value::Null => "null".to_owned(),
            Value::Bool(value) => value.to_string(),
            Value::Number(number) => {
                let written = self.context.source.slice(self.node.start, self.node.end);
                if self.node.blended || written.is_empty() { number.to_string() } else { shorten(written) }
            }
            Value::Text(text) => format!("{:?}", shorten(text)),
            Value::List(items) => format!("a list of {}", items.len()),
            Value::Object(_) => "an object".to_owned(),
        }
    }

    /// Whether this is an object; otherwise that is reported.
    pub(super) fn is_object(&self, what: &str) -> bool {
        let is = matches!(self.node.value, Value::Object(_));
        if !is {
            self.expected(&an_object(what));
        }
        is
    }

    /// Reports the members that have no meaning here.
    pub(super) fn only(&self, what: &str, known: &[&str]) {
        for member in self.node.members() {
            if !known.contains(&member.name.as_str()) {
                let near = self.context.nearest(&member.name, known.iter().copied());
                let all = || format!("fields of {what}: {}", known.join(", "));
                let hint = near.map_or_else(all, |name| format!("did you mean {name:?}?"));
                let path = self.path.name(&member.name);
                self.problem_at(member.start, &path, format!("unknown field of {what}"), Some(hint));
            }
        }
    }

    /// Decodes a member by its rule.
    pub(super) fn field<T: Decode>(&self, name: &str, rule: Rule<T>) -> Option<T> {
        if let Some(member) = self.member(name) {
            return T::decode(&member, &rule.allowed);
        }
        if rule.default.is_none() {
            let message = format!("found nothing, expected {}", T::expected(&rule.allowed));
            self.member_problem(name, message, None);
        }
        rule.default
    }

    /// The variant that `"type"` names among `tags`; otherwise what is wrong is reported.
    pub(super) fn tag(&self, what: &str, tags: &[&'static str]) -> Option<&'static str> {
        if !self.is_object(what) {
            return None;
        }
        let allowed = || format!("{what} types: {}", tags.join(", "));
        let Some(member) = self.member("type") else {
            self.member_problem(
                "type",
                format!("found nothing, expected the type of the {what}"),
                Some(allowed()),
            );
            return None;
        };
        let Value::Text(found) = &member.node.value else {
            member.expected("a string");
            return None;
        };
        let tag = tags.iter().copied().find(|tag| tag == found);
        if tag.is_none() {
            let hint = self
                .context
                .nearest(found, tags.iter().copied())
                .map(|name| format!("did you mean {name:?}?"));
            let message = format!("found {}, expected a {what} type", member.found());
            member.problem(message, Some(hint.unwrap_or_else(allowed)));
        }
        tag
    }
}
