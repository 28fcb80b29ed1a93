//! What lies in a folder: the files of a dataset, under the names that people give them.

use std::path::{Path, PathBuf};

use fringeflow::calibration::CalibrationProblem;

use super::decode::ImageFile;
use super::image_files::ImageFiles;
use super::{CALIBRATION_FILE, CameraId, DatasetError, META_FILE, Problem, SetupError};

/// Endings of calibration files; OpenCV writes all these kinds.
const CALIBRATION_ENDINGS: [&str; 4] = ["yml", "yaml", "xml", "json"];

/// The calibration file of a folder.
///
/// # Errors
/// The folder is no dataset, or has two calibrations.
pub(super) fn calibration_file(folder: &Path) -> Result<PathBuf, DatasetError> {
    let files = CALIBRATION_ENDINGS.map(|ending| folder.join(CALIBRATION_FILE).with_extension(ending));
    let mut found = files.into_iter().filter(|path| path.exists());
    let calibration = found.next();
    if let (Some(other), Some(second)) = (&calibration, found.next()) {
        return Err(DatasetError::new(&second, Problem::TwoCalibrations { other: other.clone() }));
    }
    let mut missing = Vec::new();
    if !folder.join(META_FILE).exists() {
        missing.push(META_FILE);
    }
    if calibration.is_none() {
        missing.push(CALIBRATION_FILE);
    }
    match calibration {
        Some(calibration) if missing.is_empty() => Ok(calibration),
        _ => Err(DatasetError::new(folder, Problem::NotADataset { missing: missing.join(" and no ") })),
    }
}

/// The first phase image of a folder, its header read; `None` if there is none that can be read.
pub(super) fn first_image(folder: &Path) -> Option<ImageFile> {
    let numbered = ImageFiles { folder, may_be_raw: true }.numbered("phase", 0).ok()?;
    ImageFile::open(numbered.values().next()?).ok()
}

/// The error about a folder whose setup is invalid. If the calibration has another size than `meta.json` says, the
/// images tell which of them is right.
pub(super) fn explained(folder: &Path, calibration: &Path, error: SetupError) -> DatasetError {
    if let SetupError::Calibration(CalibrationProblem::OtherImageSize { .. }) = error {
        let sizes = CameraId::BOTH.map(|camera| Some(first_image(&folder.join(camera.folder()))?.size_px()));
        if let [Some(cam1_px), Some(cam2_px)] = sizes
            && cam1_px != cam2_px
        {
            return DatasetError::new(&folder.join(CameraId::Cam2.folder()), Problem::TwoSizes { cam1_px, cam2_px });
        }
    }
    error.in_folder(folder, calibration)
}
