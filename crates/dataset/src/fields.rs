//! Fields of `meta.json` that several objects share.

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use fringeflow::geometry::{Pose, Vector3};

use super::error::Problem;

/// A pose in a file: rows of the rotation, and the translation in units of `scale` metres.
pub(super) fn raw_pose(pose: &Pose, scale: f64) -> ([[f64; 3]; 3], [f64; 3]) {
    let rotation = pose.rotation.to_rotation_matrix();
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| rotation[(i, j)]));
    (rows, (pose.translation.vector / scale).into())
}

/// Returns the pose for a rotation and a translation in units of `scale` metres, or what is wrong with the rotation.
pub(super) fn rigid_pose(r: &[[f64; 3]; 3], t: &[f64; 3], scale: f64) -> Result<Pose, String> {
    let matrix = Matrix3::from_fn(|i, j| r[i][j]);
    let deviation = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    if deviation.is_nan() || deviation > 1e-5 || matrix.determinant() < 0.0 {
        return Err(format!("is not a rotation (R·Rᵀ differs from the identity by {deviation:.3e})"));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    Ok(Pose::from_parts(Translation3::from(Vector3::from(*t) * scale), rotation))
}

pub(super) fn field_problem(field: &'static str, what: String) -> Problem {
    Problem::Field { field, what }
}
