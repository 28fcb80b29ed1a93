//! `fringeflow rig`: reports what a rig can do, from its calibration only, or measures from images how far the
//! calibration has drifted.

mod drift;
mod picture;
mod text;

use std::io::Write as _;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use fringeflow::calibration::Unit;
use fringeflow::geometry::FringePattern;
use fringeflow_lab::rig_report::{Assumptions, CalibrationQuality, RigSetup, report};

use crate::acting_options::{ActingOptions, Mode};
use crate::calibrated_rig::CalibratedRig;
use crate::failure::Failure;
use crate::output_folder;
use crate::values::unit;

/// Arguments of `fringeflow rig`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Calibration file (OpenCV YAML), configuration of a scanner (.toml), dataset folder or recording (.mcap). All but
    /// the calibration file also state unit, volume, pattern and steps.
    calibration: PathBuf,
    /// Unit of lengths in the calibration file and in --volume. The default is that of the dataset, else mm.
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    units: Option<Unit>,
    /// Measurement volume: xmin,ymin,zmin,xmax,ymax,zmax in the frame of camera 1 (write --volume=-50,…), or a JSON
    /// file with `R_v`, `T_v`, `min`, `max` as in a dataset's meta.json. A calibration file needs it.
    #[arg(long, value_name = "BOX|FILE", allow_hyphen_values = true)]
    volume: Option<String>,
    /// Period of the fringes, projector pixels. The default is that of the dataset, else 16.
    #[arg(long, value_name = "PX")]
    period: Option<f64>,
    /// Sign of the phase along the projector columns. The default is that of the dataset, else 1.
    #[arg(long, value_name = "SIGN", allow_hyphen_values = true, value_parser = sign())]
    sign: Option<f64>,
    /// Number of phase images of a measurement, with --images evenly spaced. The default is that of the dataset, else
    /// 4.
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Standard deviation of the camera noise, grey levels.
    #[arg(long, value_name = "GREY", default_value_t = Assumptions::default().noise_grey)]
    noise: f64,
    /// Modulation of the fringes, grey levels.
    #[arg(long, value_name = "GREY", default_value_t = Assumptions::default().modulation_grey)]
    modulation: f64,
    /// Standard deviation of the calibration error in every coordinate of every image, pixels [default: 0.065].
    #[arg(long, value_name = "PX", conflicts_with = "calibration_sd")]
    calibration_error_px: Option<f64>,
    /// Measured part of sd, the standard deviation of δ, that the calibration error causes, rad.
    #[arg(long, value_name = "RAD")]
    calibration_sd: Option<f64>,
    /// Use every PX-th pixel of camera 1.
    #[arg(long, value_name = "PX", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..))]
    grid: u16,
    /// Measure how far the calibration has drifted, in the images of a dataset folder or a recording. They state the
    /// pattern, and the volume unless --volume is given.
    #[arg(long, value_name = "DATASET|RECORDING")]
    images: Option<PathBuf>,
    /// With --images of a recording: number of windows to measure, evenly spaced [default: 30].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    windows: Option<u16>,
    /// With --images: TOML file with settings, see configs/reconstruct.toml. The default is the settings of the
    /// recording.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print one JSON object (metres, radians, pixels) instead of text.
    #[arg(long)]
    json: bool,
    /// Folder for maps of n (periods.png) and of the surviving wrong candidates (survivors.png). With --images it gets
    /// a map of the drift at the middle of the volume (drift.png).
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["calibration", "units", "volume", "steps", "json", "output", "threads", "simd"],
    choices: &[&[
        Mode {
            name: "with --images",
            is_chosen: |args| args.images.is_some(),
            options: &["images", "windows", "config"],
        },
        Mode {
            name: "without --images",
            is_chosen: |_| true,
            options: &["period", "sign", "noise", "modulation", "calibration_error_px", "calibration_sd", "grid"],
        },
    ]],
};

impl Args {
    /// Prints the report, or with --images the drift.
    pub(crate) fn run(&self) -> Result<(), Failure> {
        if let Some(images) = &self.images {
            return drift::run(self, images);
        }
        let (setup, steps) = self.setup()?;
        if let Some(folder) = &self.output {
            output_folder::prepare(folder)?;
        }
        let report = report(&setup, &self.assumptions(steps), usize::from(self.grid));
        let report = report.map_err(|e| Failure::Usage(format!("{}: {e}", self.calibration.display())))?;
        if let Some(folder) = &self.output {
            picture::write(folder, &report.evaluation)?;
        }
        let mut out = std::io::stdout().lock();
        if self.json {
            serde_json::to_writer(&mut out, &report).map_err(std::io::Error::from)?;
            writeln!(out)?;
        } else {
            text::write(&mut out, &report)?;
        }
        Ok(())
    }

    /// Setup for the report, and the number of steps.
    fn setup(&self) -> Result<(RigSetup, usize), Failure> {
        let defaults = (FringePattern { period_px: 16.0, sign: 1.0, offset_rad: 0.0 }, Assumptions::default().steps);
        let calibrated = self.calibrated_rig()?;
        let volume = calibrated.required_volume(&self.calibration)?;
        let (pattern, steps) = calibrated.measurement.unwrap_or(defaults);
        Ok((RigSetup { rig: calibrated.rig, volume, pattern: self.pattern(pattern) }, self.steps.unwrap_or(steps)))
    }

    /// Reads the calibration file, the dataset or the recording. The volume of --volume replaces its volume.
    fn calibrated_rig(&self) -> Result<CalibratedRig, Failure> {
        CalibratedRig::read(&self.calibration, self.units, self.volume.as_deref())
    }

    fn pattern(&self, pattern: FringePattern) -> FringePattern {
        let (period_px, sign) = (self.period.unwrap_or(pattern.period_px), self.sign.unwrap_or(pattern.sign));
        FringePattern { period_px, sign, ..pattern }
    }

    fn assumptions(&self, steps: usize) -> Assumptions {
        let by_sd = self.calibration_sd.map(CalibrationQuality::SdRad);
        let by_error = self.calibration_error_px.map(CalibrationQuality::ErrorPx);
        let calibration = by_sd.or(by_error).unwrap_or(Assumptions::default().calibration);
        Assumptions { steps, noise_grey: self.noise, modulation_grey: self.modulation, calibration }
    }
}

/// Parses 1 or -1.
fn sign() -> impl TypedValueParser<Value = f64> {
    PossibleValuesParser::new(["1", "-1"]).try_map(|text| text.parse::<f64>())
}
