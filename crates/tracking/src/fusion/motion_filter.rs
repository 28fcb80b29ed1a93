//! Estimates the motion of the scanner from the poses so far.
//!
//! In: poses of C1 with their covariances and times. Out: the motion at the last pose. The difference of two poses
//! gives the motion if both poses are accurate and enough time lies between them. In a direction that the surface
//! hardly determines, or after only 10 ms, the difference is noise. So a Kalman filter (Kalman 1960, "A new approach to
//! linear filtering and prediction problems") weighs each pose, direction by direction, against a model of hand motion:
//! constant speed with random accelerations.

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use fringeflow::geometry::{Pose, Vector3};
use fringeflow::prior::RigidMotion;

use crate::registration::PoseCovariance;

type Matrix12 = SMatrix<f64, 12, 12>;
type Vector12 = SVector<f64, 12>;

/// Speed of a scanner before anything is known: standard deviations for each axis, m/s and rad/s.
const INITIAL_SPEED_SD: [f64; 2] = [0.1, 0.5];
/// Random accelerations: growth of the variance of the speed per second, m²/s³ and rad²/s³. A hand changes the speed of
/// a scanner by about 0.2 m/s² in a tenth of a second.
const ACCELERATION_VARIANCES: [f64; 2] = [2e-3, 2e-2];
/// Pose errors that the covariance of a registration does not contain, such as errors that move with the fringes
/// because of motion. They are the same in all clouds and hold the surface back. They are modelled by minimum standard
/// deviations of translation and rotation, metres and rad, and a factor for the variances.
const MIN_POSE_SD: [f64; 2] = [1e-5, 3e-5];
const COMMON_ERROR_FACTOR: f64 = 9.0;

/// The motion of a tracked scanner.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionFilter {
    pose: Pose,
    /// Velocity and angular rate in the frame of C1.
    twist: Vector6<f64>,
    /// Covariance of a small motion in the frame of C1, then of the twist.
    covariance: Matrix12,
    poses: u32,
}

impl MotionFilter {
    /// Creates the filter at the first pose.
    pub(super) fn new(pose: Pose, covariance: &PoseCovariance) -> Self {
        let mut joint = Matrix12::zeros();
        joint.fixed_view_mut::<6, 6>(0, 0).copy_from(&in_own_frame(&pose, covariance));
        joint.fixed_view_mut::<6, 6>(6, 6).copy_from(&diagonal(INITIAL_SPEED_SD.map(|sd| sd * sd)));
        Self { pose, twist: Vector6::zeros(), covariance: joint, poses: 1 }
    }

    /// Returns the motion at the last pose, or `None` after a single pose.
    pub(super) fn motion(&self) -> Option<RigidMotion> {
        let part = |from: usize| Vector3::new(self.twist[from], self.twist[from + 1], self.twist[from + 2]);
        let motion = RigidMotion { velocity_m_s: part(0), rate_rad_s: part(3) };
        (self.poses > 1 && motion.is_finite()).then_some(motion)
    }

    /// The last pose as all poses together tell it. Along a direction that its surface leaves open, it is the predicted
    /// one.
    pub(super) fn pose(&self) -> Pose {
        self.pose
    }

    /// Adds the pose found `seconds` after the last one, with its covariance in the reference frame of the pose. A pose
    /// that is not finite only advances the prediction.
    pub(super) fn update(&mut self, pose: &Pose, covariance: &PoseCovariance, seconds: f64) {
        self.predict(seconds);
        let found = self.pose.inverse() * pose;
        let off = Vector6::from_iterator(found.translation.vector.iter().chain(&found.rotation.scaled_axis()).copied());
        let predicted = self.covariance.fixed_view::<6, 6>(0, 0).into_owned();
        let Some(inverse) = (predicted + in_own_frame(pose, covariance)).try_inverse() else { return };
        let gain = self.covariance.fixed_columns::<6>(0) * inverse;
        let change: Vector12 = gain * off;
        if !gain.iter().chain(&change).all(|value| value.is_finite()) {
            return;
        }
        let part = |from: usize| Vector3::new(change[from], change[from + 1], change[from + 2]);
        self.pose *= Pose::new(part(0), part(3));
        self.pose.rotation.renormalize();
        self.twist += change.fixed_rows::<6>(6);
        let rest = self.covariance - gain * self.covariance.fixed_rows::<6>(0);
        self.covariance = (rest + rest.transpose()) / 2.0;
        self.poses += 1;
    }

    /// Advances the state by `seconds`, at constant speed with random accelerations.
    fn predict(&mut self, seconds: f64) {
        let step = self.twist * seconds;
        self.pose *= Pose::new(Vector3::new(step[0], step[1], step[2]), Vector3::new(step[3], step[4], step[5]));
        let mut transition = Matrix12::identity();
        transition.fixed_view_mut::<6, 6>(0, 6).fill_diagonal(seconds);
        let mut process = Matrix12::zeros();
        let accelerations = diagonal(ACCELERATION_VARIANCES);
        for (i, j, factor) in [(0, 0, seconds.powi(3) / 3.0), (0, 6, seconds.powi(2) / 2.0), (6, 6, seconds)] {
            process.fixed_view_mut::<6, 6>(i, j).copy_from(&(accelerations * factor));
            process.fixed_view_mut::<6, 6>(j, i).copy_from(&(accelerations * factor));
        }
        self.covariance = transition * self.covariance * transition.transpose() + process;
    }
}

