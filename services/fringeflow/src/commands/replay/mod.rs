//! `fringeflow replay`: runs a recording through the pipeline again, in this process or over the channels.

mod live;
mod verify;

use std::path::{Path, PathBuf};

use fringeflow_recording::Recording;
use fringeflow_replayer::Pace;

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::globals::Globals;

/// Arguments of `fringeflow replay`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording to replay.
    input: PathBuf,
    /// Name of the instance that replays. The default is a name with the process number.
    #[arg(value_name = "NAME")]
    instance: Option<String>,
    /// Speed on the channels: 1 is the recorded speed, 0.01 to 100 are possible, max is as fast as possible without
    /// loss. The default is 1. With --verify and without --rate the clouds are computed in this process, without
    /// channels.
    #[arg(long, value_name = "R|max")]
    rate: Option<Pace>,
    /// Compare every recorded cloud with the new one, byte by byte.
    #[arg(long)]
    verify: bool,
    /// Record the replay to this file. The file must not exist.
    #[arg(long, value_name = "REC")]
    record: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["input", "verify", "json", "threads", "simd"],
    choices: &[&[
        Mode { name: "with --verify and without --rate and --record", is_chosen: Args::is_in_process, options: &[] },
        Mode {
            name: "without --verify or with --rate or --record",
            is_chosen: |_| true,
            options: &["instance", "rate", "record", "log_format"],
        },
    ]],
};

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        let recording = Recording::open(&self.input)?;
        if self.is_in_process() {
            return self.verify(&recording);
        }
        self.play(&recording, globals)
    }

    /// Whether the clouds are computed in this process, without channels.
    fn is_in_process(&self) -> bool {
        self.verify && self.rate.is_none() && self.record.is_none()
    }
}

/// The error for a recording without clouds to verify.
fn no_clouds(input: &Path) -> Failure {
    Failure::Usage(format!("{}: the recording has no clouds to compare with", input.display()))
}
