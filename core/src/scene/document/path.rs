//! Owns paths in a document: names joined by dots, places in lists in brackets.

use std::fmt;

/// Longest path that a message shows, in characters.
const SHOWN: usize = 200;

/// A path that is built on the stack while a document is walked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path<'a> {
    parent: Option<&'a Path<'a>>,
    step: Step<'a>,
}

/// One step down.
#[derive(Debug, Clone, Copy)]
enum Step<'a> {
    Root,
    Name(&'a str),
    Index(usize),
}

impl<'a> Path<'a> {
    /// The document itself.
    pub(super) const ROOT: Path<'static> = Path { parent: None, step: Step::Root };

    /// A member of an object.
    pub(super) fn name(&'a self, name: &'a str) -> Self {
        Self { parent: Some(self), step: Step::Name(name) }
    }

    /// An element of a list.
    pub(super) fn index(&'a self, index: usize) -> Self {
        Self { parent: Some(self), step: Step::Index(index) }
    }

    /// The name of the last step; empty for the document and for elements of lists.
    pub(super) fn last_name(&self) -> &'a str {
        if let Step::Name(name) = self.step { name } else { "" }
    }

    /// The path in words, shortened where it is very long.
    pub(super) fn text(&self) -> String {
        let full = self.to_string();
        match full.char_indices().nth(SHOWN) {
            None => full,
            Some((cut, _)) => format!("{}…", &full[..cut]),
        }
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(parent) = self.parent {
            parent.fmt(out)?;
        }
        match self.step {
            Step::Root => Ok(()),
            Step::Name(name) => {
                let top = self.parent.is_none_or(|parent| matches!(parent.step, Step::Root));
                write!(out, "{}{}", if top { "" } else { "." }, name.escape_debug())
            }
            Step::Index(index) => write!(out, "[{index}]"),
        }
    }
}
