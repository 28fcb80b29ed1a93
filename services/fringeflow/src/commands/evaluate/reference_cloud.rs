//! Clouds of a dataset by the reference methods.

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::reference_methods::{
    MatchError, ReferenceMatch, match_along_epipolar_lines, match_both_directions, reference_cloud,
};
use fringeflow::dataset::{CameraId, Dataset, FringeSequence};
use fringeflow::geometry::MeasurementVolume;
use fringeflow::phase::{AbsolutePhase, PhaseMap, Threshold, decode_gray_code};

use super::{unusable, wrapped_phase};
use crate::failure::Failure;

/// Standard deviation of camera noise with which Gray-code bits are judged, grey levels.
const NOISE_GREY: f32 = 1.5;
/// Standard deviation of a match along the epipolar line, pixels: phase noise over fringes of about ten pixels.
const MATCH_SD_PX: f64 = 0.05;

/// Wrapped and absolute phase of one camera and direction.
struct Decoded {
    wrapped: PhaseMap,
    absolute: AbsolutePhase,
}

/// Full Gray code with epipolar lines.
pub(super) fn egc(dataset: &Dataset, volume: Option<&MeasurementVolume>) -> Result<Cloud, Failure> {
    let [cam1, cam2] = [decode(dataset, CameraId::Cam1, false)?, decode(dataset, CameraId::Cam2, false)?];
    let matches = match_along_epipolar_lines(&dataset.rig, &cam1.absolute, &cam2.absolute, volume);
    cloud(dataset, &cam1.wrapped, matches)
}

/// Full Gray code in two fringe directions.
pub(super) fn cgc(dataset: &Dataset, volume: Option<&MeasurementVolume>) -> Result<Cloud, Failure> {
    let [columns1, columns2] = [decode(dataset, CameraId::Cam1, false)?, decode(dataset, CameraId::Cam2, false)?];
    let [rows1, rows2] = [decode(dataset, CameraId::Cam1, true)?, decode(dataset, CameraId::Cam2, true)?];
    let cam1 = [&columns1.absolute, &rows1.absolute];
    let cam2 = [&columns2.absolute, &rows2.absolute];
    cloud(dataset, &columns1.wrapped, match_both_directions(&dataset.rig, cam1, cam2, volume))
}

fn cloud(
    dataset: &Dataset,
    cam1: &PhaseMap,
    matches: Result<Vec<Option<ReferenceMatch>>, MatchError>,
) -> Result<Cloud, Failure> {
    let matches = matches.map_err(unusable)?;
    Ok(reference_cloud(&dataset.rig, &dataset.sequence.pattern, cam1, &matches, MATCH_SD_PX))
}

fn decode(dataset: &Dataset, camera: CameraId, second_direction: bool) -> Result<Decoded, Failure> {
    let sequence = sequence(dataset, second_direction)?;
    let numbers: Vec<usize> = (0..sequence.shifts_rad.len()).collect();
    let images = match second_direction {
        false => dataset.phase_images(camera, &numbers)?,
        true => dataset.second_phase_images(camera, &numbers)?,
    };
    let wrapped = wrapped_phase::decode(&images, &sequence.shifts_rad)?;
    let code = sequence.gray.as_ref().ok_or_else(|| missing(dataset, "Gray code (field gray of meta.json)"))?;
    let white_and_black = dataset.white_and_black(camera)?;
    let threshold = match &white_and_black {
        Some((white, black)) => Threshold::WhiteAndBlack(white, black),
        None => Threshold::MeanOfPhaseImages,
    };
    let gray = dataset.gray_images(camera, second_direction)?;
    let absolute = decode_gray_code(&wrapped, &sequence.pattern, code, &gray, threshold, NOISE_GREY);
    Ok(Decoded { wrapped, absolute: absolute.map_err(unusable)? })
}

fn sequence(dataset: &Dataset, second_direction: bool) -> Result<&FringeSequence, Failure> {
    match (second_direction, &dataset.second_direction) {
        (false, _) => Ok(&dataset.sequence),
        (true, Some(second)) => Ok(second),
        (true, None) => Err(missing(dataset, "second fringe direction (field second_direction of meta.json)")),
    }
}

fn missing(dataset: &Dataset, what: &str) -> Failure {
    Failure::Usage(format!("{} has no {what}, which this method needs", dataset.folder.display()))
}
