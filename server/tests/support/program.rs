//! The real programs as processes: servers and workers that can be killed.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use super::{Client, token_of};

const BIN: &str = env!("CARGO_BIN_EXE_karst-server");

/// A server; killed when it is dropped.
pub struct Program {
    child: Child,
    pub url: String,
    data: PathBuf,
}

impl Program {
    /// On a free port, with `workers` threads of its own.
    pub fn start(data: &Path, workers: u32) -> Self {
        Self::start_on(data, workers, "127.0.0.1:0")
    }

    pub fn start_on(data: &Path, workers: u32, listen: &str) -> Self {
        Self::start_in(data, workers, listen, &[])
    }

    /// With more in its environment.
    pub fn start_in(data: &Path, workers: u32, listen: &str, environment: &[(&str, &str)]) -> Self {
        let mut child = Command::new(BIN)
            .args(["serve", "--log", "warn", "--lease", "2", "--listen", listen])
            .args(["--workers", &workers.to_string(), "--data"])
            .arg(data)
            .env("XDG_STATE_HOME", data.join("state"))
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("listening on ").expect("the promised line").to_owned();
        Self { child, url, data: data.to_owned() }
    }

    pub async fn client(&self) -> Client {
        Client::connect(&self.url, &token_of(&self.data)).await
    }

    /// Where it listens.
    pub fn address(&self) -> &str {
        self.url.strip_prefix("http://").unwrap()
    }

    /// SIGTERM, and how it ended.
    pub fn terminate(mut self) -> ExitStatus {
        terminate(&mut self.child)
    }

    /// SIGKILL: nothing is flushed, nothing is closed.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn terminate(child: &mut Child) -> ExitStatus {
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    for _ in 0..200 {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    panic!("a program did not end");
}

/// A worker process; killed when it is dropped.
pub struct Worker {
    child: Child,
}

impl Worker {
    /// With one thread; workers may share the folder `cache`.
    pub fn start(server: &Program, cache: &Path) -> Self {
        Self::start_in(server, &server.url, cache, &[])
    }

    /// With more in its environment, and another way to the server.
    pub fn start_in(server: &Program, url: &str, cache: &Path, environment: &[(&str, &str)]) -> Self {
        let child = Command::new(BIN)
            .args(["work", "--threads", "1", "--log", "warn", "--grace", "5", "--server", url, "--cache"])
            .arg(cache)
            .arg("--token-file")
            .arg(server.data.join("token"))
            .envs(environment.iter().copied())
            .env("XDG_STATE_HOME", server.data.join("state"))
            .spawn()
            .unwrap();
        Self { child }
    }

    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM, and how it ended.
    pub fn terminate(mut self) -> ExitStatus {
        terminate(&mut self.child)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
