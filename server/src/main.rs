//! The karst-server program: reads the command line, sets up logging, runs the library, turns errors into exit codes.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::process::ExitCode;

use clap::Parser as _;
use karst_server::config::{Cli, Command, LogFormat, Serve, Token};
use karst_server::door::{Role, TlsFiles, Tokens, line, make_certificate, new_token};
use karst_server::health;
use karst_server::work::{WorkError, work};
use tokio::net::TcpListener;

fn main() -> ExitCode {
    if let Err(e) = karst_core::cpu::require_baseline() {
        return fail(&e);
    }
    let command = Cli::parse().command;
    let (log, format) = match &command {
        Command::Serve(options) => (&*options.told.log, options.told.log_format),
        Command::Work(options) => (&*options.told.log, options.told.log_format),
        Command::Token(options) => return token(options),
        Command::Health(_) => ("off", LogFormat::Text),
    };
    if let Err(e) = karst_server::telemetry::log::init(log, format) {
        return fail(&e);
    }
    let runtime = match tokio::runtime::Builder::new_multi_thread().worker_threads(4).enable_all().build() {
        Ok(runtime) => runtime,
        Err(e) => return fail(&e),
    };
    match command {
        Command::Serve(options) => match runtime.block_on(serve(&options)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(e) => fail(&e),
        },
        Command::Work(options) => match runtime.block_on(work(options.config(), stopped())) {
            Ok(()) => ExitCode::SUCCESS,
            Err(e) => {
                fail(&e);
                exit_code(&e)
            }
        },
        Command::Token(options) => token(&options),
        Command::Health(options) => {
            match runtime.block_on(health(&options.server, options.ca_file.as_deref())) {
                Ok(()) => ExitCode::SUCCESS,
                Err(e) => fail(&e),
            }
        }
    }
}

fn token(options: &Token) -> ExitCode {
    let done = match options {
        Token::New { role, name, data } => make_token(*role, name, data.as_deref()),
        Token::Init { tls, names, data } => prepare(data, if *tls { names } else { &[] }),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => fail(&e),
    }
}

/// Makes a token: the only time that it can be seen.
fn make_token(role: Role, name: &str, data: Option<&Path>) -> std::io::Result<()> {
    let token = new_token();
    let line = line(role, name, &token);
    if let Some(data) = data {
        add_line(&data.join("tokens"), &line)?;
    }
    writeln!(std::io::stdout().lock(), "token: {token}\nline:  {line}")
}

fn prepare(data: &Path, names: &[String]) -> std::io::Result<()> {
    std::fs::create_dir_all(data)?;
    Tokens::open(data, None)?;
    let mut stdout = std::io::stdout().lock();
    writeln!(stdout, "token of this account: {}", data.join("token").display())?;
    if names.is_empty() {
        return Ok(());
    }
    let files = TlsFiles::of(data);
    let what = if make_certificate(&files, names)? { "made" } else { "kept" };
    writeln!(stdout, "certificate ({what}), for --ca-file of clients and workers: {}", files.cert.display())
}

fn add_line(path: &Path, line: &str) -> std::io::Result<()> {
    let named = |e: std::io::Error| std::io::Error::new(e.kind(), format!("{}: {e}", path.display()));
    let mut file = OpenOptions::new().append(true).create(true).mode(0o600).open(path).map_err(named)?;
    // One write: a server that reads meanwhile sees all of the line or nothing.
    file.write_all(format!("{line}\n").as_bytes())?;
    file.sync_all()
}

/// What a script that starts workers can act on: the codes of sysexits.h where they fit.
fn exit_code(error: &WorkError) -> ExitCode {
    ExitCode::from(match error {
        WorkError::Build(_) => 75,
        WorkError::Refused(_) => 77,
        WorkError::Usage(_) => 64,
        WorkError::Away { .. } | WorkError::System(_) => 1,
    })
}

async fn serve(options: &Serve) -> Result<(), Box<dyn std::error::Error>> {
    let config = options.config()?;
    let scheme = if config.tls.is_some() { "https" } else { "http" };
    let listener = TcpListener::bind(options.listen)
        .await
        .map_err(|e| format!("cannot listen on {}: {e}", options.listen))?;
    let address = listener.local_addr()?;
    // Scripts wait for this line to learn the port.
    let ready = move || {
        let mut stdout = std::io::stdout().lock();
        let _ = writeln!(stdout, "listening on {scheme}://{address}").and_then(|()| stdout.flush());
    };
    Ok(karst_server::serve(listener, config, ready, stopped()).await?)
}

/// Resolves when somebody wants the program to end.
async fn stopped() {
    let interrupt = tokio::signal::ctrl_c();
    match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
        Ok(mut terminate) => {
            tokio::select! {
                _ = interrupt => {}
                _ = terminate.recv() => {}
            }
        }
        Err(_) => drop(interrupt.await),
    }
}

fn fail(error: &dyn std::fmt::Display) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "karst-server: {error}");
    ExitCode::FAILURE
}
