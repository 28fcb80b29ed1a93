//! `fringeflow import`: converts a dataset folder to a recording.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use fringeflow::calibration::Unit;
use fringeflow::reconstruction::Settings;
use fringeflow_base::text_file::read_text;
use fringeflow_config::{Configuration, ConfigurationError};
use fringeflow_dataset::Dataset;
use fringeflow_recording::{ImportOptions, import};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::image_health::image_faults;
use crate::input::Input;
use crate::{json, progress};

/// Arguments of `fringeflow import`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Dataset folder to import.
    input: PathBuf,
    /// Recording to write.
    #[arg(short, long, value_name = "REC")]
    output: PathBuf,
    /// Image pairs per second, 0.001 to 100000.
    #[arg(long, value_name = "HZ", default_value_t = 30.0, value_parser = parse_rate)]
    rate: f64,
    /// TOML file with settings for the recording, see configs/reconstruct.toml.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Report<'a> {
    recording: &'a Path,
    set: &'a str,
    image_pairs: usize,
    messages: u64,
    /// What the images show by themselves.
    faults: Vec<String>,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["input", "output", "rate", "config", "json"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        // A recording stores the unit in its description only, so the folder must state it.
        let dataset = Dataset::open(&self.input, None::<Unit>)?;
        let configuration = match &self.config {
            Some(path) => configuration_text(path)?,
            None => settings_for_few_images(&dataset),
        };
        let options = ImportOptions {
            period_ns: (1e9 / self.rate).round() as u64,
            configuration: &configuration,
            min_free_bytes: 0,
        };
        let settings = Configuration::parse(&configuration)
            .map_err(|problem| ConfigurationError { file: self.config.clone().unwrap_or_default(), problem })?;
        let image_pairs = dataset.setup.sequence.shifts_rad.len();
        let bar = progress::bar("images", image_pairs as u64);
        let counts = import(&dataset, &self.output, &options, || bar.inc(1))?;
        bar.finish_and_clear();
        let input = Input::Folder(Box::new(dataset));
        let faults = image_faults(&input, &settings)?;
        let (set, messages) = (input.setup().name.as_str(), counts.total().passed);
        if self.json {
            return json::print(&Report { recording: &self.output, set, image_pairs, messages, faults });
        }
        let mut out = std::io::stdout().lock();
        for fault in faults {
            writeln!(out, "warning: {fault}")?;
        }
        Ok(writeln!(out, "{set}: {image_pairs} image pairs in {}", self.output.display())?)
    }
}

/// Reads a configuration file and checks that it is valid. Returns its text.
fn configuration_text(path: &Path) -> Result<String, ConfigurationError> {
    let fail = |problem| ConfigurationError { file: path.to_owned(), problem };
    let text = read_text(path).map_err(|e| fail(e.into()))?;
    Configuration::parse(&text).map_err(fail)?;
    Ok(text)
}

/// Settings for a folder with too few images for a window that compensates motion; empty if there are enough. With the
/// default settings a replay would wait for images that never come.
fn settings_for_few_images(dataset: &Dataset) -> String {
    let (images, steps) = (dataset.setup.sequence.shifts_rad.len(), dataset.setup.steps);
    if images >= Settings::default().window_images(steps) {
        return String::new();
    }
    format!("[phase]\nextra_images = {}\n", images.saturating_sub(steps))
}

/// Parses a rate of image pairs, Hz.
fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().ok().filter(|rate| (0.001..=100_000.0).contains(rate));
    rate.ok_or_else(|| format!("{text:?} is not a rate; write image pairs per second, 0.001 to 100000"))
}
