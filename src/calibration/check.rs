//! Checks and conversion of a calibration (paper, section 2.1). In: the matrices of a file. Out: a rig in metres, or
//! the first problem found. Cost: the undistortion of one pixel in a thousand of three images.

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::geometry::{Camera, Distortion, EpipolarError, EpipolarFrame, Pixel, Pose, Rig, Vector3};

use super::file_storage::{Fields, Matrix};
use super::{CalibrationProblem, Cameras, Mistake, Unit, other_origin};

/// Largest deviation of R·Rᵀ from the identity; files carry 8 or more digits.
const ROTATION_TOLERANCE: f64 = 1e-5;
/// Largest plausible ratio of the two focal lengths of a camera or projector.
const MAX_FOCAL_RATIO: f64 = 4.0;
/// Smallest plausible focal length, a share of the extent of the image: a field of view of 127°.
const MIN_FOCAL_SHARE: f64 = 0.25;
/// Largest plausible tangential coefficient: twenty times that of a camera lens. At the edge of an image as wide as its
/// focal length it displaces points by 4 % of the width.
const MAX_TANGENTIAL: f64 = 0.05;
/// Plausible base lengths of a scanner, metres. Outside this range the unit is wrong.
const BASE_RANGE_M: std::ops::RangeInclusive<f64> = 1e-3..=20.0;
/// Largest plausible ratio of the bases of camera 2 and of the projector. Outside of it their units differ.
const MAX_BASE_RATIO: f64 = 50.0;
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

/// Builds both cameras, in metres, from matrices in `unit`.
pub(super) fn cameras(fields: &Fields, unit: Unit) -> Result<Cameras, CalibrationProblem> {
    let cameras = Cameras {
        cam1: camera(fields, &CAM1)?,
        cam2: camera(fields, &CAM2)?,
        cam2_from_cam1: pose(fields, "R2", "T2", unit)?,
    };
    check_base(&cameras, unit)?;
    Ok(cameras)
}

/// Builds the rig, in metres, from matrices in `unit`.
pub(super) fn rig(fields: &Fields, unit: Unit) -> Result<Rig, CalibrationProblem> {
    let Cameras { cam1, cam2, cam2_from_cam1 } = cameras(fields, unit)?;
    let projector = camera(fields, &PROJECTOR)?;
    let projector_from_cam1 = pose(fields, "Rp", "Tp", unit)?;
    let rig = Rig { cam1, cam2, projector, cam2_from_cam1, projector_from_cam1 };
    check_projector_base(&rig)?;
    check_views(&rig)?;
    Ok(rig)
}

