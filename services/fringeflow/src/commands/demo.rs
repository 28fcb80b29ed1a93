//! `fringeflow demo`: runs a live scan with a virtual scanner, without a rig.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::{WriteError, WriteProblem, write_new};
use fringeflow_runtime::ServiceArgs;

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::globals::Globals;
use crate::output_folder;

use super::run::ScanArgs;

/// The configuration. Its paths are relative to its folder in the repository.
const CONFIGURATION: &str = include_str!("../../../../configs/demo.toml");
/// Output folder of the demo, as the configuration names it.
const OUTPUT_FOLDER: &str = "../demo-output";

/// Arguments of `fringeflow demo`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Output folder. The demo also writes its configuration there, demo.toml. You can change it for the next demo in
    /// this folder.
    #[arg(long, short, value_name = "FOLDER", default_value = "demo-output")]
    output: PathBuf,
    #[command(flatten)]
    scan: ScanArgs,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&[
    "output",
    "seconds",
    "record",
    "report",
    "no_report",
    "trace",
    "json",
    "threads",
    "simd",
    "log_format",
]);

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        globals.start_log("demo");
        let config = self.output.join("demo.toml");
        output_folder::prepare(&self.output)?;
        write_configuration(&config)?;
        let arguments = ServiceArgs { config, ..ServiceArgs::default() };
        self.scan.run(&arguments, globals)
    }
}

/// Writes the configuration, unless the file exists.
fn write_configuration(config: &Path) -> Result<(), Failure> {
    match write_new(config, |file| file.write_all(configuration().as_bytes())) {
        Err(WriteError { problem: WriteProblem::Exists, .. }) => Ok(()),
        written => Ok(written?),
    }
}

/// The configuration with paths relative to the output folder.
fn configuration() -> String {
    CONFIGURATION.replace(&format!("\"{OUTPUT_FOLDER}\""), "\".\"").replace(&format!("\"{OUTPUT_FOLDER}/"), "\"")
}

#[cfg(test)]
mod tests {
    use fringeflow_config::ScannerConfiguration;

    use super::*;

    #[test]
    fn the_demo_writes_only_to_its_folder() {
        let text = configuration();
        assert!(!text.contains("\"../"), "{text}");
        let demo = ScannerConfiguration::parse(&text, Path::new("/scans/demo")).unwrap();
        assert_eq!(demo.recorder.folder, Path::new("/scans/demo/."));
    }
}
