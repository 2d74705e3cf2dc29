//! Owns the command line; the only file that reads the environment.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Parser, Subcommand};

use crate::door::{Role, TlsFiles};

/// The karst render service.
#[derive(Debug, Parser)]
#[command(name = "karst-server", version, about, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What the program can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Takes jobs over gRPC and renders them with threads of this process and with workers that join.
    Serve(Serve),
    /// Renders tasks of a server: a worker. It needs no port of its own.
    Work(Work),
    /// Makes tokens for people, programs and workers.
    #[command(subcommand)]
    Token(Token),
    /// Asks a server whether it serves; exit code 0 or 1 within 5 s. Needs no token.
    Health(Health),
}

/// How log lines look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

/// Where traces go. The names are OpenTelemetry's.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Collector {
    /// Address of a collector for traces (OTLP over gRPC), such as <http://127.0.0.1:4317>; without one nothing is
    /// traced.
    #[arg(long = "otlp-endpoint", env = "OTEL_EXPORTER_OTLP_ENDPOINT", value_name = "URL")]
    pub endpoint: Option<String>,
    /// File with the certificate that an https collector must show, or of whoever has signed it.
    #[arg(long = "otlp-ca-file", env = "OTEL_EXPORTER_OTLP_CERTIFICATE", value_name = "FILE")]
    pub ca_file: Option<PathBuf>,
}

/// What a program tells about itself while it runs.
#[derive(Debug, Clone, clap::Args)]
pub struct Told {
    /// Where traces go.
    #[command(flatten)]
    pub collector: Collector,
    /// What to log on stderr, as in `info` or `karst_server=debug,warn`.
    #[arg(long, env = "KARST_LOG", default_value = "info")]
    pub log: String,
    /// How to log.
    #[arg(long, env = "KARST_LOG_FORMAT", value_enum, default_value_t = LogFormat::Text)]
    pub log_format: LogFormat,
}

/// Options of `health`.
#[derive(Debug, Clone, clap::Args)]
pub struct Health {
    /// Address of the server.
    #[arg(long, env = "KARST_SERVER", default_value = "http://127.0.0.1:7878", value_name = "URL")]
    pub server: String,
    /// File with the certificate that an https server must show, or of whoever has signed it.
    #[arg(long, env = "KARST_CA_FILE", value_name = "FILE")]
    pub ca_file: Option<PathBuf>,
}

/// What can be done with tokens.
#[derive(Debug, Subcommand)]
pub enum Token {
    /// Prepares a data folder: the local token, and with --tls a certificate of its own.
    Init {
        /// Makes a self-signed certificate and its key, DIR/tls/cert.pem and DIR/tls/key.pem, if there is none.
        #[arg(long, requires = "names")]
        tls: bool,
        /// A name or address by which the server is reached; may be given several times.
        #[arg(long = "name", value_name = "HOST", value_parser = word)]
        names: Vec<String>,
        /// The data folder; made if it is not there.
        #[arg(long, env = "KARST_DATA", value_name = "DIR", default_value = "karst-data")]
        data: PathBuf,
    },
    /// Makes a token: prints it once, and the line that a tokens file needs to know it.
    New {
        /// What its bearer may do: view (look), submit (and render), work (be a worker), admin (everything).
        #[arg(long)]
        role: Role,
        /// Whose it is, for the log: one word.
        #[arg(long, value_parser = word)]
        name: String,
        /// Adds the line to the tokens of this data folder, where a running server finds it at once.
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
    },
}

/// Options of `serve`.
#[derive(Debug, Clone, clap::Args)]
pub struct Serve {
    /// Address to listen on; port 0 lets the system choose, `listening on http://ADDR` tells which.
    #[arg(long, env = "KARST_LISTEN", default_value = "127.0.0.1:7878", value_parser = address)]
    pub listen: SocketAddr,
    /// Folder for jobs, assets and finished frames; made if it is not there.
    #[arg(long, env = "KARST_DATA", default_value = "karst-data")]
    pub data: PathBuf,
    /// Threads that render here; by default one per processor, 0 leaves it to workers that join.
    #[arg(long, env = "KARST_WORKERS", value_parser = clap::value_parser!(u32).range(0..=1024))]
    pub workers: Option<u32>,
    /// Certificate to show (PEM, with those between it and its root); needed beyond loopback, where without this
    /// option the one in the data folder is taken. See `karst-server token init --tls`.
    #[arg(long, env = "KARST_TLS_CERT", value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of the certificate (PEM).
    #[arg(long, env = "KARST_TLS_KEY", value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// File with one line ROLE NAME SHA256 for each token, read again when it changes; by default `tokens` in the
    /// data folder. See `karst-server token new`.
    #[arg(long, env = "KARST_TOKENS_FILE", value_name = "FILE")]
    pub tokens_file: Option<PathBuf>,
    /// Seconds after which the tasks of a worker that was not heard of go to others.
    #[arg(long, env = "KARST_LEASE", default_value_t = 30, value_name = "SECONDS",
          value_parser = clap::value_parser!(u32).range(1..=3600))]
    pub lease: u32,
    /// What the program tells about itself.
    #[command(flatten)]
    pub told: Told,
}

