//! Calibration files: OpenCV FileStorage (YAML, XML or JSON) to a checked [`Rig`] (paper, section 2.1).
//!
//! In: a file with `K1 D1 size1 K2 D2 size2 Kp Dp sizep R2 T2 Rp Tp` and the unit of its lengths. Out: a [`Rig`] in
//! metres whose every number was checked, or an error that names file, field, value and remedy. Cost: once per rig;
//! most of it is undistorting a grid of pixels.

mod check;
mod file_storage;
mod mistakes;
mod other_origin;
mod unit;
mod write;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use fringeflow_base::text_file::{TextError, read_text};

use crate::geometry::{Camera, Pose, Rig};

pub use mistakes::{LikelyMistake, Mistake, likely_mistake};
pub use unit::{Unit, UnknownUnit};
pub use write::{calibration_text, cameras_text, push_matrix, write_calibration};

/// Why a calibration was refused.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", file.display())]
pub struct CalibrationError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    #[source]
    pub problem: CalibrationProblem,
}

/// Both cameras of a rig whose projector is not calibrated yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cameras {
    /// Camera 1.
    pub cam1: Camera,
    /// Camera 2.
    pub cam2: Camera,
    /// `x_cam2 = R2 · x_cam1 + T2`, metres.
    pub cam2_from_cam1: Pose,
}

/// What is wrong with a calibration file.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationProblem {
    /// The file cannot be read, or is not text.
    #[error(transparent)]
    Text(#[from] TextError),
    /// It is not a FileStorage file.
    #[error("is not a file of OpenCV's FileStorage (YAML, XML or JSON): {0}")]
    NotFileStorage(String),
    /// A field is absent.
    #[error("field {field} is missing; a calibration has K1 D1 size1 K2 D2 size2 Kp Dp sizep R2 T2 Rp Tp{hint}")]
    Missing {
        /// Name of the field.
        field: &'static str,
        /// What the file holds instead, and what to do.
        hint: String,
    },
    /// A field holds another kind of value.
    #[error("field {field} is {found}; expected {expected}")]
    Kind {
        /// Name of the field.
        field: &'static str,
        /// What it is.
        found: String,
        /// Expected kind and shape.
        expected: &'static str,
    },
    /// The file states a camera model that is not supported.
    #[error("states the camera model {model}, which is not supported: calibrate with the pinhole model")]
    OtherModel {
        /// The field and its value.
        model: String,
    },
    /// A matrix has the wrong shape.
    #[error("field {field} is {rows}×{cols} with {values} values; expected {expected}")]
    Shape {
        /// Name of the field.
        field: &'static str,
        /// Rows stated.
        rows: usize,
        /// Columns stated.
        cols: usize,
        /// Values present.
        values: usize,
        /// Expected shape.
        expected: &'static str,
    },
    /// A value is NaN or infinite.
    #[error("field {field}, value {index}, is {value}; every value must be a finite number")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// Index of the value, row by row from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A camera matrix is invalid.
    #[error("field {field}: {what}")]
    CameraMatrix {
        /// Name of the field.
        field: &'static str,
        /// What is wrong, with the value.
        what: String,
    },
    /// An image size is not two positive whole numbers.
    #[error("field {field} is {width} × {height}; an image size is two whole numbers from 2 to 65535")]
    Size {
        /// Name of the field.
        field: &'static str,
        /// Width found.
        width: f64,
        /// Height found.
        height: f64,
    },
    /// The distortion has a tilted sensor.
    #[error(
        "field {field} has a tilted sensor (τx = {tau_x}, τy = {tau_y}); this model is not supported: \
         calibrate without CALIB_TILTED_MODEL"
    )]
    Tilt {
        /// Name of the field.
        field: &'static str,
        /// Tilt about x, rad.
        tau_x: f64,
        /// Tilt about y, rad.
        tau_y: f64,
    },
    /// The tangential distortion is larger than that of any lens.
    #[error(
        "field {field}: the tangential coefficients are p1 = {p1} and p2 = {p2}, beyond those of any lens; the order is \
         k1 k2 p1 p2 k3; are these the coefficients of a fisheye model (k1 k2 k3 k4), or in another order?"
    )]
    Tangential {
        /// Name of the field.
        field: &'static str,
        /// Third coefficient.
        p1: f64,
        /// Fourth coefficient.
        p2: f64,
    },
    /// The distortion folds over inside the image.
    #[error(
        "field {field}: the distortion has no inverse at pixel ({u_px}, {v_px}) of the image; \
         recalibrate with fewer coefficients or points nearer to the border"
    )]
    NotInvertible {
        /// Name of the field.
        field: &'static str,
        /// Column, pixels.
        u_px: f64,
        /// Row, pixels.
        v_px: f64,
    },
    /// A rotation matrix is invalid.
    #[error("field {field} is not a rotation: {what}")]
    NotARotation {
        /// Name of the field.
        field: &'static str,
        /// What is wrong, with the value.
        what: String,
    },
    /// The size of an image differs from the calibration's.
    #[error(
        "field {field} is {} × {}, but the images of camera {camera} are {} × {}; {}",
        calibrated_px[0], calibrated_px[1], image_px[0], image_px[1], size_remedy(*calibrated_px, *image_px)
    )]
    OtherImageSize {
        /// Name of the field.
        field: &'static str,
        /// 1 or 2.
        camera: u8,
        /// Width and height in the calibration.
        calibrated_px: [usize; 2],
        /// Width and height of the images.
        image_px: [usize; 2],
    },
    /// The arrangement of the rig cannot be right.
    #[error("field {field}: {what}")]
    Implausible {
        /// Name of the field.
        field: &'static str,
        /// What is wrong, with the value and the remedy.
        what: String,
    },
}

