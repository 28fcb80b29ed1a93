//! One module a subcommand: its arguments and what it does with the library.

mod rig;

use crate::failure::Failure;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Report on a rig: n, sd and efc, which wrong fringe orders survive where, and what changes would do.
    ///
    /// Needs no image, so it can be asked before anything is built. Example:
    ///
    ///   fringeflow rig calibration.yml --volume=-50,-40,280,50,40,325 --period 16 --steps 4
    Rig(rig::Args),
}

impl Command {
    /// Runs the subcommand.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match self {
            Self::Rig(args) => args.run(),
        }
    }
}
