//! `fringeflow evaluate`: reconstructs a dataset and compares the cloud with what is known of the scene.

mod reference_cloud;
mod report;

use std::path::PathBuf;

use fringeflow::calibration::Unit;
use fringeflow::cloud::Cloud;
use fringeflow::dataset::{Dataset, Truth};
use fringeflow::evaluation::{Evaluation, Frames, against_captured, against_cloud, against_rendered};
use fringeflow::geometry::Pose;
use fringeflow::preview::judgement_picture;

use crate::failure::Failure;
use crate::preview_folder;

/// What a cloud is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Against {
    /// The truth of the dataset: exact for rendered ones, a Gray-code reference for captured ones.
    Truth,
    /// What Gray code with epipolar lines (EGC) finds in the same images.
    Gray,
}

/// How correspondences are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Method {
    /// Full Gray code with epipolar lines.
    Egc,
    /// Full Gray code in two fringe directions.
    Cgc,
}

/// Arguments of `fringeflow evaluate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Dataset folder.
    input: PathBuf,
    /// What to compare with.
    #[arg(long, value_enum)]
    against: Against,
    /// How to find correspondences.
    #[arg(long, value_enum, default_value_t = Method::Egc)]
    method: Method,
    /// Leave out points outside the measurement volume; Gray code alone knows none.
    #[arg(long)]
    restrict_to_volume: bool,
    /// Unit of the calibration, where the dataset does not state it.
    #[arg(long, value_name = "mm|m")]
    units: Option<Unit>,
    /// Write a picture of what is right and wrong (judgement.png) to this folder.
    #[arg(long, value_name = "DIR")]
    preview: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        if let Some(folder) = &self.preview {
            preview_folder::check(folder)?;
        }
        let dataset = Dataset::open(&self.input, self.units)?;
        let cloud = self.cloud(&dataset, self.method)?;
        let evaluation = match self.against {
            Against::Truth => against_truth(&dataset, &cloud)?,
            Against::Gray => {
                let reference = self.cloud(&dataset, Method::Egc)?;
                against_cloud(&cloud, dataset.image_size_px, &reference).map_err(Failure::unusable)?
            }
        };
        if let Some(folder) = &self.preview {
            let picture = judgement_picture(&evaluation.judgements, dataset.image_size_px);
            picture.write_png(&folder.join("judgement.png"))?;
        }
        report::print(&dataset.name, self.method, self.against, &evaluation.scores, self.json)
    }

    fn cloud(&self, dataset: &Dataset, method: Method) -> Result<Cloud, Failure> {
        let volume = dataset.volume.as_ref().filter(|_| self.restrict_to_volume);
        match method {
            Method::Egc => reference_cloud::egc(dataset, volume),
            Method::Cgc => reference_cloud::cgc(dataset, volume),
        }
    }
}

fn against_truth(dataset: &Dataset, cloud: &Cloud) -> Result<Evaluation, Failure> {
    let judged = match dataset.truth()? {
        Some(Truth::Rendered(truth)) => against_rendered(cloud, dataset.image_size_px, &truth, &frames(dataset)),
        Some(Truth::Captured(truth)) => against_captured(cloud, dataset.image_size_px, &truth),
        None => {
            let file = dataset.folder.join(fringeflow::dataset::TRUTH_FILE);
            return Err(Failure::Usage(format!("{} is missing; give --against gray instead", file.display())));
        }
    };
    judged.map_err(Failure::unusable)
}

/// The frames of the cloud and the truth; those of C1 where the dataset has no volume.
fn frames(dataset: &Dataset) -> Frames {
    let cam1_from_volume = dataset.volume.as_ref().map_or_else(Pose::identity, |v| *v.cam1_from_volume());
    Frames {
        cam1_from_volume,
        exact_cam1_from_volume: dataset.exact_cam1_from_volume.unwrap_or(cam1_from_volume),
        unit_m: dataset.unit.in_metres(),
    }
}
