//! Messages of a recording, decoded.

use foxglove::messages::{Log, PointCloud, RawImage, log};
use prost::Message as _;
use prost::bytes::Bytes;

use fringeflow::cloud::RECORD_BYTES;
use fringeflow::geometry::Pose;
use fringeflow_message::{
    CloudHeader, CorrespondenceHeader, FrameHeader, MapsHeader, PatternEvent, PoseReport, PriorHeader, StageReport,
    WindowReport,
};

use super::recordable::{least_stride_bytes, raw_encoding};
use super::{Topic, schema, truth_poses};

/// A message of a recording.
#[derive(Clone, Debug)]
pub struct Message {
    /// Its topic.
    pub topic: Topic,
    /// When it was received or published.
    pub log_ns: u64,
    /// Start of its exposure.
    pub publish_ns: u64,
    /// What it says.
    pub content: Content,
}

/// What a message says; payloads are those of the channels.
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
    /// A cloud: its records, lengths in metres.
    Cloud(Box<CloudHeader>, Bytes),
    /// Report of a stage.
    Report(Box<StageReport>),
    /// Figures of a window.
    WindowReport(Box<WindowReport>),
    /// Where the object truly was: its pose in the frame of the exact camera 1, metres.
    TruthPose(Pose),
    /// Where the scanner was at a cloud.
    Pose(Box<PoseReport>),
    /// What is known of the windows behind a cloud: payload of the channel.
    Prior(Box<PriorHeader>, Bytes),
    /// A mark that a person set.
    Mark(String),
    /// What the recorder said about its own losses.
    Loss(String),
    /// What says again for viewers what stands elsewhere: calibration, transforms.
    ForViewers,
}

/// Decoded header of an image or a cloud.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Header {
    Frame(FrameHeader),
    Cloud(Box<CloudHeader>),
}

impl Header {
    /// Decodes a message of a header topic.
    pub(super) fn decode(topic: Topic, data: &[u8]) -> Result<Self, String> {
        let camera = match topic {
            Topic::Cam1Header => 1,
            Topic::Cam2Header => 2,
            _ => {
                let header = schema::CloudHeader::decode(data).map_err(|e| e.to_string())?;
                let header = header.to_message().ok_or("field window is missing or contradicts itself")?;
                return Ok(Self::Cloud(Box::new(header)));
            }
        };
        let header = schema::FrameHeader::decode(data).map_err(|e| e.to_string())?.to_message();
        if header.camera != camera {
            return Err(format!("field camera is {}; expected {camera}", header.camera));
        }
        Ok(Self::Frame(header))
    }
}

impl Content {
    /// Decodes a message; `header` is the one beside it, where its topic has one.
    pub(super) fn decode(topic: Topic, header: Option<&Header>, data: Bytes) -> Result<Self, String> {
        match (topic, header) {
            (Topic::Cam1Frame | Topic::Cam2Frame, Some(Header::Frame(header))) => image(header, data),
            (Topic::Cloud, Some(Header::Cloud(header))) => cloud(header, data),
            (Topic::Cam1Frame | Topic::Cam2Frame | Topic::Cloud, _) => Err("its header is missing".to_owned()),
            (Topic::Pattern, _) => Ok(Self::Pattern(decode::<schema::PatternEvent>(data)?.to_message())),
            (Topic::PhaseMaps, _) => {
                let maps = decode::<schema::PhaseMaps>(data)?;
                let header = maps.header.and_then(|header| header.to_message());
                let header = header.ok_or("field header is missing or contradicts itself")?;
                Ok(Self::Maps(Box::new(header), maps.payload))
            }
            (Topic::CorrespondenceMap, _) => {
                let map = decode::<schema::CorrespondenceMap>(data)?;
                let header = map.header.and_then(|header| header.to_message());
                let header = header.ok_or("field header is missing or contradicts itself")?;
                Ok(Self::Correspondences(Box::new(header), map.payload))
            }
            (Topic::Report, _) => {
                let report = decode::<schema::StageReport>(data)?.to_message();
                Ok(Self::Report(Box::new(report.ok_or("field stage or dropped has an unknown name")?)))
            }
            (Topic::WindowReport, _) => {
                let report = decode::<schema::WindowReport>(data)?.to_message();
                let report = report.ok_or("field window or outcomes is missing or contradicts itself")?;
                Ok(Self::WindowReport(Box::new(report)))
            }
            (Topic::TruthPose, _) => Ok(Self::TruthPose(truth_poses::decoded(&decode(data)?)?)),
            (Topic::Pose, _) => {
                let report = decode::<schema::PoseReport>(data)?.to_message();
                Ok(Self::Pose(Box::new(
                    report.ok_or("field window, state, reason or pose is missing or contradicts itself")?,
                )))
            }
            (Topic::Prior, _) => {
                let (header, relief) = decode::<schema::Prior>(data)?.into_message();
                let header = header.ok_or("field velocity_m_s, rate_rad_s or relief contradicts itself")?;
                Ok(Self::Prior(Box::new(header), relief))
            }
            (Topic::Log, _) => {
                let log = decode::<Log>(data)?;
                let is_loss = log.level >= i32::from(log::Level::Warning);
                Ok(if is_loss { Self::Loss(log.message) } else { Self::Mark(log.message) })
            }
            (Topic::Transforms | Topic::Cam1Calibration | Topic::Cam2Calibration | Topic::Model, _) => {
                Ok(Self::ForViewers)
            }
            (Topic::Cam1Header | Topic::Cam2Header | Topic::CloudHeader, _) => {
                Err("it describes nothing that is there".to_owned())
            }
        }
    }
}

fn decode<M: prost::Message + Default>(data: Bytes) -> Result<M, String> {
    M::decode(data).map_err(|e| e.to_string())
}

fn image(header: &FrameHeader, data: Bytes) -> Result<Content, String> {
    let image = decode::<RawImage>(data)?;
    let [width, height, stride] = [header.width_px, header.height_px, header.stride_bytes];
    let encoding = raw_encoding(header);
    let encoding =
        encoding.ok_or_else(|| format!("field pixel_format is {:#x}, which is unknown", header.pixel_format))?;
    if [image.width, image.height, image.step] != [width, height, stride] || image.encoding != encoding {
        return Err(format!(
            "the image is {} × {} pixels, {} bytes a row, {:?}; its header says {width} × {height}, {stride}, {encoding}",
            image.width, image.height, image.step, image.encoding
        ));
    }
    if stride < least_stride_bytes(header) || image.data.len() as u64 != u64::from(stride) * u64::from(height) {
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
