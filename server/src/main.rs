//! The karst-server program: reads the command line, sets up logging, runs the library, turns errors into exit codes.

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;
use karst_server::config::{Cli, Command, Serve};
use karst_server::work::{WorkError, work};
use tokio::net::TcpListener;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    if let Err(e) = karst_core::cpu::require_baseline() {
        return fail(&e);
    }
    let command = Cli::parse().command;
    let log = match &command {
        Command::Serve(options) => &options.log,
        Command::Work(options) => &options.log,
    };
    let filter = match EnvFilter::try_new(log) {
        Ok(filter) => filter,
        Err(e) => return fail(&format_args!("--log {log:?}: {e}")),
    };
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
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
    }
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
    let listener = TcpListener::bind(options.listen)
        .await
        .map_err(|e| format!("cannot listen on {}: {e}", options.listen))?;
    let address = listener.local_addr()?;
    // Scripts wait for this line to learn the port.
    let ready = move || {
        let mut stdout = std::io::stdout().lock();
        let _ = writeln!(stdout, "listening on http://{address}").and_then(|()| stdout.flush());
    };
    Ok(karst_server::serve(listener, options.config(), ready, stopped()).await?)
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
