//! One module a subcommand: its arguments and what it does with the library.

use crate::failure::Failure;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {}

impl Command {
    /// Runs the subcommand.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match *self {}
    }
}
