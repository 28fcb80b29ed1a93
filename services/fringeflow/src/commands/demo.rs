//! `fringeflow demo`: a live scan by a virtual scanner, without a rig.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::{WriteError, WriteProblem, write_new};
use fringeflow_runtime::ServiceArgs;

use crate::failure::Failure;
use crate::globals::Globals;
use crate::output_folder;

use super::run::Scan;

/// The configuration, with paths as seen from the folder in which it stands in the repository.
const CONFIGURATION: &str = include_str!("../../../../configs/demo.toml");
/// The folder of all that the demo writes, as seen from there.
const FOLDER: &str = "../demo-output";

/// Arguments of `fringeflow demo`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder of the demo. It also gets the configuration, demo.toml. Change it, and the next demo in this folder uses it.
    #[arg(long, short, value_name = "FOLDER", default_value = "demo-output")]
    output: PathBuf,
    #[command(flatten)]
    scan: Scan,
}

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        globals.start_log("demo");
        let config = self.output.join("demo.toml");
        output_folder::prepare(&self.output)?;
        provide(&config)?;
        let arguments = ServiceArgs { config, setup: None, segment_table: None, restarts: 0, supervised: false };
        self.scan.run(&arguments, globals)
    }
}

/// Puts the configuration in its place, unless there is one.
fn provide(config: &Path) -> Result<(), Failure> {
    match write_new(config, |file| file.write_all(configuration().as_bytes())) {
        Err(WriteError { problem: WriteProblem::Exists, .. }) => Ok(()),
        written => Ok(written?),
    }
}

/// With paths as seen from the folder of the demo.
fn configuration() -> String {
    CONFIGURATION.replace(&format!("\"{FOLDER}\""), "\".\"").replace(&format!("\"{FOLDER}/"), "\"")
}

#[cfg(test)]
mod tests {
    use fringeflow_config::ScannerConfiguration;

    use super::*;

    #[test]
    fn everything_it_writes_lies_in_its_folder() {
        let text = configuration();
        assert!(!text.contains("\"../"), "{text}");
        let demo = ScannerConfiguration::parse(&text, Path::new("/scans/demo")).unwrap();
        assert_eq!(demo.recorder.folder, Path::new("/scans/demo/."));
    }
}
