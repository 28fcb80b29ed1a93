//! Messages of the channels as they are recorded: from header structs and payload bytes to protobuf, one copy.

use std::ops::Range;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{Log, PackedElementField, PointCloud, Pose, Quaternion, RawImage, Timestamp, Vector3, log};

use fringeflow::cloud::{FIELDS, RECORD_BYTES, Scalar};
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_message::{
    CloudHeader, CorrespondenceHeader, FrameHeader, MODEL_POINT_BYTES, MapsHeader, ModelHeader, PatternEvent,
    PixelFormat, PoseReport, PriorHeader, Stage, StageReport, Window, WindowReport,
};
use fringeflow_wire as wire;

use super::held::Held;
use super::{Topic, TruthPose, schema, tracking, truth_poses};

/// Key of the `data` of images and clouds: field 6, bytes.
const DATA_KEY: u8 = 6 << 3 | 2;
/// Key of the `payload` of maps: field 2, bytes.
const PAYLOAD_KEY: u8 = 2 << 3 | 2;
/// What a message takes beside its payload, at most (a mark may be longer, and is small anyway).
pub(super) const MOST_HEADER_BYTES: usize = 2048;

/// A message of a channel, with its payload, that a recording takes.
#[derive(Clone, Copy, Debug)]
pub enum Recordable<'a> {
    /// An image; which camera, its header says.
    Frame {
        /// Its header.
        header: &'a FrameHeader,
        /// Its bytes.
        image: &'a [u8],
    },
    /// A pattern event.
    Pattern(&'a PatternEvent),
    /// Phase maps of both cameras.
    Maps {
        /// Their header.
        header: &'a MapsHeader,
        /// Payload of the channel.
        payload: &'a [u8],
    },
    /// Correspondences.
    Correspondences {
        /// Their header.
        header: &'a CorrespondenceHeader,
        /// Payload of the channel.
        payload: &'a [u8],
    },
    /// A cloud.
    Cloud {
        /// Its header.
        header: &'a CloudHeader,
        /// Its records, lengths in metres.
        records: &'a [u8],
    },
    /// Report of a stage.
    Report(&'a StageReport),
    /// Figures of a window.
    WindowReport(&'a WindowReport),
    /// Where the object truly was.
    TruthPose(&'a TruthPose),
    /// Where the scanner was at a cloud, or that it is not known.
    Pose(&'a PoseReport),
    /// What is known of the windows behind a cloud.
    Prior {
        /// How the scanner moves.
        header: &'a PriorHeader,
        /// Payload of the channel: what it sees.
        relief: &'a [u8],
    },
    /// The same pose as a transform, for viewers; of a cloud that has one.
    PoseTransform(&'a PoseReport),
    /// The model as it is shown.
    Model {
        /// What it is.
        header: &'a ModelHeader,
        /// Its points.
        points: &'a [u8],
    },
    /// A mark that a person set.
    Mark {
        /// When.
        time_ns: u64,
        /// What it says.
        text: &'a str,
    },
    /// Something that happened.
    Event {
        /// When.
        time_ns: u64,
        /// Whether something was lost or went wrong.
        is_warning: bool,
        /// Stage or service; `recorder` for what the recorder itself has to say.
        source: &'a str,
        /// What it says.
        text: &'a str,
    },
}

/// One or two encoded messages that belong together: what a header describes follows it.
#[derive(Debug, Default)]
pub struct Encoded {
    /// Both messages, one after the other; without the end of the second where that is held.
    pub(super) bytes: Vec<u8>,
    /// What follows the bytes, where it lies.
    pub(super) held: Option<Held>,
    /// Where the second begins.
    pub(super) split: usize,
}

impl Encoded {
    /// The messages, each with its own topic: that of the whole, or of its header.
    pub fn parts(&self, topic: Topic) -> impl Iterator<Item = (Topic, &[u8])> {
        self.ranges(topic).map(|(topic, range)| (topic, self.bytes.get(range).unwrap_or_default()))
    }

    /// Bytes of both messages.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() + self.held.as_ref().map_or(0, |held| held.bytes().len())
    }

    /// A range of both messages: what of it was encoded, and what is held.
    pub(super) fn slices(&self, range: &Range<usize>) -> [&[u8]; 2] {
        let split = self.bytes.len();
        let encoded = self.bytes.get(range.start.min(split)..range.end.min(split));
        let held = self
            .held
            .as_ref()
            .and_then(|held| held.bytes().get(range.start.saturating_sub(split)..range.end.saturating_sub(split)));
        [encoded.unwrap_or_default(), held.unwrap_or_default()]
    }

    /// Where the messages are.
    pub(super) fn ranges(&self, topic: Topic) -> impl Iterator<Item = (Topic, Range<usize>)> + use<> {
        let end = self.len();
        let split = topic.header().map_or(0, |_| self.split.min(end));
        topic.header().map(|of_header| (of_header, 0..split)).into_iter().chain([(topic, split..end)])
    }
}

/// When a message was received or published, and the exposure it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Times {
    pub(super) log_ns: u64,
    pub(super) publish_ns: u64,
}

impl Recordable<'_> {
    /// The topic it is counted under; `None` if it contradicts itself.
    #[must_use]
    pub fn topic(&self) -> Option<Topic> {
        match self {
            Self::Frame { header, image } => {
                let fits = raw_encoding(header).is_some()
                    && header.stride_bytes >= least_stride_bytes(header)
                    && image.len() as u64 == u64::from(header.stride_bytes) * u64::from(header.height_px);
                match header.camera {
                    1 if fits => Some(Topic::Cam1Frame),
                    2 if fits => Some(Topic::Cam2Frame),
                    _ => None,
                }
            }
            Self::Pattern(_) => Some(Topic::Pattern),
            Self::Maps { header, .. } => has_steps(&header.window).then_some(Topic::PhaseMaps),
            Self::Correspondences { header, .. } => has_steps(&header.window).then_some(Topic::CorrespondenceMap),
            Self::Cloud { header, records } => {
                let fits = Some(records.len() as u64) == header.points.checked_mul(RECORD_BYTES as u64);
                (fits && has_steps(&header.window)).then_some(Topic::Cloud)
            }
            Self::Report(report) => Stage::from_code(report.stage).map(|_| Topic::Report),
            Self::WindowReport(report) => has_steps(&report.window).then_some(Topic::WindowReport),
            Self::TruthPose(_) => Some(Topic::TruthPose),
            Self::Pose(report) => (has_steps(&report.window) && report.state().is_some()).then_some(Topic::Pose),
            Self::PoseTransform(report) => report.has_pose().then_some(Topic::Transforms),
            Self::Prior { header, relief } => wire::prior::is_whole(header, relief).then_some(Topic::Prior),
            Self::Model { header, points } => {
                let expected = header.points.checked_mul(MODEL_POINT_BYTES as u64);
                (Some(points.len() as u64) == expected).then_some(Topic::Model)
            }
            Self::Mark { .. } | Self::Event { .. } => Some(Topic::Log),
        }
    }

    /// When it was received or published, nanoseconds of `CLOCK_MONOTONIC`.
    #[must_use]
    pub fn log_ns(&self) -> u64 {
        self.times().log_ns
    }

    /// When it was received or published, and the start of its exposure.
    pub(super) fn times(&self) -> Times {
        let times = |log_ns, publish_ns| Times { log_ns, publish_ns };
        match self {
            Self::Frame { header, .. } => times(header.received_ns, header.exposure_start_ns),
            Self::Pattern(event) => times(event.exposure_start_ns, event.exposure_start_ns),
            Self::Maps { header, .. } => times(header.window.received_ns, header.window.first_exposure_ns),
            Self::Correspondences { header, .. } => times(header.window.received_ns, header.window.first_exposure_ns),
            Self::Cloud { header, .. } => times(header.published_ns, header.window.first_exposure_ns),
            Self::Report(report) => times(report.time_ns, report.time_ns),
            Self::WindowReport(report) => times(report.window.received_ns, report.window.first_exposure_ns),
            Self::TruthPose(pose) => times(pose.exposure_start_ns, pose.exposure_start_ns),
            Self::Pose(report) | Self::PoseTransform(report) => {
                times(report.published_ns, report.window.first_exposure_ns)
            }
            Self::Model { header, .. } => times(header.published_ns, header.centre_ns),
            Self::Prior { header, .. } => times(header.published_ns, header.centre_ns),
            Self::Mark { time_ns, .. } | Self::Event { time_ns, .. } => times(*time_ns, *time_ns),
        }
    }

    /// Bytes that its encoded form takes, about.
    pub(super) fn size(&self) -> usize {
        let payload = match self {
            Self::Frame { image, .. } => image.len(),
            Self::Maps { payload, .. } | Self::Correspondences { payload, .. } => payload.len(),
            Self::Cloud { records, .. } => records.len(),
            Self::Model { points, .. } => points.len(),
            Self::Prior { relief, .. } => relief.len(),
            Self::Mark { text, .. } | Self::Event { text, .. } => text.len(),
            Self::Pattern(_)
            | Self::Report(_)
            | Self::WindowReport(_)
            | Self::TruthPose(_)
            | Self::Pose(_)
            | Self::PoseTransform(_) => 0,
        };
        payload + MOST_HEADER_BYTES
    }

    /// Encodes it into a buffer, whose content is replaced.
    pub fn encode(&self, out: &mut Encoded) {
        out.bytes.clear();
        out.held = None;
        let bytes = &mut out.bytes;
        match self {
            Self::Frame { header, image } => {
                encode_frame(header, image.len(), out);
                out.bytes.extend_from_slice(image);
            }
            Self::Cloud { header, records } => {
                append(bytes, &schema::CloudHeader::from_header(header));
                out.split = bytes.len();
                append(bytes, &point_cloud(header));
                append_bytes(bytes, DATA_KEY, records);
            }
            Self::Maps { header, payload } => {
                append(
                    bytes,
                    &schema::PhaseMaps { header: Some(schema::MapsHeader::from_header(header)), ..Default::default() },
                );
                append_bytes(bytes, PAYLOAD_KEY, payload);
            }
            Self::Correspondences { header, payload } => {
                let header = Some(schema::CorrespondenceHeader::from_header(header));
                append(bytes, &schema::CorrespondenceMap { header, ..Default::default() });
                append_bytes(bytes, PAYLOAD_KEY, payload);
            }
            Self::Pattern(event) => append(bytes, &schema::PatternEvent::from_event(event)),
            Self::Report(report) => append(bytes, &schema::StageReport::from_report(report).unwrap_or_default()),
            Self::WindowReport(report) => append(bytes, &schema::WindowReport::from_report(report)),
            Self::TruthPose(pose) => append(bytes, &truth_poses::encoded(pose)),
            Self::Pose(report) => append(bytes, &schema::PoseReport::from_report(report).unwrap_or_default()),
            Self::PoseTransform(report) => append(bytes, &tracking::transforms(report)),
            Self::Prior { header, relief } => append(bytes, &schema::Prior::new(header, relief)),
            Self::Model { header, points } => {
                append(bytes, &tracking::model_cloud(header));
                append_bytes(bytes, DATA_KEY, points);
            }
            Self::Mark { time_ns, text } => append(bytes, &log_message(*time_ns, log::Level::Info, "mark", text)),
            Self::Event { time_ns, is_warning, source, text } => {
                let level = if *is_warning { log::Level::Warning } else { log::Level::Info };
                append(bytes, &log_message(*time_ns, level, source, text));
            }
        }
    }
}

/// Encodes an image of so many bytes into a buffer, whose content is replaced, up to its bytes.
pub(super) fn encode_frame(header: &FrameHeader, image_bytes: usize, out: &mut Encoded) {
    let Encoded { bytes, held, split } = out;
    bytes.clear();
    *held = None;
    append(bytes, &schema::FrameHeader::from_header(header));
    *split = bytes.len();
    append(bytes, &raw_image(header));
    append_length(bytes, DATA_KEY, image_bytes);
}

/// A time as Foxglove's messages have it; those beyond 2106 are shown as 0.
pub(super) fn timestamp(time_ns: u64) -> Option<Timestamp> {
    let seconds = u32::try_from(time_ns / 1_000_000_000).ok()?;
    Timestamp::new_checked(seconds, (time_ns % 1_000_000_000) as u32)
}

fn has_steps(window: &Window) -> bool {
    window.images as usize <= MAX_IMAGES
}

fn append(bytes: &mut Vec<u8>, message: &impl prost::Message) {
    // A vector has room for everything that there is room for.
    let _ = message.encode(bytes);
}

/// Adds a field of bytes to a message that is encoded already; the order of fields does not matter.
fn append_bytes(bytes: &mut Vec<u8>, key: u8, content: &[u8]) {
    append_length(bytes, key, content.len());
    bytes.extend_from_slice(content);
}

/// Adds what stands before the content of a field of bytes.
fn append_length(bytes: &mut Vec<u8>, key: u8, length: usize) {
    bytes.push(key);
    let _ = prost::encode_length_delimiter(length, bytes);
}

/// What Foxglove calls the format of an image; `None` for one that is not recorded.
pub(super) fn raw_encoding(header: &FrameHeader) -> Option<&'static str> {
    Some(match PixelFormat::from_code(header.pixel_format)?.bytes() {
        1 => "mono8",
        _ => "mono16",
    })
}

/// Bytes of a row without a gap after it.
pub(super) fn least_stride_bytes(header: &FrameHeader) -> u32 {
    let bytes = PixelFormat::from_code(header.pixel_format).map_or(1, PixelFormat::bytes);
    header.width_px.saturating_mul(bytes as u32)
}

fn raw_image(header: &FrameHeader) -> RawImage {
    RawImage {
        timestamp: timestamp(header.exposure_start_ns),
        frame_id: format!("cam{}", header.camera),
        width: header.width_px,
        height: header.height_px,
        encoding: raw_encoding(header).unwrap_or_default().to_owned(),
        step: header.stride_bytes,
        ..RawImage::default()
    }
}

fn point_cloud(header: &CloudHeader) -> PointCloud {
    let mut offset = 0;
    let mut fields = Vec::with_capacity(FIELDS.len());
    for (name, scalar) in FIELDS {
        fields.push(PackedElementField { name: name.to_owned(), offset, r#type: numeric_type(scalar).into() });
        offset += scalar.size() as u32;
    }
    PointCloud {
        timestamp: timestamp(header.window.centre_ns),
        frame_id: "cam1".to_owned(),
        pose: Some(identity()),
        point_stride: RECORD_BYTES as u32,
        fields,
        ..PointCloud::default()
    }
}

/// Points as they stand in their frame.
pub(super) fn identity() -> Pose {
    Pose { position: Some(Vector3::default()), orientation: Some(Quaternion { w: 1.0, ..Quaternion::default() }) }
}

pub(super) fn numeric_type(scalar: Scalar) -> NumericType {
    match scalar {
        Scalar::U8 => NumericType::Uint8,
        Scalar::U16 => NumericType::Uint16,
        Scalar::I16 => NumericType::Int16,
        Scalar::F32 => NumericType::Float32,
    }
}

fn log_message(time_ns: u64, level: log::Level, name: &str, text: &str) -> Log {
    Log {
        timestamp: timestamp(time_ns),
        level: level.into(),
        message: text.to_owned(),
        name: name.to_owned(),
        ..Log::default()
    }
}