impl Serve {
    /// The certificate and key to use: those named, beyond loopback else those in the data folder.
    ///
    /// # Errors
    /// Others could listen in: an address beyond loopback without a certificate.
    pub fn tls(&self) -> Result<Option<TlsFiles>, String> {
        if let (Some(cert), Some(key)) = (self.tls_cert.clone(), self.tls_key.clone()) {
            return Ok(Some(TlsFiles { cert, key }));
        }
        if self.listen.ip().is_loopback() {
            return Ok(None);
        }
        let own = TlsFiles::of(&self.data);
        if own.cert.exists() {
            return Ok(Some(own));
        }
        Err(format!(
            "--listen {}: other machines can reach it, so that calls and tokens must be encrypted: name a \
             certificate with --tls-cert and --tls-key, make one with `karst-server token init --tls --name HOST \
             --data {}`, or listen on 127.0.0.1",
            self.listen,
            self.data.display()
        ))
    }

    /// What the library needs to know.
    ///
    /// # Errors
    /// See [`Serve::tls`].
    pub fn config(&self) -> Result<Config, String> {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        Ok(Config {
            data: self.data.clone(),
            tls: self.tls()?,
            workers: self.workers.map_or(processors, |n| n as usize),
            lease: Duration::from_secs(self.lease.into()),
            tokens_file: self.tokens_file.clone(),
            collector: self.told.collector.clone(),
            state: state_home(),
        })
    }
}

/// Options of `work`.
#[derive(Debug, Clone, clap::Args)]
pub struct Work {
    /// Address of the server.
    #[arg(long, env = "KARST_SERVER", default_value = "http://127.0.0.1:7878", value_name = "URL")]
    pub server: String,
    /// File with the token of a worker; on the machine and account of the server it is found by itself.
    #[arg(long, env = "KARST_TOKEN_FILE", value_name = "FILE")]
    pub token_file: Option<PathBuf>,
    /// File with the certificate that an https server must show, or of whoever has signed it; without one it must
    /// be one that this machine trusts.
    #[arg(long, env = "KARST_CA_FILE", value_name = "FILE")]
    pub ca_file: Option<PathBuf>,
    /// Threads that render; by default one per processor.
    #[arg(long, env = "KARST_THREADS", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub threads: Option<u32>,
    /// Folder for fetched scenes and their files; several workers may share it.
    #[arg(long, env = "KARST_CACHE", value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Bytes that the cache may take; what was not used for longest goes first.
    #[arg(long, env = "KARST_CACHE_BYTES", default_value_t = 10 << 30, value_name = "BYTES")]
    pub cache_bytes: u64,
    /// Seconds to end in after SIGTERM: tiles that take longer are given up and rendered elsewhere.
    #[arg(long, env = "KARST_GRACE", default_value_t = 30, value_name = "SECONDS")]
    pub grace: u32,
    /// Seconds to look for a server that is away before giving up; 0 looks for ever.
    #[arg(long, env = "KARST_PATIENCE", default_value_t = 0, value_name = "SECONDS")]
    pub patience: u32,
    /// What the program tells about itself.
    #[command(flatten)]
    pub told: Told,
}

impl Work {
    /// What the library needs to know.
    pub fn config(&self) -> WorkConfig {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let seconds = |n: u32| Duration::from_secs(n.into());
        WorkConfig {
            server: self.server.clone(),
            token_file: self.token_file.clone(),
            ca_file: self.ca_file.clone(),
            state: state_home(),
            threads: self.threads.map_or(processors, |n| n as usize),
            cache: self.cache.clone().unwrap_or_else(default_cache),
            cache_bytes: self.cache_bytes,
            grace: seconds(self.grace),
            patience: (self.patience > 0).then(|| seconds(self.patience)),
            host: host(),
            collector: self.told.collector.clone(),
        }
    }
}

