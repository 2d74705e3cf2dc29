//! Owns the command line; the only file that reads the environment.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Parser, Subcommand};

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
    /// Takes jobs over gRPC and renders them with workers inside this process.
    Serve(Serve),
}

/// Options of `serve`.
#[derive(Debug, Clone, clap::Args)]
pub struct Serve {
    /// Address to listen on; port 0 lets the system choose, `listening on http://ADDR` tells which.
    #[arg(long, env = "KARST_LISTEN", default_value = "127.0.0.1:7878", value_parser = loopback)]
    pub listen: SocketAddr,
    /// Folder for jobs, assets and finished frames; made if it is not there.
    #[arg(long, env = "KARST_DATA", default_value = "karst-data")]
    pub data: PathBuf,
    /// Threads that render; by default one per processor.
    #[arg(long, env = "KARST_WORKERS", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub workers: Option<u32>,
    /// What to log on stderr, as in `info` or `karst_server=debug,warn`.
    #[arg(long, env = "KARST_LOG", default_value = "info")]
    pub log: String,
}

impl Serve {
    /// What the library needs to know.
    pub fn config(&self) -> Config {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        Config { data: self.data.clone(), workers: self.workers.map_or(processors, |n| n as usize) }
    }
}

/// What [`crate::serve`] needs to know.
#[derive(Debug, Clone)]
pub struct Config {
    /// Folder for everything that must survive.
    pub data: PathBuf,
    /// Threads that render, from 1.
    pub workers: usize,
}

fn loopback(text: &str) -> Result<SocketAddr, String> {
    let address: SocketAddr = text.parse().map_err(|_| {
        format!("expected an address and a port such as 127.0.0.1:7878 or [::1]:0, found {text:?}")
    })?;
    if address.ip().is_loopback() {
        Ok(address)
    } else {
        Err(format!(
            "{} can be reached from other machines, and this version has neither TLS nor tokens yet: \
             listen on 127.0.0.1 or [::1], and reach it through `ssh -L`",
            address.ip()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::{Cli, Command, loopback};
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
        let Command::Serve(serve) = Cli::parse_from(["karst-server", "serve", "--workers", "3"]).command;
        assert_eq!(serve.config().workers, 3);
    }

    #[test]
    fn only_loopback() {
        assert!(loopback("127.0.0.1:0").is_ok() && loopback("[::1]:7878").is_ok());
        for text in ["0.0.0.0:7878", "192.168.1.5:80", "[::]:1", "localhost", ""] {
            assert!(loopback(text).is_err(), "{text}");
        }
        assert!(loopback("0.0.0.0:1").unwrap_err().contains("TLS"));
    }
}
