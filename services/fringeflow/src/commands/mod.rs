//! One module a subcommand: its arguments and what it does with the library.

mod evaluate;

use crate::failure::Failure;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Compare a reconstruction with the truth or with Gray code: com, miss, fpc, 3D error.
    Evaluate(evaluate::Args),
}

impl Command {
    /// Runs the subcommand.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match self {
            Self::Evaluate(args) => args.run(),
        }
    }
}
