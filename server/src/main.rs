//! The karst-server program: reads the command line, sets up logging, runs the library, turns errors into exit codes.

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;
use karst_server::config::{Cli, Command, Serve};
use tokio::net::TcpListener;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    if let Err(e) = karst_core::cpu::require_baseline() {
        return fail(&e);
    }
    let Command::Serve(options) = Cli::parse().command;
    let filter = match EnvFilter::try_new(&options.log) {
        Ok(filter) => filter,
        Err(e) => return fail(&format_args!("--log {:?}: {e}", options.log)),
    };
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let runtime = match tokio::runtime::Builder::new_multi_thread().worker_threads(4).enable_all().build() {
        Ok(runtime) => runtime,
        Err(e) => return fail(&e),
    };
    match runtime.block_on(serve(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => fail(&e),
    }
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
