//! Encodes the messages of the channels: converts header structs and payload bytes to protobuf, with one copy.

use std::ops::Range;

use foxglove::messages::log;
use prost::bytes::Bytes;

use fringeflow::cloud::RECORD_BYTES;
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_message::{
    CloudHeader, CorrespondenceHeader, FrameHeader, MODEL_POINT_BYTES, MapsHeader, ModelHeader, PatternEvent,
    PixelFormat, PoseReport, PriorHeader, Stage, StageReport, Window, WindowReport,
};
use fringeflow_wire as wire;

use crate::convert::Convert;
use crate::held_content::HeldContent;
use crate::viewers::{self, log_message};
use crate::{Topic, TruthPose, WallClock, schema, truth_poses};

/// Key of the `data` of images and clouds: field 6, bytes.
const DATA_KEY: u8 = 6 << 3 | 2;
/// Key of the `payload` of maps: field 2, bytes.
const PAYLOAD_KEY: u8 = 2 << 3 | 2;
/// Maximum encoded size without payload, bytes. Only a mark can be longer; it is still small.
pub(super) const MAX_HEADER_BYTES: usize = 2048;

/// A message of a channel with its payload, ready to be recorded.
#[derive(Clone, Copy, Debug)]
pub enum Recordable<'a> {
    /// An image. Its header states the camera.
    Frame {
        /// Header of the image.
        header: &'a FrameHeader,
        /// Bytes of the image.
        image: &'a [u8],
    },
    /// A pattern event.
    Pattern(&'a PatternEvent),
    /// Phase maps of both cameras.
    Maps {
        /// Header of the maps.
        header: &'a MapsHeader,
        /// Payload of the channel.
        payload: &'a [u8],
    },
    /// Correspondences.
    Correspondences {
        /// Header of the correspondences.
        header: &'a CorrespondenceHeader,
        /// Payload of the channel.
        payload: &'a [u8],
    },
    /// A cloud.
    Cloud {
        /// Header of the cloud.
        header: &'a CloudHeader,
        /// Records of the points, lengths in metres.
        records: &'a [u8],
    },
    /// Report of a stage.
    Report(&'a StageReport),
    /// Report on the quality of a window.
    WindowReport(&'a WindowReport),
    /// True pose of the object.
    TruthPose(&'a TruthPose),
    /// Pose of the scanner at a cloud, or the reason why it is unknown.
    Pose(&'a PoseReport),
    /// Prior of the windows after a cloud.
    Prior {
        /// Header with the motion of the scanner.
        header: &'a PriorHeader,
        /// Payload of the channel: the coarse depth.
        relief: &'a [u8],
    },
    /// Pose of a tracked cloud as a transform, for viewers.
    PoseTransform(&'a PoseReport),
    /// The model, for viewers.
    Model {
        /// Header of the model.
        header: &'a ModelHeader,
        /// Points of the model.
        points: &'a [u8],
    },
    /// A mark that a user set.
    Mark {
        /// Time of the mark.
        time_ns: u64,
        /// Text of the mark.
        text: &'a str,
    },
    /// A log message.
    Event {
        /// Time of the event.
        time_ns: u64,
        /// Whether something was lost or failed.
        is_warning: bool,
        /// Name of the stage or service; `recorder` for messages of the recorder itself.
        source: &'a str,
        /// Text of the event.
        text: &'a str,
    },
}

/// One encoded message, or a header and the message that it describes.
#[derive(Debug, Default)]
pub struct Encoded {
    /// Both messages one after the other, without the held content at the end.
    pub(super) bytes: Vec<u8>,
    /// Content that follows `bytes` and is not copied.
    pub(super) held: Option<HeldContent>,
    /// Start of the second message.
    pub(super) split: usize,
}

impl Encoded {
    /// Returns the messages with their topics: the header, if `topic` has headers, and the message of `topic`.
    pub fn parts(&self, topic: Topic) -> impl Iterator<Item = (Topic, &[u8])> {
        self.ranges(topic).map(|(topic, range)| (topic, self.bytes.get(range).unwrap_or_default()))
    }

    /// Returns the size of both messages, bytes.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() + self.held.as_ref().map_or(0, |held| held.bytes().len())
    }

    /// Returns a range of both messages, as its encoded bytes and its held bytes.
    pub(super) fn slices(&self, range: &Range<usize>) -> [&[u8]; 2] {
        let split = self.bytes.len();
        let encoded = self.bytes.get(range.start.min(split)..range.end.min(split));
        let held = self
            .held
            .as_ref()
            .and_then(|held| held.bytes().get(range.start.saturating_sub(split)..range.end.saturating_sub(split)));
        [encoded.unwrap_or_default(), held.unwrap_or_default()]
    }

    /// Returns the byte ranges of the messages, with their topics.
    pub(super) fn ranges(&self, topic: Topic) -> impl Iterator<Item = (Topic, Range<usize>)> + use<> {
        let end = self.len();
        let split = topic.header().map_or(0, |_| self.split.min(end));
        topic.header().map(|header_topic| (header_topic, 0..split)).into_iter().chain([(topic, split..end)])
    }
}

/// Time of receipt or publication, and start of the exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Times {
    pub(super) log_ns: u64,
    pub(super) publish_ns: u64,
}

impl Recordable<'_> {
    /// Returns the topic under which the message is counted; `None` if the message contradicts itself.
    #[must_use]
    pub fn topic(&self) -> Option<Topic> {
        match self {
            Self::Frame { header, image } => {
                let fits = viewers::raw_encoding(header).is_some()
                    && header.stride_bytes >= min_stride_bytes(header)
                    && image.len() as u64 == u64::from(header.stride_bytes) * u64::from(header.height_px);
                match header.camera {
                    1 if fits => Some(Topic::Cam1Frame),
                    2 if fits => Some(Topic::Cam2Frame),
                    _ => None,
                }
            }
            Self::Pattern(_) => Some(Topic::Pattern),
            Self::Maps { header, .. } => has_possible_length(&header.window).then_some(Topic::PhaseMaps),
            Self::Correspondences { header, .. } => {
                has_possible_length(&header.window).then_some(Topic::CorrespondenceMap)
            }
            Self::Cloud { header, records } => {
                let fits = Some(records.len() as u64) == header.points.checked_mul(RECORD_BYTES as u64);
                (fits && has_possible_length(&header.window)).then_some(Topic::Cloud)
            }
            Self::Report(report) => Stage::from_code(report.stage).map(|_| Topic::Report),
            Self::WindowReport(report) => has_possible_length(&report.window).then_some(Topic::WindowReport),
            Self::TruthPose(_) => Some(Topic::TruthPose),
            Self::Pose(report) => {
                (has_possible_length(&report.window) && report.state().is_some()).then_some(Topic::Pose)
            }
            Self::PoseTransform(report) => report.has_pose().then_some(Topic::Transforms),
            Self::Prior { header, relief } => wire::prior::is_consistent(header, relief).then_some(Topic::Prior),
            Self::Model { header, points } => {
                let expected = header.points.checked_mul(MODEL_POINT_BYTES as u64);
                (Some(points.len() as u64) == expected).then_some(Topic::Model)
            }
            Self::Mark { .. } | Self::Event { .. } => Some(Topic::Log),
        }
    }

    /// Time of receipt or publication, nanoseconds of `CLOCK_MONOTONIC`.
    #[must_use]
    pub fn log_ns(&self) -> u64 {
        self.times().log_ns
    }

    /// Time of receipt or publication, and start of the exposure.
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

    /// Returns the approximate size of the encoded form, bytes.
    #[must_use]
    pub fn encoded_size(&self) -> usize {
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
        payload + MAX_HEADER_BYTES
    }

    /// Encodes the message into a buffer and replaces its content. `clock` converts the time stamps of messages in the
    /// schemas of Foxglove.
    pub fn encode(&self, clock: WallClock, out: &mut Encoded) {
        let payload = self.encode_head(clock, out);
        out.bytes.extend_from_slice(payload);
    }

    /// Encodes the message into a buffer and replaces its content. The payload is left out and returned; it comes last.
    pub(super) fn encode_head(&self, clock: WallClock, out: &mut Encoded) -> &[u8] {
        let Encoded { bytes, held, split } = out;
        bytes.clear();
        *held = None;
        let mut payload_field = None;
        match self {
            Self::Frame { header, image } => {
                append_struct::<schema::FrameHeader>(bytes, header);
                *split = bytes.len();
                append(bytes, &viewers::raw_image(header, clock));
                payload_field = Some((DATA_KEY, *image));
            }
            Self::Cloud { header, records } => {
                append_struct::<schema::CloudHeader>(bytes, header);
                *split = bytes.len();
                append(bytes, &viewers::point_cloud(header, clock));
                payload_field = Some((DATA_KEY, *records));
            }
            Self::Maps { header, payload } => {
                let header = schema::MapsHeader::from_struct(header);
                append(bytes, &schema::PhaseMaps { header, ..Default::default() });
                payload_field = Some((PAYLOAD_KEY, *payload));
            }
            Self::Correspondences { header, payload } => {
                let header = schema::CorrespondenceHeader::from_struct(header);
                append(bytes, &schema::CorrespondenceMap { header, ..Default::default() });
                payload_field = Some((PAYLOAD_KEY, *payload));
            }
            Self::Pattern(event) => append_struct::<schema::PatternEvent>(bytes, event),
            Self::Report(report) => append_struct::<schema::StageReport>(bytes, report),
            Self::WindowReport(report) => append_struct::<schema::WindowReport>(bytes, report),
            Self::TruthPose(pose) => append(bytes, &truth_poses::encode(pose, clock)),
            Self::Pose(report) => append_struct::<schema::PoseReport>(bytes, report),
            Self::PoseTransform(report) => append(bytes, &viewers::pose_transforms(report, clock)),
            Self::Prior { header, relief } => {
                let prior = schema::Prior::from_struct(header).unwrap_or_default();
                append(bytes, &schema::Prior { relief: Bytes::copy_from_slice(relief), ..prior });
            }
            Self::Model { header, points } => {
                append(bytes, &viewers::model_cloud(header, clock));
                payload_field = Some((DATA_KEY, *points));
            }
            Self::Mark { time_ns, text } => {
                append(bytes, &log_message(clock.unix_ns(*time_ns), log::Level::Info, "mark", text));
            }
            Self::Event { time_ns, is_warning, source, text } => {
                let level = if *is_warning { log::Level::Warning } else { log::Level::Info };
                append(bytes, &log_message(clock.unix_ns(*time_ns), level, source, text));
            }
        }
        let Some((key, payload)) = payload_field else { return &[] };
        // The order of the fields does not matter, so the payload can be the last one.
        bytes.push(key);
        let _ = prost::encode_length_delimiter(payload.len(), bytes);
        payload
    }
}

fn has_possible_length(window: &Window) -> bool {
    window.images as usize <= MAX_IMAGES
}

fn append(bytes: &mut Vec<u8>, message: &impl prost::Message) {
    // Encoding to a vector cannot fail, because the vector grows.
    let _ = message.encode(bytes);
}

fn append_struct<M: Convert + prost::Message + Default>(bytes: &mut Vec<u8>, source: &M::Struct) {
    append(bytes, &M::from_struct(source).unwrap_or_default());
}

/// Size of a row without padding, bytes.
pub(super) fn min_stride_bytes(header: &FrameHeader) -> u32 {
    let bytes = PixelFormat::from_code(header.pixel_format).map_or(1, PixelFormat::bytes);
    header.width_px.saturating_mul(bytes as u32)
}
