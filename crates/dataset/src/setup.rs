//! The setup of a measurement: rig, fringe pattern, phase shifts, measurement volume.
//!
//! A setup is read from the texts of two files, `meta.json` and `calibration.yml`. A recording contains the same texts,
//! so its setup is exactly the same, to the last bit of each number.

use std::ops::Range;
use std::path::Path;

use fringeflow::calibration::{self, CalibrationError, CalibrationProblem, Unit};
use fringeflow::geometry::{MeasurementVolume, Pose, Readout, Rig};
use fringeflow_base::grey::PixelFormat;
use fringeflow_pixels::DeviceImages;

use super::error::{DatasetError, Problem};
use super::motion::Motion;
use super::sequence::FringeSequence;
use super::{CALIBRATION_FILE, META_FILE, meta};

/// The texts of a setup.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SetupText {
    /// Content of `meta.json`.
    pub description: String,
    /// Content of `calibration.yml`.
    pub calibration: String,
}

/// A checked setup: rig, fringe pattern, measurement volume.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Name of the scene; empty if none is stated.
    pub name: String,
    /// Unit of the calibration file and the volume.
    pub unit: Unit,
    /// Width and height of all images, pixels.
    pub image_size_px: [usize; 2],
    /// Region and binning of the sensor behind the images.
    pub readout: Readout,
    /// Bit depth of all images, if it is stated.
    pub pixel_format: Option<PixelFormat>,
    /// Format and arrangement of the image files, if they are as the cameras sent them. Each view then has the size of
    /// the sensor.
    pub source: Option<DeviceImages>,
    /// Number of steps of a cycle. Moving scenes may have more images than that.
    pub steps: usize,
    /// Fringes along the projector columns.
    pub sequence: FringeSequence,
    /// Fringes along the projector rows, if there are any.
    pub second_direction: Option<FringeSequence>,
    /// Measurement volume, if one is stated.
    pub volume: Option<MeasurementVolume>,
    /// Pose of the volume in the frame of the ground truth, if it differs.
    pub exact_cam1_from_volume: Option<Pose>,
    /// Pose of the object in every phase image, if it moves.
    pub motion: Option<Motion>,
    /// The rig of `calibration.yml`.
    pub rig: Rig,
    /// The texts behind this setup.
    pub text: SetupText,
}

/// Why a setup is invalid.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// `meta.json` is invalid.
    #[error("{META_FILE}: {0}")]
    Description(#[source] Problem),
    /// The calibration is invalid.
    #[error("{CALIBRATION_FILE}: {0}")]
    Calibration(#[source] CalibrationProblem),
}

impl Setup {
    /// Reads and checks both texts. `unit` is used if the description states none.
    ///
    /// # Errors
    /// [`SetupError`] with file, field, value and remedy.
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
            source: meta.source,
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

    /// The setup of the same images after their conversion to grey, as a recording has them.
    ///
    /// # Errors
    /// The description is not valid.
    pub fn of_grey_images(&self) -> Result<Self, SetupError> {
        if self.source.is_none() {
            return Ok(self.clone());
        }
        let invalid = |e: serde_json::Error| SetupError::Description(Problem::Json(e.to_string()));
        let mut fields: serde_json::Map<_, _> = serde_json::from_str(&self.text.description).map_err(invalid)?;
        fields.remove("source");
        if let Some(format) = self.pixel_format.filter(|&format| format != PixelFormat::Grey) {
            fields.insert("bits".to_owned(), format.bits().into());
        }
        let description = serde_json::to_string_pretty(&fields).map_err(invalid)?;
        let grey = Self::parse(SetupText { description, ..self.text.clone() }, Some(self.unit))?;
        Ok(Self { name: self.name.clone(), ..grey })
    }

    /// Phase shifts of one cycle, rad.
    #[must_use]
    pub fn cycle_shifts_rad(&self) -> &[f64] {
        &self.sequence.shifts_rad[..self.steps.min(self.sequence.shifts_rad.len())]
    }

    /// The `count` phase images to compare with the ground truth: the first ones, or for a moving object those around
    /// the time of the ground truth.
    #[must_use]
    pub fn reference_images(&self, count: usize) -> Range<usize> {
        self.motion.as_ref().map_or(0..count, |motion| motion.reference_images(count))
    }

    /// Number of pixels of an image.
    #[must_use]
    pub fn image_pixels(&self) -> usize {
        self.image_size_px[0] * self.image_size_px[1]
    }
}

impl SetupError {
    /// Converts the error to one about the files of a folder.
    pub(super) fn in_folder(self, folder: &Path, calibration: &Path) -> DatasetError {
        match self {
            Self::Description(problem) => DatasetError::new(&folder.join(META_FILE), problem),
            Self::Calibration(problem) => CalibrationError { file: calibration.to_owned(), problem }.into(),
        }
    }
}
