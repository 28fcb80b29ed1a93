//! Messages in the schemas of Foxglove, for viewers: images, clouds, transforms, calibration, log.

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    self, CameraCalibration, FrameTransform, FrameTransforms, Log, PackedElementField, PointCloud, RawImage, Timestamp,
    Vector3, log,
};
use prost::Message as _;

use fringeflow::cloud::{FIELDS, RECORD_BYTES, Scalar};
use fringeflow::geometry::{Camera, Pose};
use fringeflow_dataset::Setup;
use fringeflow_message::{CloudHeader, FrameHeader, MODEL_POINT_BYTES, ModelHeader, PixelFormat, PoseReport};

use crate::{Topic, WallClock};

/// Frame of the model: the pose of camera 1 at its first cloud.
const MODEL: &str = "model";
/// Fields of a point of the model, and their offsets.
const MODEL_FIELDS: [(&str, Scalar, u32); 6] = [
    ("x", Scalar::F32, 0),
    ("y", Scalar::F32, 4),
    ("z", Scalar::F32, 8),
    ("sigma", Scalar::F32, 12),
    ("support", Scalar::U16, 16),
    ("intensity", Scalar::U8, 18),
];

/// Transforms and calibration of a setup, encoded. They do not change during a recording. Their time stamp is `unix_ns`,
/// nanoseconds since 1970.
#[must_use]
pub fn static_messages(setup: &Setup, unix_ns: u64) -> [(Topic, Vec<u8>); 3] {
    let calibration = |camera, frame| calibration(camera, frame, unix_ns).encode_to_vec();
    [
        (Topic::Transforms, static_transforms(setup, unix_ns).encode_to_vec()),
        (Topic::Cam1Calibration, calibration(&setup.rig.cam1, "cam1")),
        (Topic::Cam2Calibration, calibration(&setup.rig.cam2, "cam2")),
    ]
}

/// Transforms of camera 2, projector and measurement volume in the frame of camera 1.
fn static_transforms(setup: &Setup, unix_ns: u64) -> FrameTransforms {
    let mut transforms = vec![
        transform(["cam1", "cam2"], &setup.rig.cam2_from_cam1.inverse(), unix_ns),
        transform(["cam1", "projector"], &setup.rig.projector_from_cam1.inverse(), unix_ns),
    ];
    let volume = setup.volume.as_ref();
    transforms.extend(volume.map(|volume| transform(["cam1", "volume"], volume.cam1_from_volume(), unix_ns)));
    FrameTransforms { transforms }
}

/// Creates the message with the pose of a child frame in its parent frame.
pub(super) fn transform([parent, child]: [&str; 2], parent_from_child: &Pose, unix_ns: u64) -> FrameTransform {
    let (t, q) = (parent_from_child.translation.vector, parent_from_child.rotation);
    FrameTransform {
        timestamp: timestamp(unix_ns),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3 { x: t.x, y: t.y, z: t.z }),
        rotation: Some(messages::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }),
    }
}

/// Creates the calibration message of a camera. The measurement reads the attachment instead.
fn calibration(camera: &Camera, frame: &str, unix_ns: u64) -> CameraCalibration {
    let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.principal_px());
    let d = camera.distortion().to_opencv();
    CameraCalibration {
        timestamp: timestamp(unix_ns),
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

/// Creates the transform of camera 1 in the frame of the model.
pub(super) fn pose_transforms(report: &PoseReport, clock: WallClock) -> FrameTransforms {
    let [x, y, z] = report.position_m;
    let translation = Some(Vector3 { x, y, z });
    let [x, y, z, w] = report.rotation;
    let transform = FrameTransform {
        timestamp: timestamp(clock.unix_ns(report.window.centre_ns)),
        parent_frame_id: MODEL.to_owned(),
        child_frame_id: "cam1".to_owned(),
        translation,
        rotation: Some(messages::Quaternion { x, y, z, w }),
    };
    FrameTransforms { transforms: vec![transform] }
}

/// Creates an image message without its `data`.
pub(super) fn raw_image(header: &FrameHeader, clock: WallClock) -> RawImage {
    RawImage {
        timestamp: timestamp(clock.unix_ns(header.exposure_start_ns)),
        frame_id: format!("cam{}", header.camera),
        width: header.width_px,
        height: header.height_px,
        encoding: raw_encoding(header).unwrap_or_default().to_owned(),
        step: header.stride_bytes,
        ..RawImage::default()
    }
}

/// Returns the name of an image format in Foxglove; `None` for a format that is not recorded.
pub(super) fn raw_encoding(header: &FrameHeader) -> Option<&'static str> {
    Some(match PixelFormat::from_code(header.pixel_format)?.bytes() {
        1 => "mono8",
        _ => "mono16",
    })
}

/// Creates a cloud message without its `data`.
pub(super) fn point_cloud(header: &CloudHeader, clock: WallClock) -> PointCloud {
    let mut offset = 0;
    let fields = FIELDS.map(|(name, scalar)| {
        let field = packed_field(name, scalar, offset);
        offset += scalar.size() as u32;
        field
    });
    packed_cloud("cam1", clock.unix_ns(header.window.centre_ns), RECORD_BYTES, fields.to_vec())
}

/// Creates a message with the points of a model, without their `data`.
pub(super) fn model_cloud(header: &ModelHeader, clock: WallClock) -> PointCloud {
    let fields = MODEL_FIELDS.map(|(name, scalar, offset)| packed_field(name, scalar, offset));
    packed_cloud(MODEL, clock.unix_ns(header.centre_ns), MODEL_POINT_BYTES, fields.to_vec())
}

fn packed_cloud(frame: &str, unix_ns: u64, point_bytes: usize, fields: Vec<PackedElementField>) -> PointCloud {
    let orientation = Some(messages::Quaternion { w: 1.0, ..messages::Quaternion::default() });
    PointCloud {
        timestamp: timestamp(unix_ns),
        frame_id: frame.to_owned(),
        pose: Some(messages::Pose { position: Some(Vector3::default()), orientation }),
        point_stride: point_bytes as u32,
        fields,
        ..PointCloud::default()
    }
}

fn packed_field(name: &str, scalar: Scalar, offset: u32) -> PackedElementField {
    let numeric_type = match scalar {
        Scalar::U8 => NumericType::Uint8,
        Scalar::U16 => NumericType::Uint16,
        Scalar::I16 => NumericType::Int16,
        Scalar::I32 => NumericType::Int32,
        Scalar::F32 => NumericType::Float32,
    };
    PackedElementField { name: name.to_owned(), offset, r#type: numeric_type.into() }
}

pub(super) fn log_message(unix_ns: u64, level: log::Level, name: &str, text: &str) -> Log {
    Log {
        timestamp: timestamp(unix_ns),
        level: level.into(),
        message: text.to_owned(),
        name: name.to_owned(),
        ..Log::default()
    }
}

/// Converts nanoseconds since 1970 to a time of Foxglove; times after 2106 are shown as 0.
fn timestamp(unix_ns: u64) -> Option<Timestamp> {
    let seconds = u32::try_from(unix_ns / 1_000_000_000).ok()?;
    Timestamp::new_checked(seconds, (unix_ns % 1_000_000_000) as u32)
}
