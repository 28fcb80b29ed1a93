//! The `fringeflow` command: reads arguments, calls the library, maps the outcome to an exit code.

mod commands;
mod failure;
mod input;
mod json;
mod method;
mod pictures;
mod preview_folder;
mod progress;
mod proposed;
mod run_summary;
mod stage_figures;
mod statistics;
mod truth;

use std::process::ExitCode;

use clap::Parser;

use commands::Command;
use failure::Failure;

/// Keeps the pages of freed images for the next ones; the system's allocator gives large blocks back at once and spends a
/// fifth of a reconstruction in page faults.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Point clouds from fringe images, without Gray code.
#[derive(Parser)]
#[command(name = "fringeflow", version, about, max_term_width = 110)]
struct Cli {
    /// Number of worker threads; all cores by default. Results do not depend on it.
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match set_threads(cli.threads).and_then(|()| cli.command.run(cli.threads)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn set_threads(threads: Option<usize>) -> Result<(), Failure> {
    let Some(threads) = threads else { return Ok(()) };
    if threads == 0 {
        return Err(Failure::Usage("--threads 0: at least one thread is needed".to_owned()));
    }
    let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    built.map_err(|e| Failure::Usage(format!("--threads {threads}: {e}")))
}
