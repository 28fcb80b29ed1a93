//! Poses and the model as viewers take them, and poses between the struct of the channel and the message of the schema.

use foxglove::messages::{FrameTransform, FrameTransforms, PackedElementField, PointCloud, Quaternion, Vector3};
use prost::bytes::Bytes;

use fringeflow::cloud::Scalar;
use fringeflow_message::{LostReason, MODEL_POINT_BYTES, ModelHeader, TrackingState};
use fringeflow_wire as wire;

use super::recordable::{identity, numeric_type, timestamp};
use super::schema::{PoseReport, Prior, TrackedPose, Window};

/// Frame of the model: that of camera 1 at its first cloud.
const MODEL: &str = "model";
/// Fields of a point of the model, and where they begin.
const FIELDS: [(&str, Scalar, u32); 6] = [
    ("x", Scalar::F32, 0),
    ("y", Scalar::F32, 4),
    ("z", Scalar::F32, 8),
    ("sigma", Scalar::F32, 12),
    ("support", Scalar::U16, 16),
    ("intensity", Scalar::U8, 18),
];

/// Camera 1 in the frame of the model.
pub(super) fn transforms(report: &fringeflow_message::PoseReport) -> FrameTransforms {
    let [x, y, z] = report.position_m;
    let translation = Some(Vector3 { x, y, z });
    let [x, y, z, w] = report.rotation;
    let transform = FrameTransform {
        timestamp: timestamp(report.window.centre_ns),
        parent_frame_id: MODEL.to_owned(),
        child_frame_id: "cam1".to_owned(),
        translation,
        rotation: Some(Quaternion { x, y, z, w }),
    };
    FrameTransforms { transforms: vec![transform] }
}

/// What describes the points of a model; they follow as `data`.
pub(super) fn model_cloud(header: &ModelHeader) -> PointCloud {
    let field = |(name, scalar, offset): (&str, Scalar, u32)| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: numeric_type(scalar).into(),
    };
    PointCloud {
        timestamp: timestamp(header.centre_ns),
        frame_id: MODEL.to_owned(),
        pose: Some(identity()),
        point_stride: MODEL_POINT_BYTES as u32,
        fields: FIELDS.map(field).to_vec(),
        ..PointCloud::default()
    }
}

impl PoseReport {
    /// `None` for a state or window that cannot be.
    pub(super) fn from_report(report: &fringeflow_message::PoseReport) -> Option<Self> {
        let pose = report.has_pose().then(|| TrackedPose {
            position_m: report.position_m.to_vec(),
            rotation: report.rotation.to_vec(),
            covariance: report.covariance.concat(),
        });
        Some(Self {
            published: report.published,
            cloud: report.cloud,
            first_cloud: report.first_cloud,
            window: Window::from_window(&report.window),
            published_ns: report.published_ns,
            state: report.state()?.name().to_owned(),
            reason: report.reason().map_or("", LostReason::name).to_owned(),
            pose,
            sd_m: report.sd_m,
            sd_rad: report.sd_rad,
            rms_m: report.rms_m,
            excess: report.excess,
            share: report.share,
            inliers: report.inliers,
            model_points: report.model_points,
            model_clouds: report.model_clouds,
        })
    }

    /// `None` for what no channel could have carried: an unknown word, a pose that is none, or one of a lost cloud.
    pub(super) fn to_message(&self) -> Option<fringeflow_message::PoseReport> {
        let state = TrackingState::ALL.into_iter().find(|state| state.name() == self.state)?;
        let reason = LostReason::ALL.into_iter().find(|reason| reason.name() == self.reason);
        let is_lost = state == TrackingState::Lost;
        if is_lost != reason.is_some() || is_lost == self.pose.is_some() {
            return None;
        }
        let (position_m, rotation, covariance) = match &self.pose {
            Some(pose) => pose.numbers()?,
            None => ([0.0; 3], [0.0; 4], [[0.0; 6]; 6]),
        };
        Some(fringeflow_message::PoseReport {
            published: self.published,
            cloud: self.cloud,
            first_cloud: self.first_cloud,
            window: self.window.as_ref()?.to_message()?,
            published_ns: self.published_ns,
            position_m,
            rotation,
            covariance,
            sd_m: self.sd_m,
            sd_rad: self.sd_rad,
            rms_m: self.rms_m,
            excess: self.excess,
            share: self.share,
            inliers: self.inliers,
            model_points: self.model_points,
            model_clouds: self.model_clouds,
            state: state as u32,
            reason: reason.map_or(0, |reason| reason as u32),
        })
    }
}

