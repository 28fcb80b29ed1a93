//! One object with one seed, measured by every way.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::{Outcome, OutcomeCounts, ResolutionMethod, SegmentTable, SegmentTableError};
use fringeflow::geometry::EpipolarError;
use fringeflow::phase::{PhaseShifts, ShiftError};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor, Settings};
use fringeflow_dataset::{
    CameraId, Dataset, DatasetError, GreyImage, RenderedTruth, Truth, UnevenSteps, evenly_spaced,
};
use serde::Serialize;

use super::Way;
use crate::evaluation::{
    Evaluation, EvaluationError, Frames, GrayReferenceError, Judgement, Scores, SimulatedDatasetError, against_cloud,
    against_rendered, cgc, egc, gray_reference_data,
};
use crate::simulation::{Object, Simulation, SimulationError};

/// The images of an object with one seed, and the references.
#[derive(Clone, Debug)]
pub struct Trial {
    object: Object,
    seed: u64,
    dataset: Dataset,
    truth: RenderedTruth,
    gray: Cloud,
    table: SegmentTable,
}

/// Figures of one way with one number of steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The object.
    pub object: &'static str,
    /// The seed.
    pub seed: u64,
    /// The way.
    pub way: Way,
    /// Phase steps.
    pub steps: usize,
    /// Images that were read of each camera.
    pub images: u64,
    /// Scores by the exact truth.
    pub truth: Scores,
    /// Scores by RD, which EGC finds in all images.
    pub rd: Scores,
    /// Figures of δ; `None` with Gray code, which does not test it.
    pub delta: Option<DeltaFigures>,
    /// Points of RD without a point of the cloud, by the outcome of their pixel; empty with Gray code.
    pub missed: BTreeMap<&'static str, u64>,
    /// Time from the files of the images to the cloud, with the segment table at hand, seconds.
    pub seconds: f64,
}

/// A measurement: its figures, and the judgement of each pixel of C1 by RD.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The figures.
    pub figures: Figures,
    /// Judgements, row by row.
    pub judgements: Vec<Judgement>,
    /// Width and height of the images, pixels.
    pub size_px: [usize; 2],
}

/// Figures of δ and of the candidates. The product's way tests δ about the drift, so its sd is that about the drift.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DeltaFigures {
    /// Mean number of periods on a segment: n.
    pub mean_periods: f64,
    /// Standard deviation of δ, rad: sd.
    pub sd_rad: f64,
    /// Expected false candidates by Eq. (1).
    pub efc_predicted: f64,
    /// Candidates per point that passed the test besides the chosen one.
    pub efc_measured: f64,
    /// Expected percentage of unique correspondences, 100·(1 − efc) (2.2.1).
    pub puc_predicted: f64,
    /// Percentage of the points whose pixel had a single candidate.
    pub puc_measured: f64,
}

