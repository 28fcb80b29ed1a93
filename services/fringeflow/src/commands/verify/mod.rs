//! `fringeflow verify`: measures an artefact of known size, and judges the scanner by it.

mod certificate;
mod cloud_file;
mod clouds;
mod explanation;
mod page;
mod picture;
mod results;
mod text;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use fringeflow::calibration::Unit;
use fringeflow_base::atomic_file::{check_writable, write_atomically};
use fringeflow_lab::artefact::measure;

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::json;
use crate::proposed::MeasuringArgs;
use crate::values::unit;

use certificate::Certificate;
use clouds::TimedCloud;
use results::{Lost, Results, Window};

/// Arguments of `fringeflow verify`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording, whose clouds are measured, dataset folder, or cloud (.ply).
    input: PathBuf,
    /// The artefact: plane, sphere:DIAMETER_MM, ball-bar:DIAMETER_MM,SPACING_MM, or a file with its certified lengths,
    /// their uncertainties and limits of acceptance, see configs/ball-bar.toml.
    #[arg(long, value_name = "ARTEFACT")]
    artefact: String,
    /// Measure every K-th cloud.
    #[arg(long, value_name = "K", default_value = "1")]
    every: NonZeroUsize,
    /// Compute the clouds of a recording from its images, and measure these.
    #[arg(long)]
    recompute: bool,
    /// Unit of a cloud or of the calibration, if the input does not state one. Another unit than the stated one is
    /// refused.
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    units: Option<Unit>,
    /// Write an HTML page with the figures, their pictures and all windows.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    measuring: MeasuringArgs,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["input", "artefact", "units", "report", "json", "threads", "simd"],
    choices: &[&[
        Mode { name: "with a cloud", is_chosen: Args::is_cloud_file, options: &[] },
        Mode {
            name: "with a dataset folder",
            is_chosen: |args| args.input.is_dir(),
            options: &["extra_images", "config", "resolution", "min_confidence", "segment_table"],
        },
        Mode {
            name: "with a recording and --recompute",
            is_chosen: |args| args.recompute,
            options: &[
                "every",
                "recompute",
                "extra_images",
                "config",
                "no_prior",
                "resolution",
                "min_confidence",
                "segment_table",
            ],
        },
        Mode { name: "with a recording", is_chosen: |_| true, options: &["every", "recompute"] },
    ]],
};

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        self.report.iter().try_for_each(|path| check_writable(path))?;
        let certificate = certificate::parse(&self.artefact)?;
        let (mut windows, mut lost, mut skipped) = (Vec::new(), Vec::new(), 0);
        let origin = self.for_each_cloud(|cloud| match measured(cloud, &certificate, &mut skipped) {
            Ok(window) => windows.push(window),
            Err(reason) => lost.push(reason),
        })?;
        if windows.is_empty() {
            let why = lost.first().map_or("it has no cloud", |lost| lost.why.as_str());
            let (file, count) = (self.input.display(), lost.len());
            let what = format!("{file}: the artefact was measured in none of its clouds ({count}): {why}");
            return Err(Failure::NothingMeasured(what));
        }
        let results = Results::new(&self.input, origin, &certificate, &windows, lost, skipped);
        if let Some(path) = &self.report {
            write_atomically(path, |out| page::write(out, &results, &windows))?;
        }
        if self.json {
            json::print(&results)?;
        } else {
            text::print(&results)?;
        }
        results.check()
    }
}

fn measured(cloud: TimedCloud, certificate: &Certificate, skipped: &mut usize) -> Result<Window, Lost> {
    let TimedCloud { number, time_s, points } = cloud;
    let lost = |why: String| Lost { number, time_s, why };
    let points = points.map_err(lost)?;
    *skipped += points.skipped;
    let measurement = measure(&points.measured(), &certificate.artefact).map_err(|error| lost(error.to_string()))?;
    Ok(Window { number, time_s, measurement })
}