impl Prior {
    pub(super) fn new(header: &fringeflow_message::PriorHeader, relief: &[u8]) -> Self {
        Self {
            published: header.published,
            cloud: header.cloud,
            centre_ns: header.centre_ns,
            published_ns: header.published_ns,
            velocity_m_s: header.velocity_m_s.to_vec(),
            rate_rad_s: header.rate_rad_s.to_vec(),
            width_px: header.width_px,
            height_px: header.height_px,
            relief: Bytes::copy_from_slice(relief),
            drift: wire::drift::read(&header.drift).map_or(Vec::new(), |drift| drift.to_numbers().to_vec()),
        }
    }

    /// The message of the channel and its payload; no message where these contradict each other.
    pub(super) fn into_message(self) -> (Option<fringeflow_message::PriorHeader>, Bytes) {
        let vector = |numbers: &[f64]| <[f64; 3]>::try_from(numbers).ok();
        let header = vector(&self.velocity_m_s).zip(vector(&self.rate_rad_s)).map(|(velocity_m_s, rate_rad_s)| {
            fringeflow_message::PriorHeader {
                published: self.published,
                cloud: self.cloud,
                centre_ns: self.centre_ns,
                published_ns: self.published_ns,
                velocity_m_s,
                rate_rad_s,
                width_px: self.width_px,
                height_px: self.height_px,
                // Recordings of former versions have none.
                drift: self.drift.as_slice().try_into().unwrap_or_default(),
            }
        });
        (header.filter(|header| wire::prior::is_whole(header, &self.relief)), self.relief)
    }
}

/// Place, turn and covariance.
type PoseNumbers = ([f64; 3], [f64; 4], [[f64; 6]; 6]);

impl TrackedPose {
    /// What makes it a pose; `None` where it is none.
    fn numbers(&self) -> Option<PoseNumbers> {
        let position_m: [f64; 3] = self.position_m.as_slice().try_into().ok()?;
        let rotation: [f64; 4] = self.rotation.as_slice().try_into().ok()?;
        let (rows, rest) = self.covariance.as_chunks::<6>();
        let covariance: [[f64; 6]; 6] = rows.try_into().ok().filter(|_| rest.is_empty())?;
        let length = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
        let is_finite = position_m.iter().chain(&self.covariance).all(|x| x.is_finite());
        (is_finite && (length - 1.0).abs() <= 1e-6).then_some((position_m, rotation, covariance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::pose_report;

    #[test]
    fn what_is_no_pose_is_refused() {
        let whole = PoseReport::from_report(&pose_report()).unwrap();
        assert_eq!(whole.to_message().unwrap(), pose_report());
        let changed = |change: fn(&mut PoseReport)| {
            let mut report = whole.clone();
            change(&mut report);
            report.to_message()
        };
        assert_eq!(changed(|r| r.state = "found".to_owned()), None);
        assert_eq!(changed(|r| r.state = "lost".to_owned()), None);
        assert_eq!(changed(|r| r.reason = "degenerate".to_owned()), None);
        assert_eq!(changed(|r| r.pose = None), None);
        assert_eq!(changed(|r| r.window = None), None);
        assert_eq!(changed(|r| r.pose.as_mut().unwrap().rotation[3] = 3.0), None);
        assert_eq!(changed(|r| r.pose.as_mut().unwrap().position_m[0] = f64::NAN), None);
        assert_eq!(changed(|r| r.pose.as_mut().unwrap().covariance.truncate(35)), None);
        let lost = fringeflow_message::PoseReport {
            state: TrackingState::Lost as u32,
            reason: LostReason::Degenerate as u32,
            position_m: [0.0; 3],
            rotation: [0.0; 4],
            covariance: [[0.0; 6]; 6],
            ..pose_report()
        };
        assert_eq!(PoseReport::from_report(&lost).unwrap().to_message(), Some(lost));
    }
}
