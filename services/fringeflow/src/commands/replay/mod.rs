//! `fringeflow replay`: a recording through the pipeline once more, in this process or over the channels.

mod live;
mod verify;

use std::path::{Path, PathBuf};

use fringeflow_recording::Recording;
use fringeflow_replayer::Pace;

use crate::failure::Failure;
use crate::globals::Globals;

/// Arguments of `fringeflow replay`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording.
    input: PathBuf,
    /// Speed on the channels: so many times as fast as recorded, or max: as fast as it goes without loss. By default 1,
    /// with --verify in this process and not over the channels.
    #[arg(long, value_name = "R|max")]
    rate: Option<Pace>,
    /// Compare every recorded cloud with the one made now, byte by byte.
    #[arg(long)]
    verify: bool,
    /// Record the replay to this file; it must not exist.
    #[arg(long, value_name = "REC")]
    record: Option<PathBuf>,
    /// Name of the instance on whose channels it is played; one of its own by default.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        let recording = Recording::open(&self.input)?;
        if self.verify && self.rate.is_none() && self.record.is_none() {
            return self.verify(&recording);
        }
        self.play(&recording, globals)
    }
}

/// The refusal of a recording whose clouds are to be verified and that has none.
fn no_clouds(input: &Path) -> Failure {
    Failure::Usage(format!("{}: has no clouds to compare with", input.display()))
}
