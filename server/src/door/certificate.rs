//! Owns certificates that a server makes for itself: enough where clients can be told which one to expect.

use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

/// A certificate and its key, as PEM files.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// The certificate, with those between it and its root.
    pub cert: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

impl TlsFiles {
    /// Where a data folder has them.
    pub fn of(data: &Path) -> Self {
        Self { cert: data.join("tls").join("cert.pem"), key: data.join("tls").join("key.pem") }
    }
}

/// Makes a self-signed certificate for these names and addresses, and its key, which only this account can read;
/// false when there is one already.
///
/// # Errors
/// A name that cannot be in a certificate; a file that cannot be made.
pub fn make_certificate(files: &TlsFiles, names: &[String]) -> io::Result<bool> {
    if files.cert.exists() {
        return Ok(false);
    }
    let made = rcgen::generate_simple_self_signed(names)
        .map_err(|e| io::Error::other(format!("no certificate for {names:?}: {e}")))?;
    if let Some(folder) = files.cert.parent() {
        fs::create_dir_all(folder)?;
    }
    // The key first: a certificate that is there has its key.
    let mut key = OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&files.key)?;
    key.write_all(made.signing_key.serialize_pem().as_bytes())?;
    key.sync_all()?;
    fs::write(&files.cert, made.cert.pem())?;
    Ok(true)
}
