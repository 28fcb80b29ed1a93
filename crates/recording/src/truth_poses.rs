//! True poses of the object, in recordings of the virtual scanner.
//!
//! A pose is that of the object frame in the frame of the *exact* camera 1, in metres, at the start of an exposure. The
//! camera frame of a cloud differs from it by the calibration error. The pose of the measurement volume is known in
//! both frames (`Setup::volume`, `Setup::exact_cam1_from_volume`), so it converts between them.

use foxglove::messages::FrameTransform;

use fringeflow::geometry::{Point3, Pose, interpolate_pose};

use crate::WallClock;
use crate::viewers::transform;

/// Frame of the exact camera 1.
const PARENT: &str = "cam1_exact";
/// Frame of the object.
const CHILD: &str = "object";

/// Pose of the object at the start of an exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthPose {
    /// Start of the exposure, nanoseconds of `CLOCK_MONOTONIC`.
    pub exposure_start_ns: u64,
    /// Pose of the object in the frame of the exact camera 1, metres.
    pub cam1_from_object: Pose,
}

/// The true poses of a recording, in the order of their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruthPoses {
    poses: Vec<TruthPose>,
}

impl TruthPoses {
    /// Creates it from poses in any order.
    pub(super) fn new(mut poses: Vec<TruthPose>) -> Self {
        poses.sort_by_key(|pose| pose.exposure_start_ns);
        Self { poses }
    }

    /// Returns all poses, in the order of their times.
    #[must_use]
    pub fn all(&self) -> &[TruthPose] {
        &self.poses
    }

    /// Returns the pose at a time, interpolated between exposures; `None` before the first and after the last.
    #[must_use]
    pub fn pose_at(&self, time_ns: u64) -> Option<Pose> {
        let next = self.poses.partition_point(|pose| pose.exposure_start_ns < time_ns);
        let after = self.poses.get(next)?;
        if after.exposure_start_ns == time_ns {
            return Some(after.cam1_from_object);
        }
        let before = self.poses.get(next.checked_sub(1)?)?;
        let [since_ns, whole_ns] = [time_ns, after.exposure_start_ns].map(|at_ns| at_ns - before.exposure_start_ns);
        Some(interpolate_pose(&before.cam1_from_object, &after.cam1_from_object, since_ns as f64 / whole_ns as f64))
    }
}

/// Converts a pose to its recorded form.
pub(super) fn encode(pose: &TruthPose, clock: WallClock) -> FrameTransform {
    transform([PARENT, CHILD], &pose.cam1_from_object, clock.unix_ns(pose.exposure_start_ns))
}

/// Returns the pose of a recorded form, or what is wrong with it.
pub(super) fn decode(transform: &FrameTransform) -> Result<Pose, String> {
    let frames = [transform.parent_frame_id.as_str(), transform.child_frame_id.as_str()];
    if frames != [PARENT, CHILD] {
        return Err(format!("the pose is that of {:?} in {:?}; expected {CHILD} in {PARENT}", frames[1], frames[0]));
    }
    let (Some(t), Some(q)) = (&transform.translation, &transform.rotation) else {
        return Err("field translation or rotation is missing".to_owned());
    };
    let position = Point3::new(t.x, t.y, t.z);
    let rotation = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
    let error = (rotation.norm() - 1.0).abs();
    if !(position.coords.norm().is_finite() && error <= 1e-6) {
        return Err(format!(
            "field translation is {position}, the norm of field rotation differs from 1 by {error}; expected a pose"
        ));
    }
    Ok(Pose::from_parts(position.coords.into(), nalgebra::UnitQuaternion::from_quaternion(rotation)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::geometry::Vector3;

    fn pose(time_ns: u64) -> TruthPose {
        let t = time_ns as f64;
        let cam1_from_object = Pose::new(Vector3::new(0.1, -0.2, 0.3) * t, Vector3::new(0.01, 0.02, -0.03) * t);
        TruthPose { exposure_start_ns: time_ns, cam1_from_object }
    }

    #[test]
    fn poses_are_interpolated_between_exposures_and_unknown_outside() {
        let poses = TruthPoses { poses: vec![pose(10), pose(20), pose(40)] };
        for time_ns in [10, 13, 20, 33, 40] {
            let off =
                poses.pose_at(time_ns).unwrap().to_homogeneous() - pose(time_ns).cam1_from_object.to_homogeneous();
            assert!(off.amax() < 1e-9, "{time_ns}");
        }
        assert_eq!((poses.pose_at(9), poses.pose_at(41), TruthPoses::default().pose_at(0)), (None, None, None));
    }

    #[test]
    fn a_pose_is_read_unchanged_and_an_invalid_one_is_refused() {
        let transform = encode(&pose(7), WallClock::default());
        let off = decode(&transform).unwrap().to_homogeneous() - pose(7).cam1_from_object.to_homogeneous();
        assert!(off.amax() < 1e-12);
        let refused = |change: fn(&mut FrameTransform)| {
            let mut transform = encode(&pose(7), WallClock::default());
            change(&mut transform);
            decode(&transform).unwrap_err()
        };
        assert!(refused(|t| t.parent_frame_id = "cam1".to_owned()).contains("expected object in cam1_exact"));
        assert!(refused(|t| t.rotation = None).contains("missing"));
        assert!(refused(|t| t.rotation.as_mut().unwrap().w = 7.0).contains("norm"));
        assert!(refused(|t| t.translation.as_mut().unwrap().x = f64::NAN).contains("translation"));
    }
}