/// Why a trial failed.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The scene cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The images or the reference data cannot be written.
    #[error(transparent)]
    Written(#[from] SimulatedDatasetError),
    /// The images cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The dataset has no truth.
    #[error("the simulated dataset has no truth")]
    NoTruth,
    /// The simulation has no Gray code.
    #[error("the simulated dataset has no Gray code, so there are no reference data")]
    NoGrayCode,
    /// The dataset has no measurement volume.
    #[error("the simulated dataset has no measurement volume")]
    NoVolume,
    /// The rig has no segment table.
    #[error(transparent)]
    Table(#[from] SegmentTableError),
    /// The rig has no epipolar frame.
    #[error(transparent)]
    Epipolar(#[from] EpipolarError),
    /// The phase images cannot be thinned out evenly.
    #[error(transparent)]
    Steps(#[from] UnevenSteps),
    /// The phase shifts determine no phase.
    #[error(transparent)]
    Shifts(#[from] ShiftError),
    /// Gray code cannot measure the images.
    #[error(transparent)]
    Gray(#[from] GrayReferenceError),
    /// The proposed algorithm cannot measure the images.
    #[error(transparent)]
    Reconstruction(#[from] ReconstructionError),
    /// The cloud cannot be compared.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
}

impl Trial {
    /// Takes the images of a scene with the calibration error and the noise of a seed, writes them to `folder`, which
    /// must not exist, and computes both references:
    ///
    /// - the exact truth, at the pixels where EGC agrees with it;
    /// - RD: the correspondences that EGC finds in all images, in the volume, whose own back-projection residual is
    ///   small. The paper's reference data are such a result.
    ///
    /// # Errors
    /// [`TrialError`].
    pub fn new(simulation: &Simulation, seed: u64, folder: &Path) -> Result<Self, TrialError> {
        let gray = simulation.with_seed(seed)?.write(folder, || {})?.ok_or(TrialError::NoGrayCode)?;
        let dataset = Dataset::open(folder, None)?;
        let Some(Truth::Rendered(truth)) = dataset.truth()? else { return Err(TrialError::NoTruth) };
        let Some(volume) = dataset.setup.volume else { return Err(TrialError::NoVolume) };
        let table = SegmentTable::build(&dataset.setup.rig, &volume, &dataset.setup.sequence.pattern)?;
        let gray = gray_reference_data(gray, &volume);
        Ok(Self { object: simulation.options().object, seed, dataset, truth, gray, table })
    }

    /// Measures the object by a way, from `steps` of the phase images of each direction.
    ///
    /// # Errors
    /// [`TrialError`].
    pub fn measure(&self, way: Way, steps: usize) -> Result<Measurement, TrialError> {
        let read_before = self.dataset.images_read(CameraId::Cam1);
        let start = Instant::now();
        let (cloud, proposed) = match way.resolution() {
            Some(method) => {
                let reconstruction = self.reconstruct(method, steps)?;
                (reconstruction.cloud.clone(), Some(reconstruction))
            }
            None if way == Way::Egc => (egc(&self.dataset, Some(steps))?, None),
            None => (cgc(&self.dataset, Some(steps))?, None),
        };
        let seconds = start.elapsed().as_secs_f64();
        let setup = &self.dataset.setup;
        let size_px = setup.image_size_px;
        let truth = against_rendered(&cloud, size_px, &self.truth, &Frames::from_setup(setup))?.scores;
        let Evaluation { scores: rd, judgements } = against_cloud(&cloud, size_px, &self.gray)?;
        let images = self.dataset.images_read(CameraId::Cam1) - read_before;
        let delta = proposed.as_ref().map(DeltaFigures::of_reconstruction);
        let missed = proposed.map_or_else(BTreeMap::new, |found| missed(&judgements, &found.matches.outcomes));
        let (object, seed) = (self.object.name(), self.seed);
        let figures = Figures { object, seed, way, steps, images, truth, rd, delta, missed, seconds };
        Ok(Measurement { figures, judgements, size_px })
    }

    /// Reconstructs the cloud by the proposed algorithm.
    fn reconstruct(&self, method: ResolutionMethod, steps: usize) -> Result<Reconstruction, TrialError> {
        let setup = &self.dataset.setup;
        let all_rad = &setup.sequence.shifts_rad;
        let numbers = evenly_spaced(0..all_rad.len(), steps)?;
        let shifts_rad: Vec<f64> = numbers.iter().map(|&number| all_rad[number]).collect();
        let mut settings = Settings { extra_images: Some(0), ..Settings::default() };
        settings.matching.method = method;
        let shifts = PhaseShifts::new(&shifts_rad)?;
        let (table, pattern) = (self.table.clone(), &setup.sequence.pattern);
        let mut reconstructor = Reconstructor::new(&setup.rig, pattern, table, &shifts, settings)?;
        let cam1 = self.dataset.phase_images(CameraId::Cam1, &numbers)?;
        let cam2 = self.dataset.phase_images(CameraId::Cam2, &numbers)?;
        let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
        Ok(reconstructor.reconstruct(0, &cam1, &cam2, None)?)
    }
}

/// Counts the missed points by the outcome of their pixel.
fn missed(judgements: &[Judgement], outcomes: &[Outcome]) -> BTreeMap<&'static str, u64> {
    let mut missed = BTreeMap::new();
    for (_, outcome) in judgements.iter().zip(outcomes).filter(|(judgement, _)| **judgement == Judgement::Missed) {
        *missed.entry(outcome.name()).or_default() += 1;
    }
    missed
}

impl DeltaFigures {
    fn of_reconstruction(reconstruction: &Reconstruction) -> Self {
        let Reconstruction { matches, cloud, .. } = reconstruction;
        let about_drift = matches.drift.as_ref().map(|drift| drift.residual_statistics(&matches.delta));
        let delta = about_drift.unwrap_or(matches.delta);
        Self {
            mean_periods: delta.mean_periods,
            sd_rad: delta.sd_rad,
            efc_predicted: delta.expected_false_candidates(),
            efc_measured: cloud.false_candidates_per_point(),
            puc_predicted: delta.expected_unique_percent(),
            puc_measured: OutcomeCounts::from_outcomes(&matches.outcomes).unique_percent().unwrap_or_default(),
        }
    }
}
