//! One module a subcommand: its arguments and what it does with the library.

mod evaluate;
mod reconstruct;
mod rig;
mod simulate;

use crate::failure::Failure;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Compare a reconstruction with the truth or with Gray code: com, miss, fpc, 3D error.
    Evaluate(evaluate::Args),
    /// Reconstruct a dataset folder: images to a point cloud.
    Reconstruct(reconstruct::Args),
    /// Report on a rig: n, sd and efc, which wrong fringe orders survive where, and what changes would do.
    ///
    /// Needs no image, so it can be asked before anything is built. Example:
    ///
    ///   fringeflow rig calibration.yml --volume=-50,-40,280,50,40,325 --period 16 --steps 4
    Rig(rig::Args),
    /// Simulate a scanner: write a dataset folder with images, calibration and exact truth.
    Simulate(simulate::Args),
}

impl Command {
    /// Runs the subcommand.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match self {
            Self::Evaluate(args) => args.run(),
            Self::Reconstruct(args) => args.run(),
            Self::Rig(args) => args.run(),
            Self::Simulate(args) => args.run(),
        }
    }
}
