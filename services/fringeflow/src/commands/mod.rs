//! One module a subcommand: its arguments and what it does with the library.

mod simulate;

use crate::failure::Failure;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Simulate a scanner: write a dataset folder with images, calibration and exact truth.
    Simulate(simulate::Args),
}

impl Command {
    /// Runs the subcommand.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match self {
            Self::Simulate(args) => args.run(),
        }
    }
}
