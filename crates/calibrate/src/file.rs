//! The calibration file with what is known of its accuracy.

use std::path::Path;

use fringeflow::calibration::{
    CalibrationError, Cameras, Unit, calibration_text, cameras_text, push_matrix, read_square,
};
use fringeflow::geometry::Rig;
use nalgebra::DMatrix;

use crate::findings::Finding;
use crate::refinement::parameter_names;

/// Unit of the lengths in the file.
const UNIT: Unit = Unit::Millimetre;

/// Returns the text of a calibration file.
///
/// Beside the fields of every calibration it holds `covariance` of `parameters` (pixels, radians, metres), and `flaws` with
/// the findings for which it would be refused. OpenCV reads them all.
#[must_use]
pub fn file_text(rig: &Rig, covariance: &DMatrix<f64>, flaws: &[&Finding]) -> String {
    let mut out = calibration_text(rig, UNIT);
    push_accuracy(&mut out, &parameter_names(3), covariance, flaws);
    out
}

/// Returns the text of a file of both cameras, as [`file_text`].
#[must_use]
pub fn cameras_file_text(cameras: &Cameras, covariance: &DMatrix<f64>, flaws: &[&Finding]) -> String {
    let mut out = cameras_text(cameras, UNIT);
    push_accuracy(&mut out, &parameter_names(2), covariance, flaws);
    out
}

/// Reads the covariance of a file of both cameras; `None` if it has none.
///
/// # Errors
/// The field has another size.
pub fn read_cameras_covariance(path: &Path) -> Result<Option<DMatrix<f64>>, CalibrationError> {
    let count = parameter_names(2).len();
    let square = read_square(path, COVARIANCE)?;
    Ok(square.filter(|(side, _)| *side == count).map(|(_, values)| DMatrix::from_row_slice(count, count, &values)))
}

/// Name of the field with the covariance.
const COVARIANCE: &str = "covariance";

/// Appends the covariance of the first parameters, their names, and the flaws.
fn push_accuracy(out: &mut String, names: &[String], covariance: &DMatrix<f64>, flaws: &[&Finding]) {
    let count = names.len();
    push_matrix(out, COVARIANCE, count, count, covariance.view((0, 0), (count, count)).transpose().as_slice());
    push_texts(out, "parameters", names);
    if !flaws.is_empty() {
        push_texts(out, "flaws", &flaws.iter().map(|flaw| flaw.text.clone()).collect::<Vec<_>>());
    }
}

fn push_texts(out: &mut String, name: &str, texts: &[String]) {
    *out += &format!("{name}:\n");
    for text in texts {
        *out += &format!("   - \"{}\"\n", text.replace(['"', '\\'], "'"));
    }
}
