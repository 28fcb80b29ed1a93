//! Converts poses and the model to messages.

use fringeflow_message::{CloudHeader, LostReason, MODEL_POINT_BYTES, ModelHeader, PoseReport, TrackingState};

use crate::fusion::{Surfel, Thinned, Tracked, Tracker, Tracking};
use crate::registration::Lost;

/// Creates the report on a tracked cloud. `first_cloud` is the number of the first cloud of the model. The sender adds
/// the sequence numbers of the report.
#[must_use]
pub fn pose_report(tracker: &Tracker, tracked: &Tracked, cloud: &CloudHeader, first_cloud: u64) -> PoseReport {
    let report = PoseReport {
        cloud: cloud.published,
        first_cloud,
        window: cloud.window,
        model_points: tracker.model().surfels().len() as u64,
        model_clouds: tracker.model().clouds() as u64,
        state: state(&tracked.tracking) as u32,
        ..PoseReport::default()
    };
    let Tracking::Lost(lost) = &tracked.tracking else { return with_pose(report, tracker, tracked) };
    let share = match *lost {
        Lost::TooFewInCommon { associated, tried } if tried > 0 => associated as f64 / tried as f64,
        _ => 0.0,
    };
    PoseReport { reason: reason(lost) as u32, share, ..report }
}

fn with_pose(report: PoseReport, tracker: &Tracker, tracked: &Tracked) -> PoseReport {
    let (pose, covariance) = (&tracked.model_from_cam1, &tracked.covariance);
    let turn = pose.rotation;
    let report = PoseReport {
        position_m: pose.translation.vector.into(),
        rotation: [turn.i, turn.j, turn.k, turn.w],
        covariance: std::array::from_fn(|row| std::array::from_fn(|column| covariance.0[(row, column)])),
        sd_m: covariance.sd_at(&tracker.model().centre()),
        sd_rad: covariance.rotation_sd_rad(),
        ..report
    };
    match tracked.tracking.registration() {
        Some(found) => PoseReport {
            rms_m: found.rms_m,
            excess: found.excess,
            share: found.share,
            inliers: found.associated as u64,
            ..report
        },
        None => report,
    }
}

/// Writes the points of a thinned model into `out` as a payload, and returns the header. `last` is the report on the
/// last cloud in the model.
#[must_use]
pub fn model_message(tracker: &Tracker, shown: &Thinned<'_>, last: &PoseReport, out: &mut Vec<u8>) -> ModelHeader {
    out.clear();
    shown.surfels.iter().for_each(|surfel| out.extend_from_slice(&point(surfel)));
    ModelHeader {
        first_cloud: last.first_cloud,
        clouds: tracker.model().clouds() as u64,
        model_points: tracker.model().surfels().len() as u64,
        points: shown.surfels.len() as u64,
        voxel_m: shown.voxel_m,
        centre_ns: last.window.centre_ns,
        published_ns: 0,
    }
}

fn point(surfel: &Surfel) -> [u8; MODEL_POINT_BYTES] {
    let mut point = [0; MODEL_POINT_BYTES];
    let [x, y, z]: [f64; 3] = surfel.position().coords.into();
    for (bytes, value) in point.chunks_exact_mut(4).zip([x, y, z, surfel.sigma_m()]) {
        bytes.copy_from_slice(&(value as f32).to_le_bytes());
    }
    point[16..18].copy_from_slice(&u16::try_from(surfel.support).unwrap_or(u16::MAX).to_le_bytes());
    point[18] = surfel.intensity.round() as u8;
    point
}

fn state(tracking: &Tracking) -> TrackingState {
    match tracking {
        Tracking::First => TrackingState::First,
        Tracking::Tracked(_) => TrackingState::Tracked,
        Tracking::Relocalized(_) => TrackingState::Relocalized,
        Tracking::Lost(_) => TrackingState::Lost,
    }
}

fn reason(lost: &Lost) -> LostReason {
    match lost {
        Lost::TooFewInCommon { .. } => LostReason::TooFewInCommon,
        Lost::ResidualTooLarge { .. } => LostReason::ResidualTooLarge,
        Lost::Degenerate { .. } => LostReason::Degenerate,
        Lost::NotConverged { .. } => LostReason::NotConverged,
    }
}
