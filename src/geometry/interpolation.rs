//! Poses between two poses. In: two poses and a share. Out: a pose. Cost: one spherical interpolation.

use super::Pose;

/// The pose at a share of the way from one pose to another: translation linear, rotation at constant rate.
///
/// Between rotations that differ by half a turn the path is ambiguous; the result is then `before`.
#[must_use]
pub fn interpolate_pose(before: &Pose, after: &Pose, share: f64) -> Pose {
    before.try_lerp_slerp(after, share, 1e-9).unwrap_or(*before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vector3;

    #[test]
    fn half_of_a_turn_is_half_its_angle() {
        let pose = |share: f64| Pose::new(Vector3::new(1.0, -2.0, 0.5) * share, Vector3::new(0.2, 0.9, -0.4) * share);
        for share in [0.0, 0.25, 0.5, 1.0] {
            let off = interpolate_pose(&pose(-1.0), &pose(1.0), share).to_homogeneous()
                - pose(2.0 * share - 1.0).to_homogeneous();
            assert!(off.amax() < 1e-12, "{share}");
        }
        let half_turn = Pose::rotation(Vector3::new(0.0, std::f64::consts::PI, 0.0));
        assert!(interpolate_pose(&Pose::identity(), &half_turn, 0.5).rotation.angle().is_finite());
    }
}
