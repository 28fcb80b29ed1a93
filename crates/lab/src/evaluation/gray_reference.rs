//! Computes clouds of a dataset with the reference methods (paper, Table 2).
//!
//! In: a dataset with Gray code. Out: a cloud. The code is unique along an epipolar line. But where C2 does not see the
//! surface that P lights, the match is on another surface. The measurement volume, enlarged by a margin, excludes such
//! points.

use std::path::PathBuf;

use fringeflow::cloud::{Cloud, reference_cloud};
use fringeflow::correspondence::reference_methods::{
    MatchError, ReferenceMatch, match_along_epipolar_lines, match_both_directions,
};
use fringeflow::geometry::MeasurementVolume;
use fringeflow::phase::{
    self, AbsolutePhase, GrayCode, GrayCodeError, PhaseMap, PhaseShifts, ShiftError, Threshold, Validity,
    decode_gray_code,
};
use fringeflow_dataset::{CameraId, Dataset, DatasetError, FringeSequence, GreyImage, UnevenSteps, evenly_spaced};

/// Excludes only dark pixels: Gray code itself shows whether a phase fits.
const VALIDITY: Validity = Validity { min_modulation_grey: 6.0, saturation_grey: 255, max_residual_share: f32::MAX };
/// Standard deviation of camera noise for the decision of Gray-code bits, grey levels.
///
/// The residual of the sinusoid fit is not used: with a nonlinear projector it is ten times the noise, and reliable
/// bits would be rejected.
const NOISE_GREY: f32 = 1.5;
/// Standard deviation of a match along the epipolar line, pixels: phase noise over fringes of about ten pixels.
const MATCH_SD_PX: f64 = 0.05;

/// Margin of the volume on each side, as a share of its extent. The boxes of captured datasets exclude a hundredth of
/// the object.
const VOLUME_MARGIN: f64 = 0.1;

