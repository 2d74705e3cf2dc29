//! Owns what keeps a scene from being converted.

use std::io;
use std::path::PathBuf;

use crate::EXTENSIONS;

/// Why a scene could not be converted.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// A file could not be read.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The name does not end like that of a scene karst knows.
    #[error("{}: expected a scene whose name ends in one of {}", path.display(), EXTENSIONS.map(|end| format!(".{end}")).join(", "))]
    Unknown {
        /// Which file.
        path: PathBuf,
    },
    /// The scene is wrong.
    #[error("{file}{}: {message}{}", line_of(*line), hint_of(hint.as_deref()))]
    Scene {
        /// Which file.
        file: String,
        /// Line in the file, counted from 1; 0 where it has none.
        line: u32,
        /// What was found, and what is allowed.
        message: String,
        /// What to do about it.
        hint: Option<String>,
    },
}

impl ConvertError {
    /// A [`ConvertError::Scene`] without a hint.
    pub fn scene(file: impl Into<String>, line: u32, message: impl Into<String>) -> Self {
        Self::Scene { file: file.into(), line, message: message.into(), hint: None }
    }

    /// The same with what to do about it.
    #[must_use]
    pub fn with_hint(mut self, text: impl Into<String>) -> Self {
        if let Self::Scene { hint, .. } = &mut self {
            *hint = Some(text.into());
        }
        self
    }
}

fn line_of(line: u32) -> String {
    if line == 0 { String::new() } else { format!(":{line}") }
}

fn hint_of(hint: Option<&str>) -> String {
    hint.map(|hint| format!("\n  hint: {hint}")).unwrap_or_default()
}
