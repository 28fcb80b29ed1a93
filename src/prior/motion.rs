//! Motion of the scanner. In: velocity and rate of turn. Out: the pose at any time.

use crate::geometry::{Pose, Vector3};

/// Motion of camera 1 at constant velocity and rate, in its own frame at the reference time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion {
    /// Velocity of its centre, metres per second.
    pub velocity_m_s: Vector3,
    /// Angular velocity, rad per second.
    pub rate_rad_s: Vector3,
}

impl RigidMotion {
    /// Pose of camera 1 `seconds` after the reference time, in its frame at the reference time.
    #[must_use]
    pub fn pose_after(&self, seconds: f64) -> Pose {
        Pose::new(self.velocity_m_s * seconds, self.rate_rad_s * seconds)
    }

    /// Whether all its numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.velocity_m_s.iter().chain(&self.rate_rad_s).all(|value| value.is_finite())
    }
}