/// What [`crate::work::work`] needs to know.
#[derive(Debug, Clone)]
pub struct WorkConfig {
    /// The server's address.
    pub server: String,
    /// The file of its token.
    pub token_file: Option<PathBuf>,
    /// The file of a certificate to trust.
    pub ca_file: Option<PathBuf>,
    /// Where to look for the token of a server on this machine.
    pub state: Option<PathBuf>,
    /// Threads that render, from 1.
    pub threads: usize,
    /// Folder for fetched bytes.
    pub cache: PathBuf,
    /// Bytes that it may take.
    pub cache_bytes: u64,
    /// How long ending may take.
    pub grace: Duration,
    /// How long to look for a server that is away; `None` for ever.
    pub patience: Option<Duration>,
    /// What this machine is called.
    pub host: String,
    /// Where traces go.
    pub collector: Collector,
}

fn state_home() -> Option<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/state"));
    std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(home)
}

fn word(text: &str) -> Result<String, String> {
    let is_word =
        !text.is_empty() && text.len() <= 64 && text.chars().all(|c| c.is_ascii_graphic() && c != '#');
    is_word
        .then(|| text.to_owned())
        .ok_or_else(|| format!("found {text:?}, expected one word of up to 64 characters"))
}

fn default_cache() -> PathBuf {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cache"));
    let base = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).or_else(home);
    base.unwrap_or_else(std::env::temp_dir).join("karst")
}

fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    if name.trim().is_empty() { "worker".to_owned() } else { name.trim().to_owned() }
}

/// What [`crate::serve`] needs to know.
#[derive(Debug, Clone)]
pub struct Config {
    /// Folder for everything that must survive.
    pub data: PathBuf,
    /// Certificate and key; calls travel in the clear without.
    pub tls: Option<TlsFiles>,
    /// Threads that render here.
    pub workers: usize,
    /// A worker that is not heard of for so long is lost.
    pub lease: Duration,
    /// Whose tokens are known, besides the local one; by default a file in the data folder.
    pub tokens_file: Option<PathBuf>,
    /// Where traces go.
    pub collector: Collector,
    /// Folder in which programs of this account look for the local token of a server.
    pub state: Option<PathBuf>,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    text.parse().map_err(|_| {
        format!("expected an address and a port such as 127.0.0.1:7878 or [::1]:0, found {text:?}")
    })
}

#[cfg(test)]
mod tests {
    use super::{Cli, Command};
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
        let Command::Serve(serve) = Cli::parse_from(["karst-server", "serve", "--workers", "0"]).command
        else {
            panic!("serve");
        };
        let config = serve.config().unwrap();
        assert_eq!((config.workers, config.lease.as_secs()), (0, 30));
        let Command::Work(work) = Cli::parse_from(["karst-server", "work", "--threads", "3"]).command else {
            panic!("work");
        };
        assert_eq!((work.config().threads, work.config().patience), (3, None));
    }

    #[test]
    fn beyond_loopback_there_is_a_certificate_or_a_refusal() {
        let dir = tempfile::tempdir().unwrap();
        let tls = |listen: &str| {
            let data = dir.path().to_str().unwrap();
            let cli =
                Cli::try_parse_from(["karst-server", "serve", "--listen", listen, "--data", data]).unwrap();
            let Command::Serve(serve) = cli.command else { panic!("serve") };
            serve.tls()
        };
        for listen in ["127.0.0.1:0", "[::1]:7878"] {
            assert!(tls(listen).unwrap().is_none(), "{listen}");
        }
        for listen in ["0.0.0.0:7878", "192.168.1.5:80", "[::]:1"] {
            assert!(tls(listen).unwrap_err().contains("token init --tls"), "{listen}");
        }
        std::fs::create_dir(dir.path().join("tls")).unwrap();
        std::fs::write(dir.path().join("tls/cert.pem"), "").unwrap();
        assert!(tls("0.0.0.0:7878").unwrap().is_some());
        assert!(Cli::try_parse_from(["karst-server", "serve", "--listen", "localhost"]).is_err());
        assert!(
            Cli::try_parse_from(["karst-server", "serve", "--tls-cert", "x"]).is_err(),
            "a key is missing"
        );
    }
}
