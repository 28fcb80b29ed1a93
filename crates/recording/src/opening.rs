//! What stands at the beginning of a recording: where it comes from, and all that a measurement needs beside the images.

use std::collections::BTreeMap;
use std::time::{SystemTime, UNIX_EPOCH};

use foxglove::messages::{CameraCalibration, FrameTransform, FrameTransforms, Quaternion, Vector3};
use prost::Message as _;
use rustix::time::ClockId;
use serde::Serialize;

use fringeflow::correspondence::Fingerprint;
use fringeflow::geometry::{Camera, Pose};
use fringeflow_dataset::Setup;

use super::recordable::timestamp;
use super::{FORMAT_VERSION, Topic};

/// Where and when a recording was begun.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Origin {
    /// Name of the host.
    pub host: String,
    /// Release of its kernel.
    pub kernel: String,
    /// Model of its CPU.
    pub cpu: String,
    /// Wall clock, nanoseconds since 1970.
    pub started_unix_ns: u64,
    /// `CLOCK_MONOTONIC` at the same moment: what all times of the recording count from.
    pub started_ns: u64,
}

impl Origin {
    /// This machine, now.
    #[must_use]
    pub fn here() -> Self {
        let line = |path: &str| std::fs::read_to_string(path).map(|text| text.trim().to_owned()).unwrap_or_default();
        let cpus = line("/proc/cpuinfo");
        let model = cpus.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self {
            host: line("/proc/sys/kernel/hostname"),
            kernel: line("/proc/sys/kernel/osrelease"),
            cpu: model.map(|(_, name)| name.to_owned()).unwrap_or_default(),
            started_unix_ns: u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX),
            started_ns: monotonic_ns(),
        }
    }

    /// A time of `CLOCK_MONOTONIC` on the wall clock, Unix milliseconds.
    #[must_use]
    pub fn unix_ms(&self, time_ns: u64) -> f64 {
        let since_start_ns = i128::from(time_ns) - i128::from(self.started_ns);
        (i128::from(self.started_unix_ns) + since_start_ns) as f64 * 1e-6
    }

    /// As metadata of a recording with this setup.
    pub(super) fn metadata(&self, setup: &Setup) -> BTreeMap<String, String> {
        let volume = setup.volume.as_ref();
        let table = volume.map(|volume| Fingerprint::new(&setup.rig, volume, &setup.sequence.pattern).to_string());
        let [width, height] = setup.image_size_px;
        let entries = [
            ("format", FORMAT_VERSION.to_string()),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("host", self.host.clone()),
            ("kernel", self.kernel.clone()),
            ("cpu", self.cpu.clone()),
            ("started_unix_ns", self.started_unix_ns.to_string()),
            ("started_ns", self.started_ns.to_string()),
            ("segment_table", table.unwrap_or_default()),
            ("width_px", width.to_string()),
            ("height_px", height.to_string()),
            ("steps", setup.steps.to_string()),
        ];
        entries.map(|(key, value)| (key.to_owned(), value)).into()
    }

    /// Reads the metadata of a recording; what is not there stays empty.
    pub(super) fn from_metadata(metadata: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| metadata.get(key).cloned().unwrap_or_default();
        let number = |key: &str| text(key).parse().unwrap_or_default();
        Self {
            host: text("host"),
            kernel: text("kernel"),
            cpu: text("cpu"),
            started_unix_ns: number("started_unix_ns"),
            started_ns: number("started_ns"),
        }
    }
}

/// The time that all messages count in.
pub(super) fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::Monotonic);
    u64::try_from(now.tv_sec).unwrap_or_default() * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or_default()
}

/// What viewers need to know of a setup, once: transforms and calibration, encoded.
#[must_use]
pub fn standing_messages(setup: &Setup, time_ns: u64) -> [(Topic, Vec<u8>); 3] {
    let calibration = |camera, frame| calibration(camera, frame, time_ns).encode_to_vec();
    [
        (Topic::Transforms, transforms(setup, time_ns).encode_to_vec()),
        (Topic::Cam1Calibration, calibration(&setup.rig.cam1, "cam1")),
        (Topic::Cam2Calibration, calibration(&setup.rig.cam2, "cam2")),
    ]
}

/// Where camera 2, projector and volume are, seen from camera 1.
fn transforms(setup: &Setup, time_ns: u64) -> FrameTransforms {
    let transform = |child: &str, cam1_from_child: &Pose| FrameTransform {
        timestamp: timestamp(time_ns),
        parent_frame_id: "cam1".to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(vector(cam1_from_child)),
        rotation: Some(quaternion(cam1_from_child)),
    };
    let mut transforms = vec![
        transform("cam2", &setup.rig.cam2_from_cam1.inverse()),
        transform("projector", &setup.rig.projector_from_cam1.inverse()),
    ];
    transforms.extend(setup.volume.as_ref().map(|volume| transform("volume", volume.cam1_from_volume())));
    FrameTransforms { transforms }
}

pub(super) fn vector(pose: &Pose) -> Vector3 {
    let t = pose.translation.vector;
    Vector3 { x: t.x, y: t.y, z: t.z }
}

pub(super) fn quaternion(pose: &Pose) -> Quaternion {
    let q = pose.rotation;
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

/// The calibration of a camera, for viewers; the measurement reads the attachment.
fn calibration(camera: &Camera, frame: &str, time_ns: u64) -> CameraCalibration {
    let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.principal_px());
    let d = camera.distortion().to_opencv();
    CameraCalibration {
        timestamp: timestamp(time_ns),
        frame_id: frame.to_owned(),
        width: camera.width_px() as u32,
        height: camera.height_px() as u32,
        distortion_model: "rational_polynomial".to_owned(),
        d: d.iter().copied().take(8).collect(),
        k: vec![fx, camera.skew_px(), cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx, camera.skew_px(), cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}
