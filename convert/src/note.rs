//! Owns what an importer says about its work.

use std::fmt;

/// Something that the document does not say as the scene did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// The file that says it.
    pub file: String,
    /// Line in the file, counted from 1; 0 where it has none.
    pub line: u32,
    /// What kind of note it is.
    pub kind: NoteKind,
    /// What was found, and what became of it.
    pub text: String,
}

/// What kind of note it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoteKind {
    /// It is not in the document: the picture lacks it.
    Untranslated,
    /// It is in the document with a somewhat different meaning.
    Differs,
}

impl fmt::Display for Note {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.file)?;
        if self.line > 0 {
            write!(out, ":{}", self.line)?;
        }
        match self.kind {
            NoteKind::Untranslated => write!(out, ": not translated: {}", self.text),
            NoteKind::Differs => write!(out, ": differs: {}", self.text),
        }
    }
}
