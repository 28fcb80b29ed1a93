//! Checks and conversion of a calibration (paper, section 2.1). In: the matrices of a file. Out: a rig in metres, or
//! the first problem found. Cost: the undistortion of one pixel in a thousand of three images.

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::geometry::{Camera, Distortion, EpipolarError, EpipolarFrame, Pixel, Pose, Rig, Vector3};

use super::file_storage::{Matrices, Matrix};
use super::{CalibrationProblem, Unit};

/// Largest deviation of R·Rᵀ from the identity; files carry 8 or more digits.
const ROTATION_TOLERANCE: f64 = 1e-5;
/// Largest plausible ratio of the two focal lengths of a camera or projector.
const MAX_FOCAL_RATIO: f64 = 4.0;
/// Plausible base lengths of a scanner, metres. Outside this range the unit is wrong.
const BASE_RANGE_M: std::ops::RangeInclusive<f64> = 1e-3..=20.0;
/// Spacing of the pixels at which the inverse of a distortion is tested.
const INVERSE_GRID_PX: usize = 32;

/// Names of the fields of a camera.
struct CameraFields {
    matrix: &'static str,
    distortion: &'static str,
    size: &'static str,
}

const CAM1: CameraFields = CameraFields { matrix: "K1", distortion: "D1", size: "size1" };
const CAM2: CameraFields = CameraFields { matrix: "K2", distortion: "D2", size: "size2" };
const PROJECTOR: CameraFields = CameraFields { matrix: "Kp", distortion: "Dp", size: "sizep" };

/// Builds the rig, in metres, from matrices in `unit`.
pub(super) fn rig(matrices: &Matrices, unit: Unit) -> Result<Rig, CalibrationProblem> {
    let rig = Rig {
        cam1: camera(matrices, &CAM1)?,
        cam2: camera(matrices, &CAM2)?,
        projector: camera(matrices, &PROJECTOR)?,
        cam2_from_cam1: pose(matrices, "R2", "T2", unit)?,
        projector_from_cam1: pose(matrices, "Rp", "Tp", unit)?,
    };
    check_base(&rig, unit)?;
    check_views(&rig)?;
    Ok(rig)
}

fn camera(matrices: &Matrices, fields: &CameraFields) -> Result<Camera, CalibrationProblem> {
    let size = image_size(matrices, fields.size)?;
    let k = shaped(matrices, fields.matrix, 3, 3, "3×3")?;
    check_camera_matrix(fields.matrix, k, size)?;
    let distortion = distortion(matrices, fields.distortion)?;
    let camera = Camera::new([k[0], k[4]], [k[2], k[5]], distortion, size).with_skew(k[1]);
    check_invertible(&camera, fields.distortion)?;
    Ok(camera)
}

fn check_camera_matrix(field: &'static str, k: &[f64], size: [usize; 2]) -> Result<(), CalibrationProblem> {
    let fail = |what: String| Err(CalibrationProblem::CameraMatrix { field, what });
    let (fx, fy) = (k[0], k[4]);
    if fx <= 0.0 || fy <= 0.0 {
        return fail(format!("focal lengths are {fx} and {fy} px; both must be positive"));
    }
    if fx / fy > MAX_FOCAL_RATIO || fy / fx > MAX_FOCAL_RATIO {
        return fail(format!("focal lengths {fx} and {fy} px differ by more than a factor of {MAX_FOCAL_RATIO}"));
    }
    let last_row_is_unit = k[6] == 0.0 && k[7] == 0.0 && k[8] == 1.0 && k[3] == 0.0;
    if !last_row_is_unit {
        return fail("a camera matrix has the form [fx s cx; 0 fy cy; 0 0 1]".to_owned());
    }
    // Projectors often have their principal point outside the image (lens shift), but by less than an image.
    for (axis, centre, extent) in [("cx", k[2], size[0] as f64), ("cy", k[5], size[1] as f64)] {
        if centre < -extent || centre > 2.0 * extent {
            return fail(format!("{axis} is {centre} px, more than an image away from an image of {extent} px"));
        }
    }
    Ok(())
}

fn distortion(matrices: &Matrices, field: &'static str) -> Result<Distortion, CalibrationProblem> {
    let matrix = finite(matrices, field)?;
    let is_vector = matrix.rows.min(matrix.cols) == 1 && matrix.rows * matrix.cols == matrix.values.len();
    if !is_vector || ![4, 5, 8, 12, 14].contains(&matrix.values.len()) {
        return Err(shape_error(field, matrix, "a vector of 4, 5, 8, 12 or 14 coefficients"));
    }
    if let [.., tau_x, tau_y] = matrix.values[..]
        && matrix.values.len() == 14
        && (tau_x != 0.0 || tau_y != 0.0)
    {
        return Err(CalibrationProblem::Tilt { field, tau_x, tau_y });
    }
    Ok(Distortion::from_opencv(&matrix.values))
}

fn check_invertible(camera: &Camera, field: &'static str) -> Result<(), CalibrationProblem> {
    for v in grid(camera.height_px()) {
        for u in grid(camera.width_px()) {
            let pixel = Pixel::new(u, v);
            let returns = camera.ray(&pixel).and_then(|ray| camera.project(&ray.into()));
            if returns.is_none_or(|back| (back - pixel).norm() > 1e-3) {
                return Err(CalibrationProblem::NotInvertible { field, u_px: u, v_px: v });
            }
        }
    }
    Ok(())
}

/// Grid points along one image axis, both ends included.
fn grid(extent_px: usize) -> impl Iterator<Item = f64> {
    let last = extent_px - 1;
    (0..last).step_by(INVERSE_GRID_PX).chain([last]).map(|i| i as f64)
}

