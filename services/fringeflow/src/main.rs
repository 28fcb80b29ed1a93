//! The `fringeflow` command: reads arguments, calls the library, maps the outcome to an exit code.

mod acting_options;
mod calibrated_rig;
mod commands;
mod diagnosis;
mod failure;
mod globals;
mod image_health;
mod images;
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

use std::ffi::OsString;
use std::process::ExitCode;

use clap::error::ErrorKind;
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

impl Cli {
    /// The description of the command line for the parser.
    fn description() -> clap::Command {
        globals::hide_in_subcommands(Self::command())
    }

    /// Parses a command line.
    ///
    /// # Errors
    /// It is invalid, or has an option that would be ignored.
    fn parse_checked(
        command: &mut clap::Command,
        arguments: impl IntoIterator<Item = OsString>,
    ) -> Result<Self, clap::Error> {
        let matches = command.try_get_matches_from_mut(arguments)?;
        let cli = Self::from_arg_matches(&matches).map_err(|error| error.format(command))?;
        if let Some((name, matches)) = matches.subcommand()
            && let Some(command) = command.find_subcommand_mut(name)
        {
            let checked = cli.command.check_options(command, matches);
            checked.map_err(|ignored| command.error(ErrorKind::ArgumentConflict, ignored))?;
        }
        Ok(cli)
    }
}

fn main() -> ExitCode {
    let parsed = Cli::parse_checked(&mut Cli::description(), std::env::args_os());
    let cli = parsed.unwrap_or_else(|error| error.exit());
    match cli.globals.set_up_kernels().and_then(|()| cli.command.run(&cli.globals)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