/// What to do about a calibration for images of another size.
fn size_remedy(calibrated_px: [usize; 2], [width, height]: [usize; 2]) -> &'static str {
    if calibrated_px == [height, width] {
        "the width comes first, unless the images are turned"
    } else {
        "use the calibration of these images"
    }
}

/// Reads a calibration file and makes all checks that need no images.
///
/// `unit` is the unit of `T2` and `Tp`.
///
/// # Errors
/// [`CalibrationError`], which names file, field and value.
pub fn read_calibration(path: &Path, unit: Unit) -> Result<Rig, CalibrationError> {
    let parsed = parse_calibration(&read_calibration_text(path)?, unit);
    parsed.map_err(|problem| CalibrationError { file: path.to_owned(), problem })
}

/// Reads both cameras of a calibration file, whether or not it holds a projector. `unit` is the unit of `T2`.
///
/// # Errors
/// [`CalibrationError`], as [`read_calibration`].
pub fn read_cameras(path: &Path, unit: Unit) -> Result<Cameras, CalibrationError> {
    let text = read_calibration_text(path)?;
    let cameras = file_storage::parse(&text).and_then(|fields| check::cameras(&fields, unit));
    cameras.map_err(|problem| CalibrationError { file: path.to_owned(), problem })
}

/// Reads a square matrix that a calibration file may hold beside its calibration, row by row, such as the covariance of its
/// parameters; `None` if the file has no such field.
///
/// # Errors
/// [`CalibrationError`]: the file cannot be read, or the field is no square matrix of finite numbers.
pub fn read_square(path: &Path, field: &'static str) -> Result<Option<(usize, Vec<f64>)>, CalibrationError> {
    let text = read_calibration_text(path)?;
    let square = file_storage::parse(&text).and_then(|fields| check::optional_square(&fields, field));
    square.map_err(|problem| CalibrationError { file: path.to_owned(), problem })
}

/// Reads the text of a calibration file without checking it.
///
/// # Errors
/// [`CalibrationProblem::Text`].
pub fn read_calibration_text(path: &Path) -> Result<String, CalibrationError> {
    let text = read_text(path).map_err(CalibrationProblem::from);
    text.map_err(|problem| CalibrationError { file: path.to_owned(), problem })
}

/// [`read_calibration`] from text in memory.
///
/// # Errors
/// [`CalibrationProblem`], which names field and value.
pub fn parse_calibration(text: &str, unit: Unit) -> Result<Rig, CalibrationProblem> {
    let fields = file_storage::parse(text)?;
    if let Some(model) = other_origin::other_model(&fields) {
        return Err(CalibrationProblem::OtherModel { model });
    }
    check::rig(&fields, unit)
}

/// Checks that images (width and height, pixels) have the size that the rig was calibrated for.
///
/// # Errors
/// [`CalibrationProblem::OtherImageSize`].
pub fn check_image_sizes(rig: &Rig, cam1_px: [usize; 2], cam2_px: [usize; 2]) -> Result<(), CalibrationProblem> {
    for (camera, field, calibrated, image_px) in [(1, "size1", &rig.cam1, cam1_px), (2, "size2", &rig.cam2, cam2_px)] {
        let calibrated_px = [calibrated.width_px(), calibrated.height_px()];
        if calibrated_px != image_px {
            return Err(CalibrationProblem::OtherImageSize { field, camera, calibrated_px, image_px });
        }
    }
    Ok(())
}
