//! Tracked poses against the true ones, where the recording holds these.

use fringeflow::geometry::Pose;
use fringeflow_lab::evaluation::{StatedPose, TrajectoryScores, against_trajectory};
use fringeflow_tracking::fusion::Tracker;

use crate::failure::Failure;
use crate::input::Input;

use super::scan::Scan;

/// How far the poses of a scan are from the true ones; `None` where the truth of less than two of them is known.
pub(super) fn against_truth(
    input: &Input,
    scan: &Scan,
    tracker: &Tracker,
) -> Result<Option<TrajectoryScores>, Failure> {
    let truth = input.truth_poses()?;
    let setup = input.setup();
    // A camera does not know where its own frame is but by its calibration; the volume is where both say that it is.
    let cam1_from_exact = match (&setup.volume, &setup.exact_cam1_from_volume) {
        (Some(volume), Some(exact)) => volume.cam1_from_volume() * exact.inverse(),
        _ => Pose::identity(),
    };
    let pair = |looked: &super::scan::Looked| {
        let (tracked, cam1_from_object) = looked.merged().zip(truth.pose_at(looked.time_ns))?;
        let stated = StatedPose { first_from_cam1: tracked.model_from_cam1, covariance: tracked.covariance.0 };
        Some((stated, cam1_from_object.inverse()))
    };
    let (tracked, truth): (Vec<StatedPose>, Vec<Pose>) = scan.looked.iter().filter_map(pair).unzip();
    // Errors count from the first cloud, which makes the frame; without its truth there is nothing to count from.
    let begins_true = scan.looked.iter().find(|l| l.merged().is_some()).is_some_and(|first| pair(first).is_some());
    Ok(if begins_true { against_trajectory(&tracked, &truth, &cam1_from_exact, tracker.centre()) } else { None })
}