fn pose(
    matrices: &Matrices,
    rotation: &'static str,
    translation: &'static str,
    unit: Unit,
) -> Result<Pose, CalibrationProblem> {
    let r = Matrix3::from_row_slice(shaped(matrices, rotation, 3, 3, "3×3")?);
    let deviation = (r * r.transpose() - Matrix3::identity()).amax();
    if deviation > ROTATION_TOLERANCE {
        let what = format!("R·Rᵀ differs from the identity by {deviation:.3e}; calibrate again or give more digits");
        return Err(CalibrationProblem::NotARotation { field: rotation, what });
    }
    if r.determinant() < 0.0 {
        let what = "its determinant is −1: it mirrors the scene".to_owned();
        return Err(CalibrationProblem::NotARotation { field: rotation, what });
    }
    let t = finite(matrices, translation)?;
    if t.values.len() != 3 || t.rows * t.cols != 3 {
        return Err(shape_error(translation, t, "3×1"));
    }
    let t = Vector3::from_column_slice(&t.values) * unit.in_metres();
    // Files hold rounded digits; the quaternion makes it a rotation to the last bit.
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(
        &r,
        1e-15,
        100,
        Rotation3::from_matrix_unchecked(r),
    ));
    Ok(Pose::from_parts(Translation3::from(t), rotation))
}

/// The base must have the length of a scanner.
fn check_base(rig: &Rig, unit: Unit) -> Result<(), CalibrationProblem> {
    let base_m = rig.cam2_from_cam1.translation.vector.norm();
    if !BASE_RANGE_M.contains(&base_m) {
        let what = format!(
            "cameras 1 and 2 are {base_m} m apart (unit {}); plausible are {} to {} m: check T2 and the unit",
            unit.symbol(),
            BASE_RANGE_M.start(),
            BASE_RANGE_M.end()
        );
        return Err(CalibrationProblem::Implausible { field: "T2", what });
    }
    Ok(())
}

/// The optical axes of both cameras and of the projector must be able to meet in front of the cameras.
///
/// Inverted transforms (x1 = R·x2 + T instead of x2 = R·x1 + T) turn the axes away from each other on a toed-in rig.
/// Completely swapped cameras make a valid rig. Matching finds out that the images do not fit it.
fn check_views(rig: &Rig) -> Result<(), CalibrationProblem> {
    EpipolarFrame::new(rig).map_err(|e| match e {
        EpipolarError::NoBase { .. } => CalibrationProblem::Implausible { field: "T2", what: e.to_string() },
        EpipolarError::LooksAlongBase { .. } => CalibrationProblem::Implausible { field: "R2", what: e.to_string() },
        EpipolarError::NotInvertible { u_px, v_px } => CalibrationProblem::NotInvertible { field: "D2", u_px, v_px },
    })?;
    for (field, pose) in [("R2", &rig.cam2_from_cam1), ("Rp", &rig.projector_from_cam1)] {
        if let Some(angle_deg) = diverging_axes_deg(pose) {
            let what = format!(
                "its optical axis points away from the axis of camera 1 by {angle_deg:.1}°, so they never see the same \
                 object; are the cameras swapped, or is the transform inverted? (x2 = R2·x1 + T2)"
            );
            return Err(CalibrationProblem::Implausible { field, what });
        }
    }
    Ok(())
}

/// Angle in degrees by which two optical axes diverge, if a wide lens cannot compensate it.
fn diverging_axes_deg(other_from_cam1: &Pose) -> Option<f64> {
    const TOLERATED_DEG: f64 = 8.0;
    let cam1_from_other = other_from_cam1.inverse();
    let centre = cam1_from_other.translation.vector;
    let axis = cam1_from_other.rotation * Vector3::z();
    let away = centre - Vector3::z() * centre.z;
    let away = away.try_normalize(1e-9)?;
    // Positive where the axis points away from C1's axis, towards the side of the other centre.
    let lean_deg = axis.dot(&away).atan2(axis.z).to_degrees();
    (lean_deg > TOLERATED_DEG).then_some(lean_deg)
}

fn image_size(matrices: &Matrices, field: &'static str) -> Result<[usize; 2], CalibrationProblem> {
    let matrix = finite(matrices, field)?;
    let &[width, height] = &matrix.values[..] else {
        return Err(shape_error(field, matrix, "1×2: width, height"));
    };
    let whole = |x: f64| x.fract() == 0.0 && (2.0..=65535.0).contains(&x);
    if !(whole(width) && whole(height)) {
        return Err(CalibrationProblem::Size { field, width, height });
    }
    Ok([width as usize, height as usize])
}

fn shaped<'m>(
    matrices: &'m Matrices,
    field: &'static str,
    rows: usize,
    cols: usize,
    expected: &'static str,
) -> Result<&'m [f64], CalibrationProblem> {
    let matrix = finite(matrices, field)?;
    if (matrix.rows, matrix.cols, matrix.values.len()) == (rows, cols, rows * cols) {
        Ok(&matrix.values)
    } else {
        Err(shape_error(field, matrix, expected))
    }
}

fn finite<'m>(matrices: &'m Matrices, field: &'static str) -> Result<&'m Matrix, CalibrationProblem> {
    let matrix = matrices.get(field).ok_or(CalibrationProblem::Missing { field })?;
    match matrix.values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(CalibrationProblem::NotFinite { field, index, value: matrix.values[index] }),
        None => Ok(matrix),
    }
}

fn shape_error(field: &'static str, matrix: &Matrix, expected: &'static str) -> CalibrationProblem {
    CalibrationProblem::Shape { field, rows: matrix.rows, cols: matrix.cols, values: matrix.values.len(), expected }
}
