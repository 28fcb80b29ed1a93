//! Poses between two poses.

use super::Pose;

/// The pose at a share of the way from one pose to another: the way straight, the turn even. Half a turn has no even way;
/// then it is the first.
#[must_use]
pub fn between(before: &Pose, after: &Pose, share: f64) -> Pose {
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
            let off =
                between(&pose(-1.0), &pose(1.0), share).to_homogeneous() - pose(2.0 * share - 1.0).to_homogeneous();
            assert!(off.amax() < 1e-12, "{share}");
        }
        let half_turn = Pose::rotation(Vector3::new(0.0, std::f64::consts::PI, 0.0));
        assert!(between(&Pose::identity(), &half_turn, 0.5).rotation.angle().is_finite());
    }
}
