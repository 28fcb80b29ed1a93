//! The subcommands. Each has a module with its arguments and its calls of the library.

mod board;
mod calibrate;
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
mod patterns;
mod project;
mod reconstruct;
mod recover;
mod replay;
mod rig;
mod run;
mod scanner_check;
mod service;
mod simulate;
mod status;
mod status_list;
mod verify;

use crate::failure::Failure;
use crate::globals::Globals;

/// The subcommands.
#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Draw a calibration board to print, or look for it in an image.
    ///
    /// Example:
    ///
    ///   fringeflow board charuco:14x10:square=12:marker=9:dictionary=4x4_250 -o board.pdf
    Board(board::Args),
    /// Calibrate both cameras and the projector from images of a board under the patterns of the projector.
    ///
    /// It writes no file if measurements with it would be wrong, and says why. Example:
    ///
    ///   fringeflow calibrate images --board charuco:14x10:square=12:marker=9:dictionary=4x4_250 -o calibration.yml
    ///
    /// Exit code 2: the images allow no calibration.
    Calibrate(calibrate::Args),
    /// List the V4L2 cameras with their formats, sizes, rates and controls.
    ///
    /// For each camera, the list has the line that selects it in a configuration.
    Cameras(cameras::Args),
    /// Send a command to a running instance: start, stop, record, mark or quit.
    Control(control::Args),
    /// Check a recording: every record, checksum, count and window.
    ///
    /// Exit code 1: the recording is damaged. Exit code 3: the recording is intact, but images or messages were lost
    /// when it was made.
    Check(check::Args),
    /// Scan live with a virtual scanner. No camera and no configuration are needed.
    ///
    /// All services run, with the dashboard and the live cloud.
    Demo(demo::Args),
    /// Compare a reconstruction with the truth or with Gray code.
    ///
    /// Measures completeness (com), misses (miss), false correspondences (fpc) and the 3D error.
    ///
    /// Exit code 3: --sweep wrote its results, but some measurements failed.
    Evaluate(evaluate::Args),
    /// Export the clouds of a recording as PLY, PCD or NPZ, or its images as a dataset folder.
    Export(export::Args),
    /// Fuse the clouds of a recorded scan with a moving scanner into one model, and track the poses of the scanner.
    ///
    /// Exit code 3: some clouds were lost. The model holds the others.
    Fuse(fuse::Args),
    /// Convert a dataset folder to a recording, as if a scanner had taken its images at a constant rate.
    Import(import::Args),
    /// Show the contents of a recording.
    Info(info::Args),
    /// Show the latencies of a recorded run: every stage, the segments from exposure to cloud, the slowest windows.
    Latency(latency::Args),
    /// Write the images for a projector: fringes, Gray code, a whole calibration, or a chart for focus and alignment.
    ///
    /// Example for a projector that hangs upside down:
    ///
    ///   fringeflow patterns --calibration --size 1280x800 --rotate 180 --output patterns
    Patterns(patterns::Args),
    /// Show patterns on a projector that is a second monitor, and announce each to a running instance.
    ///
    /// Needs X11, which tells when an image was shown. Ctrl-C ends it.
    ///
    /// Exit code 3: some patterns were not shown in their time.
    Project(project::Args),
    /// Reconstruct a point cloud from the images of a dataset folder or a recording.
    Reconstruct(reconstruct::Args),
    /// Recover a truncated, damaged or unfinished recording: write everything readable to a new one.
    Recover(recover::Args),
    /// Replay a recording on the channels, or recompute its clouds and compare them byte by byte.
    Replay(replay::Args),
    /// Report on a rig before it is built: ambiguity of the fringes, depth precision, effect of changes.
    ///
    /// The report needs only the calibration, no images. It shows n, sd and efc, and which wrong fringe orders survive.
    /// With --images it measures how far the calibration has drifted. Example:
    ///
    ///   fringeflow rig calibration.yml --volume=-50,-40,280,50,40,325 --period 16 --steps 4
    Rig(rig::Args),
    /// Run an instance live: cameras, projector, phase, correspondence, cloud and recorder.
    ///
    /// Each service runs in its own process.
    Run(run::Args),
    /// Run one service of an instance, as `run` does.
    Service(service::Args),
    /// List the running instances, or show one of them: rates, latencies, drops.
    Status(status::Args),
    /// Simulate a scanner: write a dataset folder with images, calibration and exact truth.
    Simulate(Box<simulate::Args>),
    /// Field check: measure a plate, a ball or a ball bar of known size, and judge the scanner by it.
    ///
    /// Finds the artefact in each cloud and tells apart noise, form and trueness, in the manner of VDI/VDE 2634: probing
    /// errors of form and size (PF, PS), error of the ball spacing (SD), flatness (F). Names likely causes where the data
    /// show them.
    ///
    /// Exit code 1: a figure is outside the limits, or the artefact is not there. Exit code 3: it was not measured in some
    /// clouds.
    Verify(verify::Args),
}

impl Command {
    /// Checks that all given options act.
    ///
    /// # Errors
    /// Names an option that would be ignored, and tells why and when it acts.
    pub(crate) fn check_options(&self, command: &clap::Command, matches: &clap::ArgMatches) -> Result<(), String> {
        match self {
            Self::Board(args) => board::OPTIONS.check(args, command, matches),
            Self::Calibrate(args) => calibrate::OPTIONS.check(args, command, matches),
            Self::Cameras(args) => cameras::OPTIONS.check(args, command, matches),
            Self::Control(args) => control::OPTIONS.check(args, command, matches),
            Self::Check(args) => check::OPTIONS.check(args, command, matches),
            Self::Demo(args) => demo::OPTIONS.check(args, command, matches),
            Self::Evaluate(args) => evaluate::OPTIONS.check(args, command, matches),
            Self::Export(args) => export::OPTIONS.check(args, command, matches),
            Self::Fuse(args) => fuse::OPTIONS.check(args, command, matches),
            Self::Import(args) => import::OPTIONS.check(args, command, matches),
            Self::Info(args) => info::OPTIONS.check(args, command, matches),
            Self::Latency(args) => latency::OPTIONS.check(args, command, matches),
            Self::Patterns(args) => patterns::OPTIONS.check(args, command, matches),
            Self::Project(args) => project::OPTIONS.check(args, command, matches),
            Self::Reconstruct(args) => reconstruct::OPTIONS.check(args, command, matches),
            Self::Recover(args) => recover::OPTIONS.check(args, command, matches),
            Self::Replay(args) => replay::OPTIONS.check(args, command, matches),
            Self::Rig(args) => rig::OPTIONS.check(args, command, matches),
            Self::Run(args) => run::OPTIONS.check(args, command, matches),
            Self::Service(args) => service::OPTIONS.check(args, command, matches),
            Self::Status(args) => status::OPTIONS.check(args, command, matches),
            Self::Simulate(args) => simulate::OPTIONS.check(args, command, matches),
            Self::Verify(args) => verify::OPTIONS.check(args, command, matches),
        }
    }

    /// Runs the subcommand.
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        match self {
            Self::Board(args) => args.run(),
            Self::Calibrate(args) => args.run(),
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
            Self::Patterns(args) => args.run(),
            Self::Project(args) => args.run(globals),
            Self::Reconstruct(args) => args.run(),
            Self::Recover(args) => args.run(),
            Self::Replay(args) => args.run(globals),
            Self::Rig(args) => args.run(),
            Self::Run(args) => args.run(globals),
            Self::Service(args) => args.run(globals),
            Self::Status(args) => args.run(),
            Self::Simulate(args) => args.run(),
            Self::Verify(args) => args.run(),
        }
    }
}
