//! Recomputes every recorded pose from the recorded clouds and compares it to the last bit.
//!
//! Which clouds a live scanner tracks depends on the speed of the computer. The poses depend only on the tracked
//! clouds. A report states its cloud and the first cloud of its model, so the reports of a model list the tracked
//! clouds in order.

use std::collections::HashMap;

use serde::Serialize;

use fringeflow_message::PoseReport;
use fringeflow_recording::{Content, Recording, Topic};
use fringeflow_tracking::fusion::Tracker;
use fringeflow_tracking::messages::pose_report;

use crate::{ReplayError, configuration};

/// Counts of the recomputed poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct VerifiedPoses {
    /// Number of reports, including those on lost clouds.
    pub poses: u64,
    /// Poses that are equal to the last bit.
    pub same: u64,
    /// Poses that differ.
    pub different: u64,
    /// Poses that cannot be recomputed, because a cloud of the model is not in the recording. The recording may have
    /// started later than the model.
    pub without_clouds: u64,
    /// Number of the cloud of the first pose that differs.
    pub first_different: Option<u64>,
}

/// A model that is rebuilt from the recorded clouds.
struct RebuiltModel {
    first_cloud: u64,
    tracker: Tracker,
    /// Number of the next report.
    next: u64,
}

/// Recomputes every recorded pose and compares it. Calls `each` for every report.
///
/// # Errors
/// The configuration or a message cannot be read.
pub fn verify_poses(recording: &Recording, mut each: impl FnMut()) -> Result<VerifiedPoses, ReplayError> {
    let settings = configuration(recording)?.tracking.fusion();
    let indexes: HashMap<u64, usize> =
        recording.cloud_headers().enumerate().map(|(index, header)| (header.published, index)).collect();
    let mut verified = VerifiedPoses::default();
    let mut rebuilt: Option<RebuiltModel> = None;
    let mut reports = Vec::new();
    for message in recording.messages_of(Topic::Pose) {
        if let Content::Pose(report) = message?.content {
            reports.push(*report);
        }
    }
    reports.sort_by_key(|report| report.published);
    for report in &reports {
        each();
        verified.poses += 1;
        if report.first_cloud == report.cloud {
            let tracker = Tracker::new(recording.setup().rig.cam1, settings);
            rebuilt = Some(RebuiltModel { first_cloud: report.cloud, tracker, next: report.published });
        }
        let index = indexes.get(&report.cloud).copied();
        rebuilt = rebuilt.filter(|model| model.continues_with(report));
        let Some((model, index)) = rebuilt.as_mut().zip(index) else {
            verified.without_clouds += 1;
            // If a cloud is missing, the later poses of the model cannot be equal.
            rebuilt = None;
            continue;
        };
        if is_same(recording, model, report, index)? {
            verified.same += 1;
        } else {
            verified.different += 1;
            verified.first_different.get_or_insert(report.cloud);
        }
    }
    Ok(verified)
}

fn is_same(
    recording: &Recording,
    model: &mut RebuiltModel,
    report: &PoseReport,
    index: usize,
) -> Result<bool, ReplayError> {
    let Some((header, cloud)) = recording.cloud_headers().nth(index).zip(recording.cloud(index)?) else {
        return Ok(false);
    };
    model.next += 1;
    let tracked = model.tracker.step(&cloud.points, header.window.centre_ns);
    let recomputed = pose_report(&model.tracker, &tracked, header, model.first_cloud);
    Ok(PoseReport { published: report.published, published_ns: report.published_ns, ..recomputed } == *report)
}

impl RebuiltModel {
    /// Whether a report is the next one of this model.
    fn continues_with(&self, report: &PoseReport) -> bool {
        report.first_cloud == self.first_cloud && report.published == self.next
    }
}