fn camera(fields: &Fields, names: &CameraFields) -> Result<Camera, CalibrationProblem> {
    let size = image_size(fields, names.size)?;
    let k = square(fields, names.matrix)?;
    check_camera_matrix(names.matrix, &k, size)?;
    let distortion = distortion(fields, names.distortion)?;
    let camera = Camera::new([k[0], k[4]], [k[2], k[5]], distortion, size).with_skew(k[1]);
    check_invertible(&camera, names.distortion)?;
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
    for (axis, focal, extent) in [("fx", fx, size[0] as f64), ("fy", fy, size[1] as f64)] {
        if focal < MIN_FOCAL_SHARE * extent {
            let view_deg = 2.0 * (0.5 * extent / focal).atan().to_degrees();
            return fail(format!(
                "{axis} is {focal} px; for an image of {extent} px that is a field of view of {view_deg:.0}°; if it is in \
                 millimetres, divide it by the pixel pitch in millimetres"
            ));
        }
    }
    if k[2] == 0.0 && k[5] == 0.0 && k[6] != 0.0 && k[7] != 0.0 {
        return fail("cx and cy stand in the last row: it is transposed, as MATLAB stores it; transpose it".to_owned());
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

fn distortion(fields: &Fields, field: &'static str) -> Result<Distortion, CalibrationProblem> {
    let expected = "a vector of 4, 5, 8, 12 or 14 coefficients";
    let matrix = matrix(fields, field, expected)?;
    let is_vector = matrix.rows.min(matrix.cols) == 1 && matrix.rows * matrix.cols == matrix.values.len();
    if !is_vector || ![4, 5, 8, 12, 14].contains(&matrix.values.len()) {
        return Err(shape_error(field, &matrix, expected));
    }
    if let [.., tau_x, tau_y] = matrix.values[..]
        && matrix.values.len() == 14
        && (tau_x != 0.0 || tau_y != 0.0)
    {
        return Err(CalibrationProblem::Tilt { field, tau_x, tau_y });
    }
    if let [_, _, p1, p2, ..] = matrix.values[..]
        && p1.abs().max(p2.abs()) > MAX_TANGENTIAL
    {
        return Err(CalibrationProblem::Tangential { field, p1, p2 });
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
    fields: &Fields,
    rotation: &'static str,
    translation: &'static str,
    unit: Unit,
) -> Result<Pose, CalibrationProblem> {
    let r = Matrix3::from_row_slice(&square(fields, rotation)?);
    let deviation = (r * r.transpose() - Matrix3::identity()).amax();
    if deviation > ROTATION_TOLERANCE {
        let what = format!("R·Rᵀ differs from the identity by {deviation:.3e}; calibrate again or give more digits");
        return Err(CalibrationProblem::NotARotation { field: rotation, what });
    }
    if r.determinant() < 0.0 {
        let what = "its determinant is −1: it mirrors the scene".to_owned();
        return Err(CalibrationProblem::NotARotation { field: rotation, what });
    }
    let t = matrix(fields, translation, "3×1")?;
    if t.values.len() != 3 || t.rows * t.cols != 3 {
        return Err(shape_error(translation, &t, "3×1"));
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
fn check_base(cameras: &Cameras, unit: Unit) -> Result<(), CalibrationProblem> {
    let base_m = cameras.cam2_from_cam1.translation.vector.norm();
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

/// The projector must lie about as far from camera 1 as camera 2 does.
fn check_projector_base(rig: &Rig) -> Result<(), CalibrationProblem> {
    let bases_m =
        |rig: &Rig| [&rig.cam2_from_cam1, &rig.projector_from_cam1].map(|pose| pose.translation.vector.norm());
    let is_plausible =
        |[cam2_m, projector_m]: [f64; 2]| (1.0 / MAX_BASE_RATIO..=MAX_BASE_RATIO).contains(&(projector_m / cam2_m));
    let [cam2_m, projector_m] = bases_m(rig);
    if is_plausible([cam2_m, projector_m]) {
        return Ok(());
    }
    let units = [1e3, 1e-3].map(Mistake::ProjectorUnit);
    let unit = units.into_iter().find(|unit| is_plausible(bases_m(&unit.corrected(rig))));
    let why = unit.map_or_else(|| "check Tp".to_owned(), |unit| unit.to_string());
    let (cam2_mm, projector_mm) = (cam2_m * 1e3, projector_m * 1e3);
    let what = format!("the projector lies {projector_mm:.2} mm from camera 1, and camera 2 {cam2_mm:.2} mm; {why}");
    Err(CalibrationProblem::Implausible { field: "Tp", what })
}

/// The optical axes of both cameras and of the projector must be able to meet in front of the cameras.
///
/// A transposed R, or a T of the other sign, turns the axes away from each other on a toed-in rig. Completely inverted
/// transforms and swapped cameras make a valid rig. The measurement volume or the images find out that it is wrong.
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
                 object; is R transposed (MATLAB stores it so), or has T the other sign? (x2 = R2·x1 + T2, xp = Rp·x1 + \
                 Tp)"
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

fn image_size(fields: &Fields, field: &'static str) -> Result<[usize; 2], CalibrationProblem> {
    let matrix = matrix(fields, field, "1×2: width, height")?;
    let &[width, height] = &matrix.values[..] else {
        return Err(shape_error(field, &matrix, "1×2: width, height"));
    };
    let whole = |x: f64| x.fract() == 0.0 && (2.0..=65535.0).contains(&x);
    if !(whole(width) && whole(height)) {
        return Err(CalibrationProblem::Size { field, width, height });
    }
    Ok([width as usize, height as usize])
}

/// The values of a 3×3 matrix, row by row. A sequence of nine numbers is one too.
fn square(fields: &Fields, field: &'static str) -> Result<Vec<f64>, CalibrationProblem> {
    let matrix = matrix(fields, field, "a 3×3 matrix")?;
    match (matrix.rows, matrix.cols, matrix.values.len()) {
        (3, 3, 9) | (9, 1, 9) => Ok(matrix.values),
        (3, 1, 3) | (1, 3, 3) => Err(shape_error(
            field,
            &matrix,
            "3×3; if it is a rotation vector, as cv::calibrateCamera returns it, convert it with cv::Rodrigues",
        )),
        _ => Err(shape_error(field, &matrix, "3×3")),
    }
}

/// A square matrix of any size, row by row; `None` without the field.
pub(super) fn optional_square(
    fields: &Fields,
    field: &'static str,
) -> Result<Option<(usize, Vec<f64>)>, CalibrationProblem> {
    if !fields.contains_key(field) {
        return Ok(None);
    }
    let matrix = matrix(fields, field, "a square matrix")?;
    if matrix.rows != matrix.cols || matrix.values.len() != matrix.rows * matrix.cols {
        return Err(shape_error(field, &matrix, "a square matrix"));
    }
    Ok(Some((matrix.rows, matrix.values)))
}

/// The matrix of a field, all its values finite.
fn matrix(fields: &Fields, field: &'static str, expected: &'static str) -> Result<Matrix, CalibrationProblem> {
    let node =
        fields.get(field).ok_or_else(|| CalibrationProblem::Missing { field, hint: other_origin::hint(fields) })?;
    let matrix = node.matrix().ok_or_else(|| CalibrationProblem::Kind { field, found: node.kind(), expected })?;
    match matrix.values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(CalibrationProblem::NotFinite { field, index, value: matrix.values[index] }),
        None => Ok(matrix),
    }
}

fn shape_error(field: &'static str, matrix: &Matrix, expected: &'static str) -> CalibrationProblem {
    CalibrationProblem::Shape { field, rows: matrix.rows, cols: matrix.cols, values: matrix.values.len(), expected }
}
