//! Verifying poses: every recorded pose is computed again from the recorded clouds, and compared to the last bit.
//!
//! Which clouds a live scanner tracks depends on how fast the machine is; what follows from them does not. A report names
//! its cloud and the first one of its model, so the reports of a model are the clouds that went into its tracking, in their
//! order.

use std::collections::HashMap;

use serde::Serialize;

use fringeflow_message::PoseReport;
use fringeflow_recording::{Content, Recording, Topic};
use fringeflow_tracking::fusion::Tracker;
use fringeflow_tracking::messages::pose_report;

use super::{ReplayError, configuration};

/// Recorded poses, computed again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct VerifiedPoses {
    /// Reports, those on lost clouds too.
    pub poses: u64,
    /// The same to the last bit.
    pub same: u64,
    /// Others.
    pub different: u64,
    /// Not computed again: a cloud that they rest on is not in the recording, which may have begun later.
    pub without_clouds: u64,
    /// Cloud of the first pose that differs.
    pub first_different: Option<u64>,
}

/// A model while it is made again.
struct Remade {
    first_cloud: u64,
    tracker: Tracker,
    /// Number of the report that comes next.
    next: u64,
}

/// Computes every recorded pose again and compares; `each` is called after every report.
///
/// # Errors
/// The configuration or a message cannot be read.
pub fn verify_poses(recording: &Recording, mut each: impl FnMut()) -> Result<VerifiedPoses, ReplayError> {
    let settings = configuration(recording)?.tracking.fusion();
    let places: HashMap<u64, usize> =
        recording.cloud_headers().enumerate().map(|(place, header)| (header.published, place)).collect();
    let mut verified = VerifiedPoses::default();
    let mut remade: Option<Remade> = None;
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
            let tracker = Tracker::new(recording.setup().rig.cam1.clone(), settings);
            remade = Some(Remade { first_cloud: report.cloud, tracker, next: report.published });
        }
        let place = places.get(&report.cloud).copied();
        remade = remade.filter(|model| model.continues_with(report));
        let Some((model, place)) = remade.as_mut().zip(place) else {
            verified.without_clouds += 1;
            remade = None;
            continue;
        };
        if is_same(recording, model, report, place)? {
            verified.same += 1;
        } else {
            verified.different += 1;
            verified.first_different.get_or_insert(report.cloud);
        }
    }
    Ok(verified)
}

fn is_same(recording: &Recording, model: &mut Remade, report: &PoseReport, place: usize) -> Result<bool, ReplayError> {
    let Some((header, cloud)) = recording.cloud_headers().nth(place).zip(recording.cloud(place)?) else {
        return Ok(false);
    };
    model.next += 1;
    let tracked = model.tracker.step(&cloud, header.window.centre_ns);
    let made = pose_report(&model.tracker, &tracked, header, model.first_cloud);
    Ok(PoseReport { published: report.published, published_ns: report.published_ns, ..made } == *report)
}

impl Remade {
    /// Whether a report is the next one of this model.
    fn continues_with(&self, report: &PoseReport) -> bool {
        report.first_cloud == self.first_cloud && report.published == self.next
    }
}
