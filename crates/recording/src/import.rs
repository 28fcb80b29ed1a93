//! Imports a dataset folder as a recording, as if a scanner had taken its phase images at a constant rate.
//!
//! In: a dataset. Out: a recording with image k of both cameras as sequence number k, pattern events, the setup, and
//! the ground truth if there is one. The same dataset and rate always give the same bytes: the times start at one
//! second, and the recording contains no host name.

use std::path::{Path, PathBuf};

use fringeflow_dataset::{CameraId, Dataset, DatasetError, GreyImage, SetupError, TRUTH_FILE};
use fringeflow_message::{FrameHeader, PATTERN_FRINGES, PatternEvent};

use crate::{OfflineRecorder, Opening, Origin, Recordable, RecorderCounts, RecordingError, RecordingProblem};

/// Start of the first exposure.
const FIRST_EXPOSURE_NS: u64 = 1_000_000_000;
/// Session of cameras and projector.
const SESSION: u64 = 1;

/// Why a dataset was not imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The dataset cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The setup of the dataset is invalid.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The phase shifts do not repeat with the cycle, so they cannot be stated by pattern events.
    #[error(
        "{}: phase_shift_rad {image} is {shift_rad} and {step} is {first_rad}; a recording needs shifts that repeat \
         every {steps} images", folder.display()
    )]
    NotPeriodic {
        /// The dataset.
        folder: PathBuf,
        /// The image.
        image: usize,
        /// Phase shift of the image.
        shift_rad: f64,
        /// The image of the first cycle with the same step.
        step: usize,
        /// Phase shift of that image.
        first_rad: f64,
        /// Steps of the cycle.
        steps: usize,
    },
}

/// Options of an import.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportOptions<'a> {
    /// Time from one exposure to the next.
    pub period_ns: u64,
    /// Text of the configuration.
    pub configuration: &'a str,
    /// Number of bytes of the disk that must stay free.
    pub min_free_bytes: u64,
}

/// Writes a dataset as a recording. Calls `progress` after each image pair.
///
/// # Errors
/// The phase shifts do not repeat, an image is unreadable, the file exists, or the disk is full.
pub fn import(
    dataset: &Dataset,
    target: &Path,
    options: &ImportOptions<'_>,
    mut progress: impl FnMut(),
) -> Result<RecorderCounts, ImportError> {
    check_periodic(dataset)?;
    let setup = dataset.setup.of_grey_images()?;
    let origin = Origin::default();
    let opening = Opening {
        setup: &setup,
        configuration: options.configuration,
        origin: &origin,
        min_free_bytes: options.min_free_bytes,
    };
    let mut recorder = OfflineRecorder::create(target, &opening)?;
    match write(&mut recorder, dataset, options.period_ns, &mut progress) {
        Ok(()) => Ok(recorder.finish()?),
        Err(Stopped::Dataset(error)) => {
            // The dataset still exists, so nothing is lost.
            recorder.discard();
            Err(error.into())
        }
        Err(Stopped::Writing(problem)) => Err(recorder.abort(problem).into()),
    }
}

/// Checks that all images of a step have the same phase shift, because a pattern event states only the step.
fn check_periodic(dataset: &Dataset) -> Result<(), ImportError> {
    let (shifts, steps) = (&dataset.setup.sequence.shifts_rad, dataset.setup.steps);
    let differs = shifts.iter().zip(shifts.iter().cycle().take(steps).cycle()).position(|(a, b)| a != b);
    let Some(image) = differs else { return Ok(()) };
    let (folder, step) = (dataset.folder.clone(), image % steps);
    Err(ImportError::NotPeriodic { folder, image, shift_rad: shifts[image], step, first_rad: shifts[step], steps })
}

/// Why an import stopped.
enum Stopped {
    Dataset(DatasetError),
    Writing(RecordingProblem),
}

impl From<DatasetError> for Stopped {
    fn from(error: DatasetError) -> Self {
        Self::Dataset(error)
    }
}

impl From<RecordingProblem> for Stopped {
    fn from(problem: RecordingProblem) -> Self {
        Self::Writing(problem)
    }
}

fn write(
    recorder: &mut OfflineRecorder,
    dataset: &Dataset,
    period_ns: u64,
    progress: &mut dyn FnMut(),
) -> Result<(), Stopped> {
    if let Some(truth) = dataset.truth_bytes()? {
        recorder.attach(TRUTH_FILE, "application/zip", &truth)?;
    }
    let (setup, images) = (&dataset.setup, dataset.setup.sequence.shifts_rad.len());
    for number in 0..images {
        let time_ns = FIRST_EXPOSURE_NS + number as u64 * period_ns;
        let event = PatternEvent {
            session: SESSION,
            sequence: number as u64,
            exposure_start_ns: time_ns,
            duration_ns: period_ns,
            period_px: setup.sequence.pattern.period_px,
            step: (number % setup.steps) as u32,
            steps: setup.steps as u32,
            kind: PATTERN_FRINGES,
            reserved: 0,
        };
        recorder.put(&Recordable::Pattern(&event))?;
        for (camera, id) in [1, 2].into_iter().zip(CameraId::BOTH) {
            for image in dataset.phase_images(id, &[number])? {
                let header = header(camera, number as u64, &image, [time_ns, period_ns]);
                recorder.put(&Recordable::Frame { header: &header, image: &image.pixels })?;
            }
        }
        progress();
    }
    Ok(())
}

fn header(camera: u32, number: u64, image: &GreyImage, [time_ns, period_ns]: [u64; 2]) -> FrameHeader {
    FrameHeader {
        session: SESSION,
        sequence: number,
        published: number,
        exposure_start_ns: time_ns,
        received_ns: time_ns + period_ns,
        exposure_ns: 0,
        width_px: image.width as u32,
        height_px: image.height as u32,
        stride_bytes: (image.width * image.format.bytes()) as u32,
        pixel_format: image.format.code(),
        flags: 0,
        camera,
    }
}
