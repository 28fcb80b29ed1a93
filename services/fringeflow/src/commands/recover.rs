//! `fringeflow recover`: writes everything readable of a recording to a new one.

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow_recording::{Recovered, recover};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::json;

/// Arguments of `fringeflow recover`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Truncated, damaged or unfinished recording. It is not changed.
    input: PathBuf,
    /// Recording to write.
    #[arg(short, long, value_name = "REC")]
    output: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["input", "output", "json"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let recovered = recover(&self.input, &self.output, 0)?;
        if self.json {
            json::print(&recovered)?;
        } else {
            self.print(&recovered)?;
        }
        let file = self.output.display();
        if !recovered.missing.is_empty() {
            let missing = recovered.missing.join(", ");
            return Err(Failure::Losses(format!(
                "{file}: the recording has no {missing}, so no cloud can be computed from it"
            )));
        }
        match recovered.loss() {
            None => Ok(()),
            Some(loss) => Err(Failure::Losses(format!("{file}: the file is whole, but {loss}"))),
        }
    }

    fn print(&self, recovered: &Recovered) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        writeln!(out, "{}: recovered from {}", self.output.display(), self.input.display())?;
        for (topic, count) in &recovered.messages {
            writeln!(out, "{count:>8}  {topic}")?;
        }
        for fault in &recovered.faults {
            writeln!(out, "fault: {fault}")?;
        }
        for (topic, count) in &recovered.foreign {
            writeln!(out, "left out: {count} messages of {topic}, which Fringeflow does not read")?;
        }
        if recovered.left_out > 0 {
            writeln!(out, "left out: {} messages that are invalid or incomplete", recovered.left_out)?;
        }
        if let Some(losses) = &recovered.losses {
            writeln!(out, "losses: {losses}")?;
        }
        Ok(())
    }
}
