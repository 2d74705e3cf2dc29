//! Owns the text of a document and where things stand in it.

use crate::scene::document::problem::Problem;

/// The text of a document with its name.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) origin: String,
    text: String,
    /// Byte offsets at which lines begin.
    lines: Vec<usize>,
}

impl Source {
    /// Takes the text; it is at most 4 GiB long, as the limits of documents guarantee.
    pub(super) fn new(origin: &str, text: &str) -> Self {
        let starts = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n').map(|(at, _)| at + 1);
        let lines = std::iter::once(0).chain(starts).collect();
        Self { origin: origin.to_owned(), text: text.to_owned(), lines }
    }

    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Text between two byte offsets; empty when they are not in the text.
    pub(super) fn slice(&self, start: u32, end: u32) -> &str {
        self.text.get(start as usize..end as usize).unwrap_or("")
    }

    /// Line and column of a byte offset, both from 1.
    pub(super) fn place(&self, offset: u32) -> (u32, u32) {
        let offset = (offset as usize).min(self.text.len());
        let line = self.lines.partition_point(|&start| start <= offset) - 1;
        let before = self.text.get(self.lines[line]..offset).unwrap_or("");
        (line as u32 + 1, before.chars().count() as u32 + 1)
    }

    /// A problem at a byte offset.
    pub(super) fn problem(
        &self,
        offset: u32,
        path: String,
        message: String,
        hint: Option<String>,
    ) -> Problem {
        let (line, column) = self.place(offset);
        Problem { origin: self.origin.clone(), line, column, path, message, hint }
    }
}
