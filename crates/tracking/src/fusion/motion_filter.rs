//! How the scanner moves, by the poses that were found so far.
//!
//! In: poses of C1 with their covariances, at their times. Out: its motion at the last of them. The difference of two poses is
//! right where these are known well and some time apart. On a surface that hardly tells in which direction it was shifted, or
//! 10 ms apart, it is noise. So a Kalman filter (Kalman 1960, "A new approach to linear filtering and prediction problems")
//! weighs what a pose says, direction by direction, against what a hand does: it keeps its speed but for random accelerations.

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use fringeflow::geometry::{Pose, Vector3};
use fringeflow::prior::RigidMotion;

use crate::registration::PoseCovariance;

type Matrix12 = SMatrix<f64, 12, 12>;
type Vector12 = SVector<f64, 12>;

/// Speeds that a scanner has before anything is known of it, all axes alike: standard deviations, m/s and rad/s.
const USUAL_SPEED: [f64; 2] = [0.1, 0.5];
/// Random accelerations: the variance of a speed grows by so much a second, m²/s³ and rad²/s³. A hand that leads a scanner
/// changes its speed by some 0.2 m/s² in a tenth of a second.
const ACCELERATIONS: [f64; 2] = [2e-3, 2e-2];
/// What the covariance of a registration does not tell: errors that go with the fringes, as motion leaves them, are the same in
/// all clouds and hold the surface back. Standard deviations of shift and turn, metres and rad, and a factor to the variances.
const LEAST_POSE_SD: [f64; 2] = [1e-5, 3e-5];
const COMMON_ERRORS: f64 = 9.0;

/// The motion of a scanner that is tracked.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionFilter {
    pose: Pose,
    /// Speed and rate, frame of C1.
    twist: Vector6<f64>,
    /// Of a small motion in the frame of C1, then of the twist.
    covariance: Matrix12,
    poses: u32,
}

impl MotionFilter {
    /// Of a scanner that was seen once.
    pub(super) fn new(pose: Pose, covariance: &PoseCovariance) -> Self {
        let mut of_both = Matrix12::zeros();
        of_both.fixed_view_mut::<6, 6>(0, 0).copy_from(&in_own_frame(&pose, covariance));
        of_both.fixed_view_mut::<6, 6>(6, 6).copy_from(&diagonal(USUAL_SPEED.map(|sd| sd * sd)));
        Self { pose, twist: Vector6::zeros(), covariance: of_both, poses: 1 }
    }

    /// The motion at the last pose; `None` after one pose alone.
    pub(super) fn motion(&self) -> Option<RigidMotion> {
        let of = |from: usize| Vector3::new(self.twist[from], self.twist[from + 1], self.twist[from + 2]);
        let motion = RigidMotion { velocity_m_s: of(0), rate_rad_s: of(3) };
        (self.poses > 1 && motion.is_finite()).then_some(motion)
    }

    /// Takes the pose found so many seconds after the last one, with its covariance in the frame that the pose refers to. One whose
    /// numbers are not finite tells nothing.
    pub(super) fn take(&mut self, pose: &Pose, covariance: &PoseCovariance, seconds: f64) {
        self.go_on(seconds);
        let found = self.pose.inverse() * pose;
        let off = Vector6::from_iterator(found.translation.vector.iter().chain(&found.rotation.scaled_axis()).copied());
        let of_pose = self.covariance.fixed_view::<6, 6>(0, 0).into_owned();
        let Some(inverse) = (of_pose + in_own_frame(pose, covariance)).try_inverse() else { return };
        let gain = self.covariance.fixed_columns::<6>(0) * inverse;
        let change: Vector12 = gain * off;
        if !gain.iter().chain(&change).all(|value| value.is_finite()) {
            return;
        }
        let part = |from: usize| Vector3::new(change[from], change[from + 1], change[from + 2]);
        self.pose *= Pose::new(part(0), part(3));
        self.pose.rotation.renormalize();
        self.twist += change.fixed_rows::<6>(6);
        let left = self.covariance - gain * self.covariance.fixed_rows::<6>(0);
        self.covariance = (left + left.transpose()) / 2.0;
        self.poses += 1;
    }

