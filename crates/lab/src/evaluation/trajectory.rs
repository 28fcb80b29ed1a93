//! Evaluates tracked poses against the true poses.

use nalgebra::{Matrix6, Vector6};
use serde::Serialize;

use fringeflow::geometry::{Point3, Pose};

/// Distances of tracked poses from the true poses. Both are relative to the first pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrajectoryScores {
    /// Number of poses compared, without the first.
    pub poses: usize,
    /// Root mean square distance between the tracked and the true position of a point, metres.
    pub rms_m: f64,
    /// Largest such distance, metres.
    pub max_m: f64,
    /// This distance at the last pose, metres: the drift of a scan that returns to its start.
    pub last_m: f64,
    /// Root mean square of the rotation errors, rad.
    pub rms_rad: f64,
    /// Root mean square of the errors in units of the stated standard deviations: 1 if these are right, more if they
    /// are too small. `None` if a pose states none.
    pub rms_sd: Option<f64>,
}

/// A tracked pose with its stated covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedPose {
    /// Pose of camera 1 in its frame at the first cloud.
    pub first_from_cam1: Pose,
    /// Covariance of its error as a small motion `x + t + ω × x` of that frame: first t (metres), then ω (rad).
    pub covariance: Matrix6<f64>,
}

/// Compares poses `first_from_cam1` with true poses `anything_from_cam1`, at the point `place` of the first frame.
///
/// `cam1_from_exact` maps the exact frame of C1, to which the true poses refer, to its calibrated frame, to which the
/// tracked poses refer. They differ because a camera knows its frame only by calibration. Returns `None` for fewer than
/// two poses.
#[must_use]
pub fn against_trajectory(
    tracked: &[StatedPose],
    truth: &[Pose],
    cam1_from_exact: &Pose,
    place: &Point3,
) -> Option<TrajectoryScores> {
    let exact_from_cam1 = cam1_from_exact.inverse();
    let first = truth.first()?.inverse();
    let (mut squares, mut turns, mut max_m, mut last_m, mut poses) = (0.0, 0.0, 0.0_f64, 0.0, 0);
    let mut in_sd = Some(0.0);
    for (tracked, truth) in tracked.iter().zip(truth).skip(1) {
        let expected = cam1_from_exact * first * truth * exact_from_cam1;
        let seen = expected.inverse() * place;
        let pose = &tracked.first_from_cam1;
        let off_m = (pose * seen - place).norm();
        squares += off_m * off_m;
        turns += pose.rotation.angle_to(&expected.rotation).powi(2);
        in_sd = in_sd.zip(square_in_sd(tracked, &expected)).map(|(sum, square)| sum + square);
        max_m = max_m.max(off_m);
        last_m = off_m;
        poses += 1;
    }
    let mean = |sum: f64| (sum / poses as f64).sqrt();
    (poses > 0).then(|| TrajectoryScores {
        poses,
        rms_m: mean(squares),
        max_m,
        last_m,
        rms_rad: mean(turns),
        rms_sd: in_sd.map(mean),
    })
}

/// Mean square of the six components of an error in units of the standard deviation; `None` if no covariance is stated.
fn square_in_sd(tracked: &StatedPose, expected: &Pose) -> Option<f64> {
    let error = tracked.first_from_cam1 * expected.inverse();
    let (shift, turn) = (error.translation.vector, error.rotation.scaled_axis());
    let error = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
    Some(error.dot(&tracked.covariance.cholesky()?.solve(&error)) / 6.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::geometry::Vector3;

    #[test]
    fn only_errors_count() {
        let pose = |x: f64, turn: f64| Pose::new(Vector3::new(x, 0.1, 0.0), Vector3::new(0.0, turn, 0.0));
        let world = [pose(0.2, 0.5), pose(0.3, 0.6), pose(0.5, 0.4)];
        let cam1_from_exact = Pose::new(Vector3::new(0.0, 1e-3, 0.0), Vector3::new(2e-3, 0.0, 0.0));
        let right = world.map(|p| cam1_from_exact * world[0].inverse() * p * cam1_from_exact.inverse());
        let place = Point3::new(0.0, 0.0, 0.3);
        let sd_m = 1e-4;
        let stated = |pose: &Pose| StatedPose { first_from_cam1: *pose, covariance: Matrix6::identity() * sd_m * sd_m };
        let scores = |tracked: &[Pose]| {
            against_trajectory(&tracked.iter().map(stated).collect::<Vec<_>>(), &world, &cam1_from_exact, &place)
        };
        let exact = scores(&right).unwrap();
        assert!(exact.poses == 2 && exact.max_m < 1e-12 && exact.rms_rad < 1e-7, "{exact:?}");
        let shift = Pose::translation(3e-4, 0.0, 4e-4);
        let off = scores(&[right[0], right[1], shift * right[2]]).unwrap();
        // Errors of 3 and 4 standard deviations at one of two poses, none in the other ten components.
        assert!((off.rms_sd.unwrap() - (25.0_f64 / 12.0).sqrt()).abs() < 1e-6 && off.last_m == off.max_m, "{off:?}");
        assert!((off.max_m - 5e-4).abs() < 1e-9 && (off.rms_m - 5e-4 / 2.0_f64.sqrt()).abs() < 1e-9, "{off:?}");
        assert!(scores(&right[..1]).is_none());
    }
}
