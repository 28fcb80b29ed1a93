//! One module a subcommand: its arguments and what it does with the library.

mod control;
mod evaluate;
mod reconstruct;
mod rig;
mod run;
mod service;
mod simulate;
mod status;

use crate::failure::Failure;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Command a running instance: start, stop, record, mark, quit.
    Control(control::Args),
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
    /// Run an instance live: cameras, projector, phase, correspondence, cloud, recorder, each a process of its own.
    Run(run::Args),
    /// Run one service of an instance, as `run` and systemd do.
    Service(service::Args),
    /// Tell what a running instance does: rates, latencies, drops.
    Status(status::Args),
    /// Simulate a scanner: write a dataset folder with images, calibration and exact truth.
    Simulate(simulate::Args),
}

impl Command {
    /// Runs the subcommand.
    ///
    /// `threads`: what the services of an instance are to use.
    pub(crate) fn run(&self, threads: Option<usize>) -> Result<(), Failure> {
        match self {
            Self::Control(args) => args.run(),
            Self::Evaluate(args) => args.run(),
            Self::Reconstruct(args) => args.run(),
            Self::Rig(args) => args.run(),
            Self::Run(args) => args.run(threads),
            Self::Service(args) => args.run(),
            Self::Status(args) => args.run(),
            Self::Simulate(args) => args.run(),
        }
    }
}
