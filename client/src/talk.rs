//! What the command says: results on stdout (lines of JSON with `--json`), everything else on stderr.

use std::fmt::Display;
use std::io::{self, Write};

use serde_json::Value;

/// How to talk.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Talk {
    /// One JSON object per line on stdout instead of text.
    pub(crate) json: bool,
}

impl Talk {
    /// A result: `value` with `--json`, else `text`. A reader that went away is not an error.
    pub(crate) fn result(self, text: &dyn Display, value: &Value) {
        let _ = if self.json { writeln!(io::stdout(), "{value}") } else { writeln!(io::stdout(), "{text}") };
    }

    /// A result that only scripts want.
    pub(crate) fn event(self, value: &Value) {
        if self.json {
            let _ = writeln!(io::stdout(), "{value}");
        }
    }

    /// A remark for people.
    #[expect(clippy::unused_self, reason = "talking needs a talker")]
    pub(crate) fn say(self, text: &dyn Display) {
        let _ = writeln!(io::stderr(), "{text}");
    }

    /// The last words of a command that failed.
    pub(crate) fn error(self, error: &dyn Display, hint: Option<&str>) {
        self.say(&format_args!("error: {error}"));
        if let Some(hint) = hint {
            self.say(&format_args!("  hint: {hint}"));
        }
    }
}
