//! Aligns two sets of points rigidly.
//!
//! In: pairs of points. Out: the pose with the smallest sum of squared distances (Kabsch 1976, by singular value
//! decomposition).

use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use fringeflow::geometry::{Point3, Pose, Vector3};

/// Returns the pose that maps the first points of the pairs to the second; the identity for fewer than three pairs.
pub(super) fn align(pairs: &[(Point3, Point3)]) -> Pose {
    if pairs.len() < 3 {
        return Pose::identity();
    }
    let count = pairs.len() as f64;
    let from_centre = pairs.iter().map(|(a, _)| a.coords).sum::<Vector3>() / count;
    let to_centre = pairs.iter().map(|(_, b)| b.coords).sum::<Vector3>() / count;
    let covariance: Matrix3<f64> =
        pairs.iter().map(|(a, b)| (b.coords - to_centre) * (a.coords - from_centre).transpose()).sum();
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Pose::identity() };
    // Without the sign, the result could mirror a flat set of points.
    let sign = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Pose::from_parts(Translation3::from(to_centre - rotation * from_centre), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_of_a_rigid_set_is_found() {
        let pose = Pose::new(Vector3::new(0.1, -0.3, 0.2), Vector3::new(0.4, -0.9, 0.3));
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.0, 2.0, 0.0], [0.3, 0.4, 1.5], [1.0, -1.0, 0.7]];
        let pairs: Vec<_> = points.map(|p| (Point3::from(p), pose * Point3::from(p))).to_vec();
        let found = align(&pairs);
        assert!((found.to_homogeneous() - pose.to_homogeneous()).amax() < 1e-12);
    }
}
