//! What a measurement needs to know beside its images: rig, pattern, shifts, measurement volume.
//!
//! A setup is the text of two files, `meta.json` and `calibration.yml`, and what they say. A recording carries the same
//! texts, so that a rig has the same numbers to the last bit wherever it is read.

use std::ops::Range;
use std::path::Path;

use fringeflow::calibration::{self, CalibrationError, CalibrationProblem, Unit};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Pose, Readout, Rig};
use fringeflow::phase::GrayCode;
use fringeflow_base::grey::PixelFormat;

use super::{CALIBRATION_FILE, DatasetError, META_FILE, Motion, Problem, meta};

/// One direction of fringes: the pattern, its shifts, and the Gray code that makes it absolute.
#[derive(Clone, Debug, PartialEq)]
pub struct FringeSequence {
    /// Phase against projector column (or row, for the second direction).
    pub pattern: FringePattern,
    /// Phase shift of every phase image, rad.
    pub shifts_rad: Vec<f64>,
    /// Gray code, if there is one.
    pub gray: Option<GrayCode>,
}

/// The texts that a setup is read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SetupText {
    /// Content of `meta.json`.
    pub description: String,
    /// Content of `calibration.yml`.
    pub calibration: String,
}

/// A rig, what it projects and where it measures; checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Name of what is measured; empty where none is stated.
    pub name: String,
    /// Unit of the calibration file and the volume.
    pub unit: Unit,
    /// Width and height of all images.
    pub image_size_px: [usize; 2],
    /// What these are of the images of the cameras.
    pub readout: Readout,
    /// Depth of all images, if one is stated.
    pub pixel_format: Option<PixelFormat>,
    /// Length of the shift cycle; there may be more images than that (moving scenes).
    pub steps: usize,
    /// Fringes that run along the projector's columns.
    pub sequence: FringeSequence,
    /// Fringes that run along the projector's rows, where there are any.
    pub second_direction: Option<FringeSequence>,
    /// Measurement volume, if one is stated.
    pub volume: Option<MeasurementVolume>,
    /// Pose of the volume that belongs to the truth, where that differs.
    pub exact_cam1_from_volume: Option<Pose>,
    /// Where the object is in every phase image, if it moves.
    pub motion: Option<Motion>,
    /// The rig of `calibration.yml`.
    pub rig: Rig,
    /// What all this was read from.
    pub text: SetupText,
}

/// Why the texts of a setup were refused.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The description.
    #[error("{META_FILE}: {0}")]
    Description(#[source] Problem),
    /// The calibration.
    #[error("{CALIBRATION_FILE}: {0}")]
    Calibration(#[source] CalibrationProblem),
}

impl Setup {
    /// Reads and checks both texts; `unit` is used where the description states none.
    ///
    /// # Errors
    /// [`SetupError`], which names file, field, value and remedy.
    pub fn parse(text: SetupText, unit: Option<Unit>) -> Result<Self, SetupError> {
        let meta = meta::parse(&text.description).map_err(SetupError::Description)?;
        let unit = meta.unit.or(unit).ok_or(SetupError::Description(Problem::NoUnit))?;
        let (volume, exact_cam1_from_volume) = match meta.volume(unit).map_err(SetupError::Description)? {
            Some((volume, exact)) => (Some(volume), exact),
            None => (None, None),
        };
        let motion = meta.motion(unit).map_err(SetupError::Description)?;
        let size = meta.readout.image_size_px();
        let rig = calibration::parse_calibration(&text.calibration, unit).map_err(SetupError::Calibration)?;
        calibration::check_image_sizes(&rig, size, size).map_err(SetupError::Calibration)?;
        Ok(Self {
            name: meta.name.unwrap_or_default(),
            unit,
            image_size_px: size,
            readout: meta.readout,
            pixel_format: meta.pixel_format,
            steps: meta.steps,
            sequence: meta.sequence,
            second_direction: meta.second_direction,
            volume,
            exact_cam1_from_volume,
            motion,
            rig,
            text,
        })
    }

    /// Phase shifts of one cycle, rad.
    #[must_use]
    pub fn cycle_shifts_rad(&self) -> &[f64] {
        &self.sequence.shifts_rad[..self.steps.min(self.sequence.shifts_rad.len())]
    }

    /// So many phase images that what is known of the scene belongs to: the first, or where the object moves those about the
    /// moment of the truth.
    #[must_use]
    pub fn reference_images(&self, count: usize) -> Range<usize> {
        self.motion.as_ref().map_or(0..count, |motion| motion.reference_images(count))
    }

    /// Pixels of an image.
    #[must_use]
    pub fn image_pixels(&self) -> usize {
        self.image_size_px[0] * self.image_size_px[1]
    }
}

impl SetupError {
    /// The error about the files of a folder.
    pub(super) fn of_files(self, folder: &Path) -> DatasetError {
        match self {
            Self::Description(problem) => DatasetError::new(&folder.join(META_FILE), problem),
            Self::Calibration(problem) => CalibrationError { file: folder.join(CALIBRATION_FILE), problem }.into(),
        }
    }
}
