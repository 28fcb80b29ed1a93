//! The `fringeflow` command: reads arguments, calls the library, maps the outcome to an exit code.

mod commands;
mod failure;
mod globals;
mod input;
mod json;
mod method;
mod output_folder;
mod pictures;
mod progress;
mod proposed;
mod report;
mod run_summary;
mod statistics;
mod truth;
mod values;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};

use commands::Command;
use globals::Globals;

/// Keeps the pages of freed images for the next ones. The system's allocator returns large blocks to the kernel at
/// once, and a reconstruction then spends a fifth of its time in page faults.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Structured-light 3D scanning by fringe projection: point clouds in real time from a few phase-shifted images.
///
/// Phase unwrapping needs only the geometry of the rig, no Gray code.
#[derive(Parser)]
#[command(name = "fringeflow", version, about, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    globals: Globals,
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let mut command = globals::hide_in_subcommands(Cli::command());
    let matches = command.get_matches_mut();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit());
    match cli.globals.set_up_kernels().and_then(|()| cli.command.run(&cli.globals)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
