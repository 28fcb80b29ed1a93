//! `fringeflow check`: checks whether a recording is intact and whether messages were lost when it was made.

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow_recording::{Check, Recording};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::{json, progress};

/// Arguments of `fringeflow check`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording to check.
    input: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["input", "json"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let recording = Recording::open(&self.input).map_err(|error| match error.problem.is_damage() {
            true => Failure::Damaged(error),
            false => Failure::Recording(error),
        })?;
        let bar = progress::bar("messages", recording.messages().count() as u64);
        let check = recording.check(|| bar.inc(1)).map_err(Failure::Damaged)?;
        bar.finish_and_clear();
        if self.json {
            json::print(&check)?;
        } else {
            self.print(&check)?;
        }
        let file = self.input.display();
        if check.fault_count > 0 {
            return Err(Failure::Mismatch(format!("{file}: {} messages are invalid", check.fault_count)));
        }
        if !check.losses.is_loss() {
            return Ok(());
        }
        Err(Failure::Losses(format!("{file}: the file is whole, but {}", check.losses)))
    }

    fn print(&self, check: &Check) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        writeln!(
            out,
            "{}: {} messages, all checksums and counts that it states are correct",
            self.input.display(),
            check.messages
        )?;
        for fault in &check.faults {
            writeln!(out, "fault: {fault}")?;
        }
        let [repeated1, repeated2] = check.repeated_images;
        writeln!(
            out,
            "repeated images: {repeated1} of camera 1, {repeated2} of camera 2\nclouds: {}\nlosses: {}",
            check.clouds, check.losses
        )?;
        Ok(())
    }
}
