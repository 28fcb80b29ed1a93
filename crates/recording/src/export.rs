//! Exports a recording as a dataset folder: its images as PNG files, and the texts of the setup.
//!
//! If a recording was imported from a folder with only phase images and ground truth, the export is equal to that
//! folder. For other recordings, `meta.json` is adapted to the folder: to its images and their phase shifts, and
//! without Gray code.

use std::path::Path;

use serde_json::Value;

use fringeflow_dataset::{CameraId, DatasetError, DatasetWriter, ImageKind, Problem, SetupText};

use crate::{ImagePair, Recording, RecordingError, RecordingProblem};

/// Why images were not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The folder cannot be written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// Writes image pairs as a dataset folder, completely or not at all. Calls `progress` after each pair.
///
/// # Errors
/// An image cannot be read, or the folder exists or cannot be written.
pub fn export_images(
    recording: &Recording,
    pairs: &[ImagePair],
    target: &Path,
    mut progress: impl FnMut(),
) -> Result<(), ExportError> {
    let setup = recording.setup();
    let shifts: Vec<f64> = pairs.iter().filter_map(|pair| setup.sequence.shifts_rad.get(pair.step)).copied().collect();
    let has_more = setup.second_direction.is_some() || setup.sequence.gray.is_some();
    let mut text = setup.text.clone();
    if has_more || shifts != setup.sequence.shifts_rad {
        text.description = description(&text, &shifts).map_err(|p| p.in_file(recording.path()))?;
    }
    let writer = DatasetWriter::create_from_text(target, &text, setup.image_size_px)?;
    for (number, pair) in pairs.iter().enumerate() {
        for camera in CameraId::BOTH {
            for image in recording.pair_images(std::slice::from_ref(pair), camera)? {
                writer.image(camera, ImageKind::Phase(number), &image)?;
            }
        }
        progress();
    }
    if let Some(truth) = recording.truth_bytes()? {
        writer.truth_bytes(&truth)?;
    }
    Ok(writer.finish()?)
}

/// Returns the text of `meta.json` with these phase shifts and without Gray code.
fn description(text: &SetupText, shifts: &[f64]) -> Result<String, RecordingProblem> {
    let fail = |e: serde_json::Error| {
        RecordingProblem::Setup(fringeflow_dataset::SetupError::Description(Problem::Json(e.to_string())))
    };
    let mut meta: Value = serde_json::from_str(&text.description).map_err(fail)?;
    if let Some(fields) = meta.as_object_mut() {
        fields.remove("gray");
        fields.remove("second_direction");
        fields.insert("phase_shift_rad".to_owned(), shifts.into());
        fields.insert("n_phase_images".to_owned(), shifts.len().into());
    }
    serde_json::to_string_pretty(&meta).map_err(fail)
}
