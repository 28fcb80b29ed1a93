//! `fringeflow evaluate`: reconstructs a dataset or a recording and compares the cloud with a reference.

mod csv;
mod measurement;
mod paper;
mod report;
mod scenes;
mod sweep;

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;

use fringeflow::calibration::Unit;
use fringeflow_dataset::TRUTH_FILE;
use fringeflow_lab::evaluation::{Evaluation, against_cloud, egc};
use fringeflow_lab::scene_lists::SceneList;
use fringeflow_lab::simulation::Object;

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::input::Input;
use crate::method::{Method, MethodOutput};
use crate::output_folder;
use crate::pictures;
use crate::proposed::{PROPOSED_OPTIONS, ProposedArgs};
use crate::truth;
use crate::values::{one_of, unit};

use self::sweep::Knob;

/// Reference that a cloud is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Against {
    /// The truth of the dataset: exact for rendered datasets, a Gray-code reference for captured ones.
    Truth,
    /// The cloud that Gray code with epipolar lines (EGC) finds in the same images.
    Gray,
}

/// Arguments of `fringeflow evaluate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Dataset folder or recording.
    #[arg(required_unless_present_any = ["paper", "sweep", "scenes"])]
    input: Option<PathBuf>,
    /// Reference to compare with.
    #[arg(long, value_enum, default_value_t = Against::Truth)]
    against: Against,
    /// Method that finds the correspondences.
    #[arg(long, value_enum, default_value_t = Method::Pa)]
    method: Method,
    /// Run the experiment of the paper with the virtual scanner: its seven objects with 16, 8 and 4 steps and ten
    /// seeds, by its own way, by ours and by Gray code, and scenes with more and more false candidates. Prints the
    /// tables of the paper beside ours. With --output it writes them as paper.html, paper.md and paper.csv, and
    /// claims.csv and claims.svg.
    #[arg(long)]
    paper: bool,
    /// With --paper: one seed and small images.
    #[arg(long)]
    quick: bool,
    /// Measure the virtual scanner in series of scenes. Three series raise the expected false candidates: by the depth
    /// of the volume, the calibration error and the fringe period. One moves a board from 30 mm before the volume to
    /// 1000 mm behind it, and one uses 3 to 16 steps. Writes sweep.csv and sweep.svg, and prints the figures.
    #[arg(long, requires = "output")]
    sweep: bool,
    /// Measure the scenes of a list with the method of --resolution and the paper's: build is for building the method,
    /// judge for judging it. Scenes are made in memory. Prints tables by kind, layout and object, and the worst ten.
    /// With --output it writes scenes.csv and pictures of the worst ten.
    #[arg(long, value_name = "LIST", value_parser = one_of(&SceneList::ALL, SceneList::name))]
    scenes: Option<SceneList>,
    /// With --scenes: measure only the first N scenes, of those that --only leaves. The default is all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    take: Option<u16>,
    /// With --scenes: measure only scenes of this kind, layout or object.
    #[arg(long, value_name = "KIND", value_parser = PossibleValuesParser::new(scenes::names()))]
    only: Option<String>,
    /// With --scenes: measure the scenes with each constant of the order decision multiplied and divided by 1.5, and
    /// with each of its steps left out. Prints what each is worth; with --output it writes that as sensitivity.md. Takes
    /// several seconds a scene, so give --take.
    #[arg(long)]
    sensitivity: bool,
    /// Folder for the files of --sweep, --paper or --scenes.
    #[arg(short, long, alias = "out", value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Objects that --sweep measures.
    #[arg(
        long,
        value_name = "NAME,NAME",
        value_delimiter = ',',
        default_values = ["elephant", "machine", "clutter"],
        value_parser = one_of(&Object::ALL, Object::name)
    )]
    objects: Vec<Object>,
    /// Series that --sweep measures.
    #[arg(
        long,
        value_name = "NAME,NAME",
        value_delimiter = ',',
        default_values_t = Knob::ALL,
        value_enum
    )]
    series: Vec<Knob>,
    /// Unit of the calibration, if the input does not state one. Another unit than the stated one is refused.
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    units: Option<Unit>,
    /// Folder for pictures. judgement.png shows the right and the wrong points.
    #[arg(long, value_name = "FOLDER")]
    preview: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    proposed: ProposedArgs,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["json", "threads", "simd"],
    choices: &[
        &[
            Mode {
                name: "with --sweep",
                is_chosen: |args| args.sweep,
                options: &["sweep", "output", "objects", "series"],
            },
            Mode { name: "with --paper", is_chosen: |args| args.paper, options: &["paper", "quick", "output"] },
            Mode {
                name: "with --scenes",
                is_chosen: |args| args.scenes.is_some(),
                options: &["scenes", "take", "only", "sensitivity", "output"],
            },
            Mode {
                name: "with an INPUT",
                is_chosen: |_| true,
                options: &["input", "against", "method", "units", "preview"],
            },
        ],
        &[
            Mode { name: "with --sweep", is_chosen: |args| args.sweep, options: &[] },
            Mode { name: "with --paper", is_chosen: |args| args.paper, options: &[] },
            Mode { name: "with --sensitivity", is_chosen: |args| args.sensitivity, options: &[] },
            Mode { name: "with --scenes", is_chosen: |args| args.scenes.is_some(), options: &["resolution"] },
            Mode { name: "with an INPUT", is_chosen: |_| true, options: PROPOSED_OPTIONS },
        ],
        &[
            Mode { name: "with --method pa", is_chosen: |args| args.method == Method::Pa, options: PROPOSED_OPTIONS },
            Mode { name: "with --method egc or cgc", is_chosen: |_| true, options: &[] },
        ],
    ],
};

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        if let Some(folder) = &self.preview {
            output_folder::prepare(folder)?;
        }
        if let Some(folder) = &self.output {
            output_folder::prepare(folder)?;
        }
        if let (None, Some(list)) = (&self.input, self.scenes) {
            return scenes::run(
                list,
                self.proposed.resolution(),
                self.take,
                self.only.as_deref(),
                self.sensitivity,
                self.output.as_deref(),
                self.json,
            );
        }
        let input = match (&self.input, &self.output) {
            (Some(input), _) => input,
            (None, Some(folder)) if self.sweep => return sweep::run(folder, &self.objects, &self.series, self.json),
            (None, folder) => return paper::run(folder.as_deref(), self.quick, self.json),
        };
        let input = Input::open(input, self.units)?;
        input.check_unit(self.units)?;
        let output = self.method.run(&input, &self.proposed)?;
        let evaluation = self.evaluate(&input, &output)?;
        if let Some(folder) = &self.preview {
            pictures::write(folder, &input, &output)?;
        }
        report::print(&input.setup().name, self, &output, &evaluation)
    }

    fn evaluate(&self, input: &Input, output: &MethodOutput) -> Result<Evaluation, Failure> {
        if self.against == Against::Gray {
            let reference = egc(input.folder()?, None)?;
            return against_cloud(&output.cloud, input.setup().image_size_px, &reference).map_err(Failure::unusable);
        }
        truth::evaluate(input, &output.cloud, output.middle_image())?.ok_or_else(|| {
            let file = input.path().join(TRUTH_FILE);
            Failure::Usage(format!("{} is missing; give --against gray", file.display()))
        })
    }
}
