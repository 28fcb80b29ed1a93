//! Uncertainty of a pose `b_from_a`.

use nalgebra::{Matrix3, Matrix6};

use fringeflow::geometry::{Point3, Pose, Vector3};

/// Covariance of the error of a pose `b_from_a`. The error is a small motion `x + t + ω × x` of frame b: first t
/// (metres), then ω (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCovariance(pub Matrix6<f64>);

impl PoseCovariance {
    /// Returns the covariance of an exact pose.
    #[must_use]
    pub fn zero() -> Self {
        Self(Matrix6::zeros())
    }

    /// Converts the covariance of a translation and a rotation about `centre`, in frame b.
    #[must_use]
    pub fn about(centre: &Point3, covariance: &Matrix6<f64>) -> Self {
        // t + ω × (x − c) = (t + c × ω) + ω × x.
        let mut origin_from_centre = Matrix6::identity();
        origin_from_centre.fixed_view_mut::<3, 3>(0, 3).copy_from(&centre.coords.cross_matrix());
        Self(origin_from_centre * covariance * origin_from_centre.transpose())
    }

    /// Returns the covariance of the same error in frame c. `c_from_b` is the pose of frame b.
    #[must_use]
    pub fn seen_from(&self, c_from_b: &Pose) -> Self {
        let rotation = *c_from_b.rotation.to_rotation_matrix().matrix();
        let mut adjoint = Matrix6::zeros();
        adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
        adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
        adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&(c_from_b.translation.vector.cross_matrix() * rotation));
        Self(adjoint * self.0 * adjoint.transpose())
    }

    /// Variance of the position of a point of frame b along a direction, m².
    #[must_use]
    pub fn variance_along(&self, point: &Point3, direction: &Vector3) -> f64 {
        let turn = point.coords.cross(direction);
        let row = [direction.x, direction.y, direction.z, turn.x, turn.y, turn.z];
        let column = |j: usize| (0..6).map(|i| self.0[(i, j)] * row[i]).sum::<f64>();
        (0..6).map(|j| column(j) * row[j]).sum::<f64>().max(0.0)
    }

    /// Standard deviation of the position of a point of frame b, all directions together, metres.
    #[must_use]
    pub fn sd_at(&self, point: &Point3) -> f64 {
        let axes: Matrix3<f64> = Matrix3::identity();
        let variance: f64 = axes.column_iter().map(|axis| self.variance_along(point, &axis.into_owned())).sum();
        variance.sqrt()
    }

    /// Standard deviation of the rotation, all axes together, rad.
    #[must_use]
    pub fn rotation_sd_rad(&self) -> f64 {
        (3..6).map(|i| self.0[(i, i)]).sum::<f64>().max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector6;

    use super::*;

    /// A rotation about a centre with 0.1 rad about each axis, and a translation with 0.01.
    fn about(centre: &Point3) -> PoseCovariance {
        let [t, w] = [1e-4, 1e-2];
        PoseCovariance::about(centre, &Matrix6::from_diagonal(&Vector6::new(t, t, t, w, w, w)))
    }

    #[test]
    fn the_centre_of_a_rotation_stays() {
        let centre = Point3::new(0.1, -0.2, 0.3);
        let covariance = about(&centre);
        assert!((covariance.sd_at(&centre) - 3e-4_f64.sqrt()).abs() < 1e-12);
        let beside = centre + Vector3::x();
        // Rotations about two axes each move a point beside the centre by 0.1.
        assert!((covariance.sd_at(&beside) - (3e-4 + 2e-2_f64).sqrt()).abs() < 1e-12);
        assert!((covariance.variance_along(&beside, &Vector3::x()) - 1e-4).abs() < 1e-12);
        assert!((covariance.rotation_sd_rad() - 0.03_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_error_is_the_same_in_another_frame() {
        let centre = Point3::new(0.1, -0.2, 0.3);
        let pose = Pose::new(Vector3::new(0.4, 0.1, -0.7), Vector3::new(0.3, 0.9, -0.2));
        let seen = about(&centre).seen_from(&pose);
        let (point, direction) = (Point3::new(0.3, 0.3, 0.1), Vector3::new(0.6, 0.0, 0.8));
        let expected = about(&centre).variance_along(&point, &direction);
        let found = seen.variance_along(&(pose * point), &(pose.rotation * direction));
        assert!((found - expected).abs() < 1e-12);
    }
}
