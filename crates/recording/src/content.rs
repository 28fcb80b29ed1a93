//! Decoded messages of a recording.

use foxglove::messages::{Log, PointCloud, RawImage, log};
use prost::bytes::Bytes;

use fringeflow::cloud::RECORD_BYTES;
use fringeflow::geometry::Pose;
use fringeflow_message::{
    CloudHeader, CorrespondenceHeader, FrameHeader, MapsHeader, PatternEvent, PoseReport, PriorHeader, StageReport,
    WindowReport,
};
use fringeflow_wire::prior::is_consistent;

use crate::convert::Convert;
use crate::recordable::min_stride_bytes;
use crate::viewers::raw_encoding;
use crate::{Topic, schema, truth_poses};

/// A message of a recording.
#[derive(Clone, Debug)]
pub struct Message {
    /// Topic of the message.
    pub topic: Topic,
    /// Time of receipt or publication, nanoseconds of `CLOCK_MONOTONIC`, as are the time stamps in `content`.
    pub log_ns: u64,
    /// Start of the exposure, on the same clock.
    pub publish_ns: u64,
    /// Decoded content.
    pub content: Content,
}

/// Content of a message. The payloads are the same as in the channels.
#[derive(Clone, Debug)]
pub enum Content {
    /// An image.
    Frame(FrameHeader, Bytes),
    /// A pattern event.
    Pattern(PatternEvent),
    /// Phase maps.
    Maps(Box<MapsHeader>, Bytes),
    /// Correspondences.
    Correspondences(Box<CorrespondenceHeader>, Bytes),
    /// A cloud and its records, lengths in metres.
    Cloud(Box<CloudHeader>, Bytes),
    /// Report of a stage.
    Report(Box<StageReport>),
    /// Report on the quality of a window.
    WindowReport(Box<WindowReport>),
    /// True pose of the object in the frame of the exact camera 1, metres.
    TruthPose(Pose),
    /// Pose of the scanner at a cloud.
    Pose(Box<PoseReport>),
    /// Prior of the windows after a cloud, and the payload of the channel.
    Prior(Box<PriorHeader>, Bytes),
    /// A mark that a user set.
    Mark(String),
    /// A log message of the recorder about its losses.
    Loss(String),
    /// Calibration or transform that only viewers need; the measurement reads the attachments instead.
    ForViewers,
}

/// Decoded header of an image or a cloud.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Header {
    Frame(FrameHeader),
    Cloud(Box<CloudHeader>),
}

impl Header {
    /// Decodes a message of a topic with headers.
    pub(super) fn decode(topic: Topic, data: &[u8]) -> Result<Self, String> {
        let data = Bytes::copy_from_slice(data);
        let camera = match topic {
            Topic::Cam1Header => 1,
            Topic::Cam2Header => 2,
            _ => {
                let fault = "field window is missing or contradicts itself";
                return decode_struct::<schema::CloudHeader>(data, fault).map(Self::Cloud);
            }
        };
        let header = *decode_struct::<schema::FrameHeader>(data, "")?;
        if header.camera != camera {
            return Err(format!("field camera is {}; expected {camera}", header.camera));
        }
        Ok(Self::Frame(header))
    }
}

