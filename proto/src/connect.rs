//! How programs reach a server: its address, and the token that goes with every call.

use std::fs;
use std::io::{self, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Uri};
use tonic::{Request, Status};

/// A channel whose calls carry a token.
pub type Line = InterceptedService<Channel, Bearer>;

/// Why a server cannot be addressed.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// Not an address.
    #[error("server address: found {0:?}, expected http://HOST:PORT or https://HOST:PORT")]
    Address(String),
    /// The file of the certificate cannot be read or holds none.
    #[error("certificate file {}: {cause}", .path.display())]
    Certificate {
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// The file of the token cannot be read or holds none.
    #[error("token file {}: {cause}", .path.display())]
    Token {
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
}

/// Adds a token to every call.
#[derive(Debug, Clone, Default)]
pub struct Bearer(Option<MetadataValue<Ascii>>);

impl Bearer {
    /// The bearer of a token; of none when the text is empty.
    ///
    /// # Errors
    /// The text cannot travel in a header.
    pub fn new(token: &str) -> io::Result<Self> {
        if token.is_empty() {
            return Ok(Self(None));
        }
        let mut value: MetadataValue<Ascii> = format!("Bearer {token}").parse().map_err(|_| {
            io::Error::other("found characters that cannot be sent, expected the token alone, in one line")
        })?;
        value.set_sensitive(true);
        Ok(Self(Some(value)))
    }

    /// The token; empty when there is none.
    pub fn token(&self) -> &str {
        let header = self.0.as_ref().and_then(|value| value.to_str().ok());
        header.and_then(|text| text.strip_prefix("Bearer ")).unwrap_or_default()
    }

    /// The bearer of the token in a file.
    ///
    /// # Errors
    /// The file cannot be read, or is empty.
    pub fn read(path: &Path) -> Result<Self, ConnectError> {
        let named = |cause| ConnectError::Token { path: path.to_owned(), cause };
        let text = fs::read_to_string(path).map_err(named)?;
        if text.trim().is_empty() {
            return Err(named(io::Error::other("it is empty")));
        }
        Self::new(text.trim()).map_err(named)
    }
}

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(token) = &self.0 {
            request.metadata_mut().insert("authorization", token.clone());
        }
        Ok(request)
    }
}

/// The endpoint of a server, with what keeps a connection alive. An `https` server must show a certificate that
/// the one in `ca_file` has signed (or that is the same), without one that this machine trusts.
///
/// # Errors
/// [`ConnectError::Address`], [`ConnectError::Certificate`].
pub fn endpoint(server: &str, ca_file: Option<&Path>) -> Result<Endpoint, ConnectError> {
    let address = || ConnectError::Address(server.to_owned());
    let mut endpoint = Endpoint::from_shared(server.to_owned()).map_err(|_| address())?;
    match endpoint.uri().scheme_str() {
        Some("http") => {}
        Some("https") => {
            let tls = match ca_file {
                Some(path) => ClientTlsConfig::new().ca_certificate(read_certificate(path)?),
                None => ClientTlsConfig::new().with_native_roots(),
            };
            endpoint = endpoint.tls_config(tls).map_err(|_| address())?;
        }
        _ => return Err(address()),
    }
    Ok(endpoint
        .connect_timeout(Duration::from_secs(5))
        .http2_keep_alive_interval(Duration::from_secs(30))
        .keep_alive_timeout(Duration::from_secs(10))
        .tcp_nodelay(true))
}

fn read_certificate(path: &Path) -> Result<Certificate, ConnectError> {
    let named = |cause| ConnectError::Certificate { path: path.to_owned(), cause };
    let pem = fs::read_to_string(path).map_err(named)?;
    if !pem.contains("-----BEGIN CERTIFICATE-----") {
        return Err(named(io::Error::other("expected a PEM file with a certificate")));
    }
    Ok(Certificate::from_pem(pem))
}

/// The token for a server: the file that was named, else what a server on this machine left for its own account
/// under `state`, else none.
///
/// # Errors
/// [`ConnectError::Token`] for a file that was named.
pub fn bearer(server: &str, token_file: Option<&Path>, state: Option<&Path>) -> Result<Bearer, ConnectError> {
    if let Some(path) = token_file {
        return Bearer::read(path);
    }
    let left = loopback_port(server).zip(state).and_then(|(port, state)| {
        let path = fs::read_to_string(signpost(state, port)).ok()?;
        Bearer::read(Path::new(path.trim())).ok()
    });
    Ok(left.unwrap_or_default())
}

/// Tells programs of this account where the token of the server on a port is. Best effort: who has no such folder
/// names the file.
///
/// # Errors
/// The folder or the file cannot be made.
pub fn leave_signpost(state: &Path, port: u16, token_file: &Path) -> io::Result<()> {
    let path = signpost(state, port);
    fs::create_dir_all(path.parent().unwrap_or(state))?;
    let mut file = fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(path)?;
    writeln!(file, "{}", fs::canonicalize(token_file)?.display())
}

/// Takes the signpost away when it still shows to this token.
pub fn remove_signpost(state: &Path, port: u16, token_file: &Path) {
    let path = signpost(state, port);
    let is_own = fs::read_to_string(&path).ok().zip(fs::canonicalize(token_file).ok());
    if is_own.is_some_and(|(text, own)| Path::new(text.trim()) == own) {
        let _ = fs::remove_file(path);
    }
}

fn signpost(state: &Path, port: u16) -> PathBuf {
    state.join("karst").join("servers").join(port.to_string())
}

fn loopback_port(server: &str) -> Option<u16> {
    let uri: Uri = server.parse().ok()?;
    let host = uri.host()?.trim_matches(['[', ']']);
    let is_loopback =
        host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback());
    if is_loopback { uri.port_u16() } else { None }
}

#[cfg(test)]
mod tests {
    use super::{bearer, endpoint, leave_signpost, loopback_port, remove_signpost};
    use std::fs;

    #[test]
    fn only_loopback_has_signposts() {
        assert_eq!(loopback_port("http://127.0.0.1:7878"), Some(7878));
        assert_eq!(loopback_port("http://[::1]:80"), Some(80));
        assert_eq!(loopback_port("http://localhost:1"), Some(1));
        for other in ["http://192.168.1.5:80", "http://example.org:80", "http://127.0.0.1", "", "nonsense"] {
            assert_eq!(loopback_port(other), None, "{other}");
        }
    }

    #[test]
    fn a_program_of_the_same_account_finds_the_token() {
        let dir = tempfile::tempdir().unwrap();
        let (state, token) = (dir.path().join("state"), dir.path().join("token"));
        fs::write(&token, "secret\n").unwrap();
        leave_signpost(&state, 7, &token).unwrap();
        let found = |server: &str| bearer(server, None, Some(&state)).unwrap().0.is_some();
        assert!(found("http://127.0.0.1:7") && !found("http://127.0.0.1:8") && !found("http://10.0.0.1:7"));
        remove_signpost(&state, 7, &dir.path().join("other"));
        assert!(found("http://127.0.0.1:7"), "another server's signpost stays");
        remove_signpost(&state, 7, &token);
        assert!(!found("http://127.0.0.1:7"));
        assert!(bearer("http://127.0.0.1:7", Some(&dir.path().join("nothing")), None).is_err());
        assert!(endpoint("ftp://x", None).is_err() && endpoint("http://localhost:1", None).is_ok());
        let error = endpoint("https://localhost:1", Some(&token)).unwrap_err().to_string();
        assert!(error.contains("PEM"), "{error}");
    }
}
