//! What stands around the command: a server that can be killed, a worker that begins when told, and a tev.

use std::io::{BufRead, BufReader, Read};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use karst_core::encode::{ExrImage, read_exr};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::decode::{self, Packet, Screen};

/// The longest that anything here may take, in seconds.
const PATIENCE: &str = "180";

/// A process that is killed when it is dropped.
pub(crate) struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A server without threads of its own, in a folder of its own.
pub(crate) struct Farm {
    folder: TempDir,
    listen: String,
    server: Option<Process>,
}

/// The server's program, which lies beside that of the client.
fn program() -> PathBuf {
    let path = Path::new(env!("CARGO_BIN_EXE_karst")).with_file_name("karst-server");
    assert!(path.exists(), "{} is missing: cargo build --release -p karst-server", path.display());
    path
}

impl Farm {
    pub(crate) fn start() -> Self {
        let mut farm =
            Self { folder: tempfile::tempdir().unwrap(), listen: "127.0.0.1:0".to_owned(), server: None };
        farm.restart();
        farm
    }

    /// SIGKILL.
    pub(crate) fn kill(&mut self) {
        self.server = None;
    }

    /// At the same address.
    pub(crate) fn restart(&mut self) {
        let mut server = Command::new(program())
            .args([
                "serve",
                "--log",
                "warn",
                "--workers",
                "0",
                "--lease",
                "2",
                "--listen",
                &self.listen,
                "--data",
            ])
            .arg(self.at("data"))
            .env("XDG_STATE_HOME", self.at("state"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
        line.trim()
            .strip_prefix("listening on http://")
            .expect("the promised line")
            .clone_into(&mut self.listen);
        self.server = Some(Process(server));
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Begins to render with one thread.
    pub(crate) fn work(&self) -> Process {
        let worker = Command::new(program())
            .args(["work", "--log", "warn", "--threads", "1", "--server", &format!("http://{}", self.listen)])
            .arg("--cache")
            .arg(self.at("cache"))
            .env("XDG_STATE_HOME", self.at("state"))
            .spawn();
        Process(worker.unwrap())
    }

    fn command(&self, line: &[&str]) -> Command {
        let mut command = Command::new("timeout");
        command
            .arg(PATIENCE)
            .arg(env!("CARGO_BIN_EXE_karst"))
            .args(line)
            .env("XDG_STATE_HOME", self.at("state"));
        command.args(["--server", &format!("http://{}", self.listen)]).current_dir(self.folder.path());
        command
    }

    /// Runs a command to its end.
    pub(crate) fn karst(&self, line: &[&str]) -> Output {
        self.command(line).output().unwrap()
    }

    /// Runs a command that must succeed; its first line on stdout.
    pub(crate) fn done(&self, line: &[&str]) -> String {
        let output = self.karst(line);
        assert!(output.status.success(), "{line:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap().lines().next().unwrap_or_default().to_owned()
    }

    /// Submits the scene; the job's id.
    pub(crate) fn submit(&self, sampling: &Value, options: &[&str]) -> String {
        std::fs::write(self.at("cave 2.json"), scene(sampling).to_string()).unwrap();
        self.done(&[&["submit", "cave 2.json"], options].concat())
    }

    /// Begins `karst view`.
    pub(crate) fn view(&self, job: &str, tev: SocketAddr, options: &[&str]) -> Running {
        let address = tev.to_string();
        let line = [&["view", job, "--tev", &address], options].concat();
        Running(self.command(&line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
    }

    /// The finished frames of a job, by file name.
    pub(crate) fn exr(&self, job: &str, file: &str) -> ExrImage {
        self.done(&["fetch", job, "-o", job, "--format", "exr"]);
        let bytes = std::fs::read(self.at(job).join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        read_exr(&bytes).unwrap()
    }
}

/// A running command.
pub(crate) struct Running(Child);

impl Running {
    /// Its exit code and what it said on stderr.
    pub(crate) fn end(self) -> (Option<i32>, String) {
        let output = self.0.wait_with_output().unwrap();
        (output.status.code(), stderr(&output))
    }
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A lit ball over three frames.
fn scene(sampling: &Value) -> Value {
    json!({
        "version": 1,
        "camera": {"type": "perspective", "vfov": 40,
                   "transform": {"look_at": {"eye": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0]}}},
        "film": {"width": 101, "height": 67, "filter": {"type": "gaussian", "radius": 1.5}},
        "sampling": sampling,
        "materials": {"grey": {"type": "diffuse", "reflectance": [0.5, 0.4, 0.3]}},
        "spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "grey"},
                    "lamp": {"center": [2, 2, 2], "radius": 0.5, "material": "grey", "emission": [9, 8, 7]}},
        "lights": {"sky": {"type": "environment", "radiance": [0.3, 0.4, 1]}},
        "animation": {"fps": 24, "frames": [1, 3], "tracks": {
            "spheres.ball.radius": {"interpolation": "linear",
                                    "keys": [{"frame": 1, "value": 1}, {"frame": 3, "value": 0.5}]}}},
    })
}

/// Where a tev listens.
pub(crate) struct Tev(TcpListener);

impl Tev {
    pub(crate) fn start() -> Self {
        Self(TcpListener::bind("127.0.0.1:0").unwrap())
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.0.local_addr().unwrap()
    }

    /// Waits for the command to connect.
    pub(crate) fn accept(&self) -> Seat {
        let (stream, _) = self.0.accept().unwrap();
        stream.set_read_timeout(Some(Duration::from_mins(3))).unwrap();
        Seat { stream, screen: Screen::default(), bytes: Vec::new(), packets: 0 }
    }
}

/// A tev with a connection.
pub(crate) struct Seat {
    stream: TcpStream,
    pub(crate) screen: Screen,
    /// All that came.
    pub(crate) bytes: Vec<u8>,
    pub(crate) packets: usize,
}

impl Seat {
    /// Takes one packet.
    pub(crate) fn take(&mut self) -> Option<Packet> {
        let (bytes, packet) = decode::read(&mut self.stream)?;
        self.bytes.extend(bytes);
        self.packets += 1;
        self.screen.take(packet.clone());
        Some(packet)
    }

    /// Takes everything to the end of the connection.
    pub(crate) fn take_all(&mut self) {
        while self.take().is_some() {}
        assert_eq!(self.stream.read(&mut [0]).unwrap(), 0);
    }
}