impl Content {
    /// Decodes a message. `header` describes the message if its topic has headers.
    pub(super) fn decode(topic: Topic, header: Option<&Header>, data: Bytes) -> Result<Self, String> {
        const MAP_FAULT: &str = "field header is missing or contradicts itself";
        Ok(match (topic, header) {
            (Topic::Cam1Frame | Topic::Cam2Frame, Some(Header::Frame(header))) => image(header, data)?,
            (Topic::Cloud, Some(Header::Cloud(header))) => cloud(header, data)?,
            (Topic::Cam1Frame | Topic::Cam2Frame | Topic::Cloud, _) => return Err("its header is missing".to_owned()),
            (Topic::Cam1Header | Topic::Cam2Header | Topic::CloudHeader, _) => {
                return Err("the message that it describes is missing".to_owned());
            }
            (Topic::Pattern, _) => Self::Pattern(*decode_struct::<schema::PatternEvent>(data, "")?),
            (Topic::PhaseMaps, _) => {
                let maps = decode::<schema::PhaseMaps>(data)?;
                let header = maps.header.and_then(|header| header.to_struct()).ok_or(MAP_FAULT)?;
                Self::Maps(Box::new(header), maps.payload)
            }
            (Topic::CorrespondenceMap, _) => {
                let map = decode::<schema::CorrespondenceMap>(data)?;
                let header = map.header.and_then(|header| header.to_struct()).ok_or(MAP_FAULT)?;
                Self::Correspondences(Box::new(header), map.payload)
            }
            (Topic::Report, _) => {
                let fault = "field stage, dropped or incidents has an unknown name";
                Self::Report(decode_struct::<schema::StageReport>(data, fault)?)
            }
            (Topic::WindowReport, _) => {
                let fault = "field window or outcomes is missing or contradicts itself";
                Self::WindowReport(decode_struct::<schema::WindowReport>(data, fault)?)
            }
            (Topic::TruthPose, _) => Self::TruthPose(truth_poses::decode(&decode(data)?)?),
            (Topic::Pose, _) => {
                let fault = "field window, state, reason or pose is missing or contradicts itself";
                Self::Pose(decode_struct::<schema::PoseReport>(data, fault)?)
            }
            (Topic::Prior, _) => {
                let prior = decode::<schema::Prior>(data)?;
                let header = prior.to_struct().filter(|header| is_consistent(header, &prior.relief));
                let header = header.ok_or("field velocity_m_s, rate_rad_s or relief contradicts itself")?;
                Self::Prior(Box::new(header), prior.relief)
            }
            (Topic::Log, _) => {
                let log = decode::<Log>(data)?;
                let is_loss = log.level >= i32::from(log::Level::Warning);
                if is_loss { Self::Loss(log.message) } else { Self::Mark(log.message) }
            }
            (Topic::Transforms | Topic::Cam1Calibration | Topic::Cam2Calibration | Topic::Model, _) => Self::ForViewers,
        })
    }
}

/// Converts a message of the schema to its struct. `fault` is the error for a message that no channel could have
/// carried.
fn decode_struct<M: Convert + prost::Message + Default>(data: Bytes, fault: &str) -> Result<Box<M::Struct>, String> {
    decode::<M>(data)?.to_struct().map(Box::new).ok_or_else(|| fault.to_owned())
}

fn decode<M: prost::Message + Default>(data: Bytes) -> Result<M, String> {
    M::decode(data).map_err(|e| e.to_string())
}

fn image(header: &FrameHeader, data: Bytes) -> Result<Content, String> {
    let image = decode::<RawImage>(data)?;
    let [width, height, stride] = [header.width_px, header.height_px, header.stride_bytes];
    let encoding = raw_encoding(header);
    let encoding =
        encoding.ok_or_else(|| format!("field pixel_format is {:#x}, an unknown format", header.pixel_format))?;
    if [image.width, image.height, image.step] != [width, height, stride] || image.encoding != encoding {
        return Err(format!(
            "the image is {} × {} pixels, {} bytes per row, {:?}; its header states {width} × {height}, {stride}, \
             {encoding}",
            image.width, image.height, image.step, image.encoding
        ));
    }
    if stride < min_stride_bytes(header) || image.data.len() as u64 != u64::from(stride) * u64::from(height) {
        return Err(format!("field data has {} bytes; expected {height} rows of {stride}", image.data.len()));
    }
    Ok(Content::Frame(*header, image.data))
}

fn cloud(header: &CloudHeader, data: Bytes) -> Result<Content, String> {
    let cloud = decode::<PointCloud>(data)?;
    let expected = header.points.checked_mul(RECORD_BYTES as u64);
    if cloud.point_stride as usize != RECORD_BYTES || Some(cloud.data.len() as u64) != expected {
        return Err(format!(
            "field data has {} bytes in records of {}; expected {} points of {RECORD_BYTES}",
            cloud.data.len(),
            cloud.point_stride,
            header.points
        ));
    }
    Ok(Content::Cloud(Box::new(*header), cloud.data))
}
