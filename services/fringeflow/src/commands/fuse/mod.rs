//! `fringeflow fuse`: tracks the clouds of a moving scanner and fuses them into one model.

mod pair_use;
mod scan;
mod summary;
mod trajectory;
mod trajectory_errors;

use std::num::NonZeroUsize;
use std::ops::Range;
use std::path::PathBuf;

use fringeflow::calibration::Unit;
use fringeflow::cloud::CloudExport;
use fringeflow_base::atomic_file::check_writable;
use fringeflow_config::Configuration;
use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{FusionSettings, Tracker, write_model};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::images::Images;
use crate::input::Input;
use crate::json;
use crate::output_folder::has_extension;
use crate::proposed::{MeasuringArgs, parse_range};
use crate::values::unit;

use pair_use::PairUse;
use scan::Scan;
use summary::Summary;

/// Arguments of `fringeflow fuse`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording of a scanner that moved over an object at rest.
    input: PathBuf,
    /// Model to write (.ply).
    #[arg(short, long, value_name = "MODEL.ply")]
    output: PathBuf,
    /// Image pairs from one cloud to the next. The default is the number of steps.
    #[arg(long, value_name = "K")]
    every: Option<NonZeroUsize>,
    /// Leave out points that fewer than M clouds measured, although M or more could see them.
    #[arg(long, value_name = "M", default_value_t = FusionSettings::default().min_support)]
    min_support: u32,
    /// Use image pairs A to B, without B. By default all are used.
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    frames: Option<Range<usize>>,
    /// Write the pose of every cloud and its standard deviation as CSV.
    #[arg(long, value_name = "POSES.csv")]
    trajectory: Option<PathBuf>,
    /// Unit of the model and of the trajectory.
    #[arg(long, value_name = "UNIT", default_value = "mm", value_parser = unit())]
    units: Unit,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    measuring: MeasuringArgs,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&[
    "input",
    "output",
    "every",
    "min_support",
    "frames",
    "trajectory",
    "units",
    "json",
    "extra_images",
    "config",
    "no_prior",
    "resolution",
    "min_confidence",
    "segment_table",
    "threads",
    "simd",
]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        self.check_outputs()?;
        let input = Input::open(&self.input, None)?;
        let configuration = self.measuring.configuration(&input)?;
        let (windows, pairs) = self.windows(&input, &configuration)?;
        let settings = FusionSettings { min_support: self.min_support, ..FusionSettings::default() };
        let tracker = Tracker::new(input.setup().rig.cam1, settings);
        let reconstructor = self.measuring.reconstructor(&input, &windows[0], &configuration)?;
        let mut stream = TrackedStream::new(reconstructor, tracker).with_priors(!self.measuring.no_prior);
        let scan = Scan::run(&input, &windows, &mut stream)?;
        let tracker = stream.tracker();
        if tracker.model().clouds() == 0 {
            let why = scan.windows.iter().find_map(scan::ScanWindow::loss_text).unwrap_or_default();
            return Err(input.unusable(&format!("no surface was found in its {} clouds: {why}", scan.windows.len())));
        }
        if let Some(path) = &self.trajectory {
            trajectory::write(path, &scan, tracker.model(), self.units)?;
        }
        let export = CloudExport { unit: self.units, dataset: &input.setup().name };
        let surfels = write_model(&self.output, tracker.model(), self.min_support, &export)?;
        let truth = trajectory_errors::against_truth(&input, &scan, tracker)?;
        let summary = Summary::new(&self.output, &scan, tracker, surfels, truth.as_ref(), pairs);
        if self.json {
            json::print(&summary)?;
        } else {
            summary.print()?;
        }
        summary.check_losses()
    }

    fn check_outputs(&self) -> Result<(), Failure> {
        if !has_extension(&self.output, "ply") {
            return Err(Failure::Usage(format!("{}: a model is a PLY file; use .ply", self.output.display())));
        }
        check_writable(&self.output)?;
        let Some(trajectory) = &self.trajectory else { return Ok(()) };
        if !has_extension(trajectory, "csv") {
            return Err(Failure::Usage(format!("{}: poses are a CSV file; use .csv", trajectory.display())));
        }
        Ok(check_writable(trajectory)?)
    }

    /// The image pairs of every cloud, at least one window, and how many pairs they use.
    fn windows(&self, input: &Input, configuration: &Configuration) -> Result<(Vec<Images>, PairUse), Failure> {
        if matches!(input, Input::Folder(_)) {
            return Err(input.unusable(&"a dataset folder yields one cloud; give a recording of a moving scanner"));
        }
        let (available, steps) = (input.pair_count(), input.setup().steps);
        let within = self.frames.clone().unwrap_or(0..available);
        if within.start > within.end || within.end > available {
            return Err(Failure::Usage(format!(
                "--frames {}..{}: the recording has image pairs 0..{available}; give a range A..B of these",
                within.start, within.end
            )));
        }
        let images = configuration.settings.window_images(steps);
        let windows = input.windows(&within, images, self.every.map_or(steps, NonZeroUsize::get));
        if windows.is_empty() {
            let count = within.len();
            return Err(input.unusable(&format!("{count} image pairs hold no complete window of {images}")));
        }
        let pairs = PairUse::new(&within, &windows, &input.windows(&within, images, 1));
        let windows: Result<_, _> = windows.into_iter().map(|window| Images::consecutive(input, window)).collect();
        Ok((windows?, pairs))
    }
}
