//! `fringeflow reconstruct`: reconstructs a point cloud from the images of a dataset folder or a recording.

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow::calibration::Unit;
use fringeflow::cloud::{CloudExport, CloudFormat};
use fringeflow_base::atomic_file::check_writable;

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::input::Input;
use crate::method::{Method, MethodOutput};
use crate::output_folder;
use crate::pictures;
use crate::proposed::{PROPOSED_OPTIONS, ProposedArgs};
use crate::statistics::Statistics;
use crate::values::unit;

/// Arguments of `fringeflow reconstruct`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Dataset folder or recording.
    input: PathBuf,
    /// Cloud to write: .ply, .pcd or .npz.
    #[arg(short, long, value_name = "CLOUD")]
    output: PathBuf,
    /// Method that finds the correspondences.
    #[arg(long, value_enum, default_value_t = Method::Pa)]
    method: Method,
    /// Unit of the cloud, and of the calibration if the dataset does not state one.
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    units: Option<Unit>,
    /// Folder for pictures: phase, modulation, depth, decisions, δ, and false points if the truth is known.
    #[arg(long, value_name = "FOLDER")]
    preview: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    proposed: ProposedArgs,
}

#[derive(serde::Serialize)]
struct Report<'a> {
    set: &'a str,
    method: Method,
    cloud: &'a std::path::Path,
    points: usize,
    #[serde(flatten)]
    statistics: Option<&'a Statistics>,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["input", "output", "method", "units", "preview", "json", "threads", "simd"],
    choices: &[&[
        Mode { name: "with --method pa", is_chosen: |args| args.method == Method::Pa, options: PROPOSED_OPTIONS },
        Mode { name: "with --method egc or cgc", is_chosen: |_| true, options: &[] },
    ]],
};

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        CloudFormat::from_path(&self.output)?;
        check_writable(&self.output)?;
        if let Some(folder) = &self.preview {
            output_folder::prepare(folder)?;
        }
        let input = Input::open(&self.input, self.units)?;
        let output = self.method.run(&input, &self.proposed)?;
        let unit = self.units.unwrap_or(Unit::Millimetre);
        output.cloud.write(&self.output, &CloudExport { unit, dataset: &input.setup().name })?;
        if let Some(folder) = &self.preview {
            pictures::write(folder, &input, &output)?;
        }
        self.print(&input, &output)
    }

    fn print(&self, input: &Input, output: &MethodOutput) -> Result<(), Failure> {
        let statistics = output.proposed.as_ref().map(Statistics::new);
        let points = output.cloud.points.len();
        let mut out = std::io::stdout().lock();
        if self.json {
            let report = Report {
                set: &input.setup().name,
                method: self.method,
                cloud: &self.output,
                points,
                statistics: statistics.as_ref(),
            };
            serde_json::to_writer(&mut out, &report).map_err(std::io::Error::from)?;
            writeln!(out)?;
        } else {
            for warning in statistics.iter().flat_map(Statistics::warnings) {
                writeln!(out, "{warning}")?;
            }
            let note = statistics.as_ref().and_then(Statistics::outside_note).unwrap_or_default();
            writeln!(out, "{}: {points} points in {}{note}", input.setup().name, self.output.display())?;
            if let Some(statistics) = statistics {
                write!(out, "{statistics}")?;
            }
        }
        Ok(())
    }
}