/// Why a reference method cannot measure a dataset.
#[derive(Debug, thiserror::Error)]
pub enum GrayReferenceError {
    /// The dataset lacks data that the method needs.
    #[error("{} has no {what}, which this method needs", folder.display())]
    Missing {
        /// The dataset folder.
        folder: PathBuf,
        /// The missing data.
        what: &'static str,
    },
    /// The phase images cannot be thinned out evenly.
    #[error(transparent)]
    Steps(#[from] UnevenSteps),
    /// The images cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The phase shifts determine no phase.
    #[error(transparent)]
    Shifts(#[from] ShiftError),
    /// The Gray code cannot be decoded.
    #[error(transparent)]
    GrayCode(#[from] GrayCodeError),
    /// The absolute phases cannot be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
}

/// A fringe direction.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    /// Along the columns of the projector.
    First,
    /// Along its rows.
    Second,
}

/// Wrapped and absolute phase of one camera and direction.
struct DecodedPhase {
    wrapped: PhaseMap,
    absolute: AbsolutePhase,
}

/// Computes the cloud by full Gray code with epipolar lines (EGC), from all phase images, or from `steps` of them,
/// evenly spaced.
///
/// # Errors
/// The dataset has no Gray code, unusable images, or an unusable rig, or `steps` does not divide the number of images.
pub fn egc(dataset: &Dataset, steps: Option<usize>) -> Result<Cloud, GrayReferenceError> {
    let decode = |camera| decode(dataset, camera, Direction::First, steps);
    let [cam1, cam2] = [decode(CameraId::Cam1)?, decode(CameraId::Cam2)?];
    let matches =
        match_along_epipolar_lines(&dataset.setup.rig, &cam1.absolute, &cam2.absolute, volume(dataset).as_ref());
    cloud(dataset, &cam1.wrapped, matches)
}

/// Returns the volume in which matches are searched.
fn volume(dataset: &Dataset) -> Option<MeasurementVolume> {
    dataset.setup.volume.as_ref().map(|volume| volume.enlarged(VOLUME_MARGIN))
}

/// Computes the cloud by full Gray code in two fringe directions (CGC), from all phase images, or from `steps` of them
/// in each direction.
///
/// # Errors
/// As [`egc`], or the dataset has no second fringe direction.
pub fn cgc(dataset: &Dataset, steps: Option<usize>) -> Result<Cloud, GrayReferenceError> {
    let decode = |direction, camera| decode(dataset, camera, direction, steps);
    let [columns1, columns2] = [decode(Direction::First, CameraId::Cam1)?, decode(Direction::First, CameraId::Cam2)?];
    let [rows1, rows2] = [decode(Direction::Second, CameraId::Cam1)?, decode(Direction::Second, CameraId::Cam2)?];
    let cam1 = [&columns1.absolute, &rows1.absolute];
    let cam2 = [&columns2.absolute, &rows2.absolute];
    cloud(dataset, &columns1.wrapped, match_both_directions(&dataset.setup.rig, cam1, cam2, None))
}

fn cloud(
    dataset: &Dataset,
    cam1: &PhaseMap,
    matches: Result<Vec<Option<ReferenceMatch>>, MatchError>,
) -> Result<Cloud, GrayReferenceError> {
    Ok(reference_cloud(&dataset.setup.rig, &dataset.setup.sequence.pattern, cam1, &matches?, MATCH_SD_PX))
}

fn decode(
    dataset: &Dataset,
    camera: CameraId,
    direction: Direction,
    steps: Option<usize>,
) -> Result<DecodedPhase, GrayReferenceError> {
    let sequence = sequence(dataset, direction)?;
    let code = sequence.gray.ok_or_else(|| missing(dataset, "Gray code (field gray of meta.json)"))?;
    let numbers = phase_numbers(dataset, direction, sequence.shifts_rad.len(), steps)?;
    let wrapped = wrapped_phase(dataset, camera, direction, sequence, &numbers)?;
    let absolute = absolute_phase(dataset, camera, direction, sequence, &code, &wrapped)?;
    Ok(DecodedPhase { wrapped, absolute })
}

/// Numbers of the phase images to use, of `available` ones.
fn phase_numbers(
    dataset: &Dataset,
    direction: Direction,
    available: usize,
    steps: Option<usize>,
) -> Result<Vec<usize>, GrayReferenceError> {
    // For a moving object, use the images around the moment of the Gray code.
    let numbers = match (&dataset.setup.motion, direction) {
        (Some(_), Direction::First) => dataset.setup.reference_images(dataset.setup.steps),
        _ => 0..available,
    };
    Ok(match steps {
        Some(steps) => evenly_spaced(numbers, steps)?,
        None => numbers.collect(),
    })
}

fn wrapped_phase(
    dataset: &Dataset,
    camera: CameraId,
    direction: Direction,
    sequence: &FringeSequence,
    numbers: &[usize],
) -> Result<PhaseMap, GrayReferenceError> {
    let shifts_rad: Vec<f64> = numbers.iter().filter_map(|&n| sequence.shifts_rad.get(n).copied()).collect();
    let shifts = PhaseShifts::new(&shifts_rad)?;
    let images = match direction {
        Direction::First => dataset.phase_images(camera, numbers)?,
        Direction::Second => dataset.second_phase_images(camera, numbers)?,
    };
    let [width, height] = dataset.setup.image_size_px;
    let map = phase::decode(&GreyImage::levels_of(&images), width, height, &shifts, &VALIDITY);
    map.ok_or_else(|| missing(dataset, "complete set of phase images"))
}

fn absolute_phase(
    dataset: &Dataset,
    camera: CameraId,
    direction: Direction,
    sequence: &FringeSequence,
    code: &GrayCode,
    wrapped: &PhaseMap,
) -> Result<AbsolutePhase, GrayReferenceError> {
    let white_and_black = dataset.white_and_black(camera)?;
    let threshold = match &white_and_black {
        Some((white, black)) => Threshold::WhiteAndBlack(white.levels(), black.levels()),
        None => Threshold::MeanOfPhaseImages,
    };
    let images = dataset.gray_images(camera, direction == Direction::Second)?;
    Ok(decode_gray_code(wrapped, &sequence.pattern, code, &GreyImage::levels_of(&images), threshold, NOISE_GREY)?)
}

fn sequence(dataset: &Dataset, direction: Direction) -> Result<&FringeSequence, GrayReferenceError> {
    match (direction, &dataset.setup.second_direction) {
        (Direction::First, _) => Ok(&dataset.setup.sequence),
        (Direction::Second, Some(second)) => Ok(second),
        (Direction::Second, None) => {
            Err(missing(dataset, "second fringe direction (field second_direction of meta.json)"))
        }
    }
}

fn missing(dataset: &Dataset, what: &'static str) -> GrayReferenceError {
    GrayReferenceError::Missing { folder: dataset.folder.clone(), what }
}
