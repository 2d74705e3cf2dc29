//! The `karst` command: checks the processor, reads the command line, runs one sub-command.

mod args;
mod clock;
mod commands;
mod difference;
mod naming;
mod profile;
mod progress;
mod report;
mod talk;
mod tev;
mod wire_json;

use std::process::ExitCode;

use clap::Parser;

use crate::args::Cli;
use crate::talk::Talk;

fn main() -> ExitCode {
    if let Err(unsupported) = karst_core::cpu::require_baseline() {
        Talk::default().error(&unsupported, None);
        return ExitCode::FAILURE;
    }
    let cli = Cli::parse();
    let talk = Talk { json: cli.json };
    match commands::run(cli.command, talk) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            talk.error(&error, error.hint());
            ExitCode::from(error.exit_code())
        }
    }
}
