//! Runs `karst` in a folder.

use std::path::Path;
use std::process::{Command, Output};

/// What `karst LINE` gives in a folder.
pub(crate) fn karst(folder: &Path, line: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_karst")).args(line).current_dir(folder).output().unwrap()
}

/// What `karst LINE`, which must succeed, prints.
pub(crate) fn done(folder: &Path, line: &[&str]) -> String {
    let output = karst(folder, line);
    assert_eq!(output.status.code(), Some(0), "{line:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
