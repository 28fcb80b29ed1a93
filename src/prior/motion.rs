//! The motion of the scanner.

use crate::geometry::{Pose, Vector3};

/// An even motion of camera 1, in its own frame at the time it is known of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion {
    /// Of its centre, metres a second.
    pub velocity_m_s: Vector3,
    /// Its turn about an axis, rad a second.
    pub rate_rad_s: Vector3,
}

impl RigidMotion {
    /// Pose of camera 1 so many seconds later, in its frame at the time the motion is known of.
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