    /// Moves on evenly.
    fn go_on(&mut self, seconds: f64) {
        let step = self.twist * seconds;
        self.pose *= Pose::new(Vector3::new(step[0], step[1], step[2]), Vector3::new(step[3], step[4], step[5]));
        let mut moved = Matrix12::identity();
        moved.fixed_view_mut::<6, 6>(0, 6).fill_diagonal(seconds);
        let mut grown = Matrix12::zeros();
        let accelerations = diagonal(ACCELERATIONS);
        for (i, j, factor) in [(0, 0, seconds.powi(3) / 3.0), (0, 6, seconds.powi(2) / 2.0), (6, 6, seconds)] {
            grown.fixed_view_mut::<6, 6>(i, j).copy_from(&(accelerations * factor));
            grown.fixed_view_mut::<6, 6>(j, i).copy_from(&(accelerations * factor));
        }
        self.covariance = moved * self.covariance * moved.transpose() + grown;
    }
}

/// The same for all axes of a shift, and for all of a turn.
fn diagonal([shift, turn]: [f64; 2]) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(shift, shift, shift, turn, turn, turn))
}

/// The covariance of a pose, in its own frame.
fn in_own_frame(pose: &Pose, covariance: &PoseCovariance) -> Matrix6<f64> {
    covariance.seen_from(&pose.inverse()).0 * COMMON_ERRORS + diagonal(LEAST_POSE_SD.map(|sd| sd * sd))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.01;
    /// Poses are off by so much, metres and rad.
    const POSE_SD: [f64; 2] = [2e-5, 6e-5];

    /// Numbers between -1 and 1 that repeat late.
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

    /// Errors of the velocity after each pose of a way, by the filter and by the difference of two poses, m/s.
    fn errors(speed_m_s: impl Fn(usize) -> f64, poses: usize) -> Vec<[f64; 2]> {
        let mut seed = 7;
        let mut true_pose = Pose::new(Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.3, 0.1, -0.2));
        let mut before = noisy(&true_pose, &mut seed);
        // The covariance is that of the frame that the poses refer to.
        let seen = |pose: &Pose| covariance().seen_from(pose);
        let mut filter = MotionFilter::new(before, &seen(&before));
        assert_eq!(filter.motion(), None);
        let of_pose = |number| {
            let velocity_m_s = Vector3::new(speed_m_s(number), 0.0, -0.5 * speed_m_s(number));
            true_pose *= Pose::new(velocity_m_s * PERIOD_S, Vector3::new(0.0, 0.2, 0.0) * PERIOD_S);
            let found = noisy(&true_pose, &mut seed);
            filter.take(&found, &seen(&found), PERIOD_S);
            let plain_m_s = (before.inverse() * found).translation.vector / PERIOD_S;
            before = found;
            [filter.motion().unwrap().velocity_m_s, plain_m_s].map(|found| (found - velocity_m_s).norm())
        };
        (1..=poses).map(of_pose).collect()
    }

    #[test]
    fn an_even_motion_is_known_better_than_by_two_poses() {
        let errors = errors(|_| 0.05, 40);
        let rms = |which: usize| {
            let squares: f64 = errors[10..].iter().map(|error| error[which].powi(2)).sum();
            (squares / 30.0).sqrt()
        };
        assert!(rms(0) < 0.6 * rms(1), "{:e} and {:e} m/s", rms(0), rms(1));
    }

    #[test]
    fn a_hand_that_turns_round_is_followed() {
        // From 50 mm/s to -50 in a fifth of a second.
        let speed = |number: usize| 0.05 - 0.005 * (number.clamp(20, 40) - 20) as f64;
        let errors = errors(speed, 60);
        let worst = |errors: &[[f64; 2]]| errors.iter().map(|error| error[0]).fold(0.0, f64::max);
        assert!(worst(&errors[20..40]) < 0.02, "{:e} m/s", worst(&errors[20..40]));
        assert!(worst(&errors[50..]) < 0.008, "{:e} m/s", worst(&errors[50..]));
    }

    #[test]
    fn what_is_not_known_of_a_pose_changes_nothing() {
        let mut filter = MotionFilter::new(Pose::identity(), &PoseCovariance::zero());
        let mut unknown = covariance();
        unknown.0[(0, 0)] = 1.0;
        // It slides along x at a metre a second, which means nothing, and comes nearer.
        for number in 1..=10 {
            let time_s = PERIOD_S * f64::from(number);
            filter.take(&Pose::translation(time_s, 0.0, 0.1 * time_s), &unknown, PERIOD_S);
        }
        let velocity_m_s = filter.motion().unwrap().velocity_m_s;
        assert!((velocity_m_s.z - 0.1).abs() < 0.005 && velocity_m_s.x.abs() < 0.05, "{velocity_m_s}");
    }
}