/// Returns a diagonal matrix with one value for the axes of translation and one for the axes of rotation.
fn diagonal([shift, turn]: [f64; 2]) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(shift, shift, shift, turn, turn, turn))
}

/// Returns the covariance of a pose in its own frame, with the errors that registration does not see.
fn in_own_frame(pose: &Pose, covariance: &PoseCovariance) -> Matrix6<f64> {
    covariance.seen_from(&pose.inverse()).0 * COMMON_ERROR_FACTOR + diagonal(MIN_POSE_SD.map(|sd| sd * sd))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.01;
    /// Errors of the poses, metres and rad.
    const POSE_SD: [f64; 2] = [2e-5, 6e-5];

    /// Pseudorandom numbers between -1 and 1.
    fn noise(seed: &mut u32) -> f64 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(*seed >> 8) / f64::from(1u32 << 23) - 1.0
    }

    fn noisy(pose: &Pose, seed: &mut u32) -> Pose {
        let mut three = |sd: f64| Vector3::from_fn(|_, _| sd * noise(seed));
        pose * Pose::new(three(POSE_SD[0]), three(POSE_SD[1]))
    }

    fn covariance() -> PoseCovariance {
        PoseCovariance(diagonal(POSE_SD.map(|sd| sd * sd / 3.0)))
    }

    /// Errors of the velocity after each pose, by the filter and by the difference of two poses, m/s.
    fn errors(speed_m_s: impl Fn(usize) -> f64, poses: usize) -> Vec<[f64; 2]> {
        let mut seed = 7;
        let mut true_pose = Pose::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.3, 0.1, -0.2));
        let mut before = noisy(&true_pose, &mut seed);
        // The covariance is in the frame that the poses refer to.
        let in_frame = |pose: &Pose| covariance().seen_from(pose);
        let mut filter = MotionFilter::new(before, &in_frame(&before));
        assert_eq!(filter.motion(), None);
        let errors_of = |number| {
            let velocity_m_s = Vector3::new(speed_m_s(number), 0.0, -0.5 * speed_m_s(number));
            true_pose *= Pose::new(velocity_m_s * PERIOD_S, Vector3::new(0.0, 0.2, 0.0) * PERIOD_S);
            let found = noisy(&true_pose, &mut seed);
            filter.update(&found, &in_frame(&found), PERIOD_S);
            let difference_m_s = (before.inverse() * found).translation.vector / PERIOD_S;
            before = found;
            [filter.motion().unwrap().velocity_m_s, difference_m_s].map(|found| (found - velocity_m_s).norm())
        };
        (1..=poses).map(errors_of).collect()
    }

    #[test]
    fn a_constant_motion_is_known_better_than_from_two_poses() {
        let errors = errors(|_| 0.05, 40);
        let rms = |which: usize| {
            let squares: f64 = errors[10..].iter().map(|error| error[which].powi(2)).sum();
            (squares / 30.0).sqrt()
        };
        assert!(rms(0) < 0.6 * rms(1), "{:e} and {:e} m/s", rms(0), rms(1));
    }

    #[test]
    fn a_reversing_hand_is_followed() {
        // The speed changes from 50 mm/s to −50 mm/s in a fifth of a second.
        let speed = |number: usize| 0.05 - 0.005 * (number.clamp(20, 40) - 20) as f64;
        let errors = errors(speed, 60);
        let worst = |errors: &[[f64; 2]]| errors.iter().map(|error| error[0]).fold(0.0, f64::max);
        assert!(worst(&errors[20..40]) < 0.02, "{:e} m/s", worst(&errors[20..40]));
        assert!(worst(&errors[50..]) < 0.008, "{:e} m/s", worst(&errors[50..]));
    }

    #[test]
    fn an_undetermined_direction_changes_nothing() {
        let mut filter = MotionFilter::new(Pose::identity(), &PoseCovariance::zero());
        let mut unknown = covariance();
        unknown.0[(0, 0)] = 1.0;
        // The pose slides along x at a metre per second, which is undetermined, and moves along z.
        for number in 1..=10 {
            let time_s = PERIOD_S * f64::from(number);
            filter.update(&Pose::translation(time_s, 0.0, 0.1 * time_s), &unknown, PERIOD_S);
        }
        let velocity_m_s = filter.motion().unwrap().velocity_m_s;
        assert!((velocity_m_s.z - 0.1).abs() < 0.005 && velocity_m_s.x.abs() < 0.05, "{velocity_m_s}");
    }
}
