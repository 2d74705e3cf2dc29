//! Owns what is wrong with a document, and how it is said.

use std::fmt;

/// One thing that is wrong, with its place in the document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Name of the document, or of what else brought the value.
    pub origin: String,
    /// Line in the document from 1; 0 when the problem has no line.
    pub line: u32,
    /// Column in characters from 1; 0 when the problem has no line.
    pub column: u32,
    /// Path in the document, such as `spheres.lamp.radius`; empty for the document as a whole.
    pub path: String,
    /// What was found and what is allowed.
    pub message: String,
    /// What to do about it.
    pub hint: Option<String>,
}

impl Problem {
    /// A problem without a line.
    pub fn new(origin: impl Into<String>, path: impl Into<String>, message: impl Into<String>) -> Self {
        let (origin, path, message) = (origin.into(), path.into(), message.into());
        Self { origin, line: 0, column: 0, path, message, hint: None }
    }

    /// The same problem with advice.
    #[must_use]
    pub fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:", self.origin)?;
        if self.line > 0 {
            write!(out, "{}:{}:", self.line, self.column)?;
        }
        if !self.path.is_empty() {
            write!(out, " {}:", self.path)?;
        }
        write!(out, " {}", self.message)?;
        self.hint.as_ref().map_or(Ok(()), |hint| write!(out, "\n  hint: {hint}"))
    }
}

/// Everything that is wrong: the first [`Problems::KEPT`] and the count of all.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Problems {
    /// The first problems, in the order in which they were found.
    pub problems: Vec<Problem>,
    /// Number of problems, those left out of the list included.
    pub total: usize,
}

impl Problems {
    /// How many problems are kept with their text.
    pub const KEPT: usize = 50;

    /// Adds a problem; beyond [`Problems::KEPT`] it is only counted.
    pub fn push(&mut self, problem: Problem) {
        self.total += 1;
        if self.problems.len() < Self::KEPT {
            self.problems.push(problem);
        }
    }

    /// Whether nothing is wrong.
    pub fn is_empty(&self) -> bool {
        self.total == 0
    }

    /// `value` when nothing is wrong.
    ///
    /// # Errors
    /// The problems, when there are any.
    pub fn or<T>(self, value: T) -> Result<T, Self> {
        if self.is_empty() { Ok(value) } else { Err(self) }
    }
}

impl From<Problem> for Problems {
    fn from(problem: Problem) -> Self {
        Self { problems: vec![problem], total: 1 }
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.problems.iter().enumerate() {
            write!(out, "{}{problem}", if index > 0 { "\n" } else { "" })?;
        }
        match self.total - self.problems.len() {
            0 => Ok(()),
            more => write!(out, "\nand {more} more"),
        }
    }
}

impl std::error::Error for Problems {}
