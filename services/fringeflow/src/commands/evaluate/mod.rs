//! `fringeflow evaluate`: reconstructs a dataset or a recording and compares the cloud with what is known of the scene.

mod measurement;
mod paper;
mod report;
mod sweep;

use std::path::PathBuf;
use std::str::FromStr;

use fringeflow::calibration::Unit;
use fringeflow_dataset::TRUTH_FILE;
use fringeflow_lab::evaluation::{Evaluation, against_cloud, egc};
use fringeflow_lab::simulation::Object;

use crate::failure::Failure;
use crate::input::Input;
use crate::method::{Made, Method};
use crate::output_folder;
use crate::pictures;
use crate::proposed::ProposedArgs;
use crate::truth;

use self::sweep::Knob;

/// What a cloud is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Against {
    /// The truth of the dataset: exact for rendered ones, a Gray-code reference for captured ones.
    Truth,
    /// What Gray code with epipolar lines (EGC) finds in the same images.
    Gray,
}

/// Arguments of `fringeflow evaluate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Dataset folder, or recording.
    #[arg(required_unless_present_any = ["paper", "sweep"])]
    input: Option<PathBuf>,
    /// What to compare with.
    #[arg(long, value_enum, default_value_t = Against::Truth)]
    against: Against,
    /// How to find correspondences.
    #[arg(long, value_enum, default_value_t = Method::Pa)]
    method: Method,
    /// Measure the paper's seven objects with the virtual scanner, and print its tables beside ours; of the options of the
    /// method, --resolution alone is heeded.
    #[arg(long, conflicts_with = "input")]
    paper: bool,
    /// Measure the virtual scanner with more and more false candidates, by depth of the volume, error of the calibration
    /// and fringe period, with a board from 30 mm before the volume to 1000 mm behind it, and with 3 to 16 steps; print the
    /// figures and write sweep.csv and sweep.svg.
    #[arg(long, conflicts_with_all = ["input", "paper"], requires = "output")]
    sweep: bool,
    /// Folder for what --sweep writes.
    #[arg(short, long, value_name = "FOLDER", requires = "sweep")]
    output: Option<PathBuf>,
    /// What --sweep measures.
    #[arg(
        long,
        value_name = "NAME,NAME",
        value_delimiter = ',',
        default_values = ["elephant", "machine", "clutter"],
        value_parser = Object::from_str,
        requires = "sweep"
    )]
    objects: Vec<Object>,
    /// What --sweep turns: depth, sd, period, board, steps.
    #[arg(
        long,
        value_name = "NAME,NAME",
        value_delimiter = ',',
        default_values_t = Knob::ALL,
        value_enum,
        requires = "sweep"
    )]
    series: Vec<Knob>,
    /// Unit of the calibration, where the dataset does not state it.
    #[arg(long, value_name = "mm|m")]
    units: Option<Unit>,
    /// Folder for pictures, judgement.png of what is right and wrong among them.
    #[arg(long, value_name = "FOLDER")]
    preview: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    proposed: ProposedArgs,
}

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        if let Some(folder) = &self.preview {
            output_folder::prepare(folder)?;
        }
        if let Some(folder) = &self.output {
            output_folder::prepare(folder)?;
            return sweep::run(folder, &self.objects, &self.series, self.json);
        }
        let Some(input) = &self.input else {
            return paper::run(&self.proposed.resolution_alone(), self.json);
        };
        let input = Input::open(input, self.units)?;
        let made = self.method.run(&input, &self.proposed)?;
        let evaluation = self.judge(&input, &made)?;
        if let Some(folder) = &self.preview {
            pictures::write(folder, &input, &made)?;
        }
        report::print(&input.setup().name, self, &made, &evaluation)
    }

    fn judge(&self, input: &Input, made: &Made) -> Result<Evaluation, Failure> {
        if self.against == Against::Gray {
            let reference = egc(input.folder()?)?;
            return against_cloud(&made.cloud, input.setup().image_size_px, &reference).map_err(Failure::unusable);
        }
        truth::evaluate(input, &made.cloud, made.image())?.ok_or_else(|| {
            let file = input.path().join(TRUTH_FILE);
            Failure::Usage(format!("{} is missing; give --against gray instead", file.display()))
        })
    }
}
