//! Owns the tokens: the local one in the data folder, and those of a file that holds only their hashes.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use uuid::Uuid;

use crate::digest::Digest;
use crate::door::Role;

/// Longest token that is looked at.
const MAX_TOKEN: usize = 256;

/// Everybody's tokens.
#[derive(Debug)]
pub struct Tokens {
    /// Hash of the local token.
    local: Digest,
    file: PathBuf,
    known: Mutex<Known>,
}

/// What the file said when it was last read.
#[derive(Debug, Default)]
struct Known {
    /// When the file had last been changed; `None` while there is none.
    changed: Option<SystemTime>,
    by_hash: BTreeMap<Digest, (Role, String)>,
}

impl Tokens {
    /// Opens the tokens of a data folder: makes `token`, which only this account can read, if it is not there, and
    /// reads `file` (or `tokens` in the folder), which may come later.
    ///
    /// # Errors
    /// When a file cannot be made or read, or has a line that is not a token's.
    pub fn open(data: &Path, file: Option<&Path>) -> io::Result<Self> {
        let token = local_token(&data.join("token"))?;
        let file = file.map_or_else(|| data.join("tokens"), Path::to_owned);
        let tokens = Self { local: Digest::of(token.as_bytes()), file, known: Mutex::default() };
        tokens.refresh()?;
        Ok(tokens)
    }

    /// Whose token this is: role and name.
    pub fn find(&self, token: &str) -> Option<(Role, String)> {
        if token.len() > MAX_TOKEN {
            return None;
        }
        // Hashes are compared, not tokens: how long that takes says nothing about a token.
        let hash = Digest::of(token.as_bytes());
        if hash == self.local {
            return Some((Role::Admin, "local".to_owned()));
        }
        if let Err(e) = self.refresh() {
            tracing::error!("tokens stay as they were: {e}");
        }
        self.known.lock().unwrap_or_else(PoisonError::into_inner).by_hash.get(&hash).cloned()
    }

    /// Reads the file again if it has changed, so that a token that was removed is refused at once.
    fn refresh(&self) -> io::Result<()> {
        let changed = match fs::metadata(&self.file) {
            Ok(facts) => Some(facts.modified()?),
            Err(e) if e.kind() == io::ErrorKind::NotFound => None,
            Err(e) => return Err(named(&self.file, &e)),
        };
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if known.changed == changed {
            return Ok(());
        }
        let text = match changed {
            Some(_) => fs::read_to_string(&self.file).map_err(|e| named(&self.file, &e))?,
            None => String::new(),
        };
        *known =
            Known { changed, by_hash: parse(&text).map_err(|e| named(&self.file, &io::Error::other(e)))? };
        Ok(())
    }
}

/// The lines `ROLE NAME SHA256-OF-TOKEN`; empty ones and those that begin with # do not count.
fn parse(text: &str) -> Result<BTreeMap<Digest, (Role, String)>, String> {
    let mut by_hash = BTreeMap::new();
    for (number, line) in text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let parts: Vec<&str> = line.split_whitespace().collect();
        let [role, name, hash] = parts[..] else {
            return Err(format!("line {number}: expected ROLE NAME SHA256, found {} words", parts.len()));
        };
        let role: Role = role.parse().map_err(|e| format!("line {number}: {e}"))?;
        let hash: Digest = hash.parse().map_err(|e| format!("line {number}: {e}"))?;
        by_hash.insert(hash, (role, name.to_owned()));
    }
    Ok(by_hash)
}

/// A new token: 244 random bits.
pub fn new_token() -> String {
    format!("{}{}", Uuid::new_v4().simple(), Uuid::new_v4().simple())
}

/// The line of a tokens file for a token; it does not tell the token.
pub fn line(role: Role, name: &str, token: &str) -> String {
    format!("{role} {name} {}", Digest::of(token.as_bytes()))
}

/// The token in the file, made if there is none. Only the owner may read it: others are kept from an old file too.
fn local_token(path: &Path) -> io::Result<String> {
    match OpenOptions::new().write(true).create_new(true).mode(0o600).open(path) {
        Ok(mut file) => {
            let token = new_token();
            file.write_all(token.as_bytes())?;
            file.sync_all()?;
            Ok(token)
        }
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {
            fs::set_permissions(path, fs::Permissions::from_mode(0o600)).map_err(|e| named(path, &e))?;
            let token = fs::read_to_string(path).map_err(|e| named(path, &e))?.trim().to_owned();
            if token.len() < 32 {
                let text = "found no token in it: delete it and start again";
                return Err(named(path, &io::Error::other(text)));
            }
            Ok(token)
        }
        Err(e) => Err(named(path, &e)),
    }
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::{Tokens, line, new_token};
    use crate::door::Role;
    use std::fs;
    use std::os::unix::fs::PermissionsExt as _;

    #[test]
    fn the_local_token_is_made_once_and_for_its_owner_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("token");
        Tokens::open(dir.path(), None).unwrap();
        let token = fs::read_to_string(&path).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        let tokens = Tokens::open(dir.path(), None).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(tokens.find(&token).unwrap().0, Role::Admin);
        assert_eq!(tokens.find(""), None);
        assert_eq!(tokens.find(&"x".repeat(100_000)), None);
        fs::write(&path, "").unwrap();
        assert!(Tokens::open(dir.path(), None).unwrap_err().to_string().contains("delete it"));
    }

    #[test]
    fn a_token_counts_while_its_line_is_there() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("tokens");
        let tokens = Tokens::open(dir.path(), None).unwrap();
        let token = new_token();
        assert_eq!(tokens.find(&token), None);
        fs::write(&file, format!("# farm\n\n{}\n", line(Role::Work, "farm", &token))).unwrap();
        assert_eq!(tokens.find(&token), Some((Role::Work, "farm".to_owned())));
        assert!(!fs::read_to_string(&file).unwrap().contains(&token), "only its hash is stored");
        fs::remove_file(&file).unwrap();
        assert_eq!(tokens.find(&token), None);
    }

    #[test]
    fn a_wrong_line_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("tokens");
        for (text, part) in [
            ("work farm", "line 1: expected ROLE NAME SHA256, found 2 words"),
            ("\nroot farm 00", "line 2: found \"root\""),
            ("work farm 00", "line 1: expected 64"),
        ] {
            fs::write(&file, text).unwrap();
            let error = Tokens::open(dir.path(), None).unwrap_err().to_string();
            assert!(error.contains(part) && error.contains("tokens"), "{error}");
        }
    }
}
