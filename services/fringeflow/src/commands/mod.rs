//! One module a subcommand: its arguments and what it does with the library.

mod cameras;
mod check;
mod control;
mod demo;
mod evaluate;
mod export;
mod fuse;
mod import;
mod info;
mod latency;
mod reconstruct;
mod recover;
mod replay;
mod rig;
mod run;
mod scanner_check;
mod service;
mod simulate;
mod status;

use crate::failure::Failure;
use crate::globals::Globals;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// List the V4L2 cameras: formats, sizes, rates, controls, and the line of the configuration that names each.
    Cameras(cameras::Args),
    /// Command a running instance: start, stop, record, mark, quit.
    Control(control::Args),
    /// Check a recording: read every record, compare checksums, counts and windows.
    ///
    /// Exit code 1: it is damaged; 3: it is whole, but something was lost when it was made.
    Check(check::Args),
    /// Scan live with a virtual scanner: all services, the dashboard, the live cloud; no camera and no configuration needed.
    Demo(demo::Args),
    /// Compare a reconstruction with the truth or with Gray code: com, miss, fpc, 3D error.
    Evaluate(evaluate::Args),
    /// Export a recording: its clouds as PLY, PCD or NPZ, or its images as a dataset folder.
    Export(export::Args),
    /// Fuse the clouds of a recorded scan, in which the scanner was moved, into one model; track its poses meanwhile.
    ///
    /// Exit code 3: clouds were lost on the way, and the model is of the others.
    Fuse(fuse::Args),
    /// Make a recording of a dataset folder, as if a scanner had taken its images at a steady rate.
    Import(import::Args),
    /// Say what is in a recording.
    Info(info::Args),
    /// Say where the time went in a recorded run: latency of every stage, the way from exposure to cloud, the worst windows.
    Latency(latency::Args),
    /// Reconstruct a dataset folder or a recording: images to a point cloud.
    Reconstruct(reconstruct::Args),
    /// Make a whole recording of what can be read of a cut, damaged or unfinished one.
    Recover(recover::Args),
    /// Replay a recording over the channels, or make its clouds again here, and compare them byte by byte.
    Replay(replay::Args),
    /// Report on a rig: n, sd and efc, which wrong fringe orders survive where, and what changes would do.
    ///
    /// Needs no image, so it can be asked before anything is built. Example:
    ///
    ///   fringeflow rig calibration.yml --volume=-50,-40,280,50,40,325 --period 16 --steps 4
    Rig(rig::Args),
    /// Run an instance live: cameras, projector, phase, correspondence, cloud, recorder, each a process of its own.
    Run(run::Args),
    /// Run one service of an instance, as `run` does.
    Service(service::Args),
    /// Tell what a running instance does: rates, latencies, drops.
    Status(status::Args),
    /// Simulate a scanner: write a dataset folder with images, calibration and exact truth.
    Simulate(simulate::Args),
}

impl Command {
    /// Runs the subcommand.
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        match self {
            Self::Cameras(args) => args.run(),
            Self::Control(args) => args.run(),
            Self::Check(args) => args.run(),
            Self::Demo(args) => args.run(globals),
            Self::Evaluate(args) => args.run(),
            Self::Export(args) => args.run(),
            Self::Fuse(args) => args.run(),
            Self::Import(args) => args.run(),
            Self::Info(args) => args.run(),
            Self::Latency(args) => args.run(),
            Self::Reconstruct(args) => args.run(),
            Self::Recover(args) => args.run(),
            Self::Replay(args) => args.run(globals),
            Self::Rig(args) => args.run(),
            Self::Run(args) => args.run(globals),
            Self::Service(args) => args.run(globals),
            Self::Status(args) => args.run(),
            Self::Simulate(args) => args.run(),
        }
    }
}
