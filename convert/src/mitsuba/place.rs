//! Owns places in the files of a scene, and errors that name them.

use std::rc::Rc;

use crate::ConvertError;

/// A line in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    /// The file, as messages call it.
    pub(super) file: Rc<str>,
    /// Counted from 1.
    pub(super) line: u32,
}

impl Place {
    /// What is wrong here.
    pub(super) fn error(&self, message: impl Into<String>) -> ConvertError {
        ConvertError::scene(&*self.file, self.line, message)
    }
}
