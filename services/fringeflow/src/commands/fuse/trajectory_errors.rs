//! Compares the tracked poses with the true ones, if the recording has them.

use fringeflow::geometry::Pose;
use fringeflow_lab::evaluation::{StatedPose, TrajectoryScores, against_trajectory};
use fringeflow_tracking::fusion::Tracker;

use crate::failure::Failure;
use crate::input::Input;

use super::scan::Scan;

/// Errors of the poses of a scan. `None` if the true pose of the first cloud is unknown, or fewer than two are known.
pub(super) fn against_truth(
    input: &Input,
    scan: &Scan,
    tracker: &Tracker,
) -> Result<Option<TrajectoryScores>, Failure> {
    let truth = input.truth_poses()?;
    let setup = input.setup();
    // The frame of camera 1 differs between the calibration and the truth. The pose of the volume is known in both.
    let cam1_from_exact = match (&setup.volume, &setup.exact_cam1_from_volume) {
        (Some(volume), Some(exact)) => volume.cam1_from_volume() * exact.inverse(),
        _ => Pose::identity(),
    };
    let pair = |window: &super::scan::ScanWindow| {
        let (tracked, cam1_from_object) = window.merged().zip(truth.pose_at(window.time_ns))?;
        let stated = StatedPose { first_from_cam1: tracked.model_from_cam1, covariance: tracked.covariance.0 };
        Some((stated, cam1_from_object.inverse()))
    };
    let (tracked, truth): (Vec<StatedPose>, Vec<Pose>) = scan.windows.iter().filter_map(pair).unzip();
    // Errors are relative to the first cloud, whose frame is that of the model. So its true pose must be known.
    let is_first_known = scan.windows.iter().find(|w| w.merged().is_some()).is_some_and(|first| pair(first).is_some());
    let centre = tracker.model().centre();
    Ok(if is_first_known { against_trajectory(&tracked, &truth, &cam1_from_exact, &centre) } else { None })
}
