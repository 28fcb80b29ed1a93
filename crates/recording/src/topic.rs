//! The topics of a recording and their schemas.

use foxglove::messages::{CameraCalibration, FrameTransform, FrameTransforms, Log, PointCloud, RawImage};
use foxglove::{Encode, Schema};

use crate::schema::DESCRIPTOR;

/// A topic of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Topic {
    /// Images of camera 1.
    Cam1Frame,
    /// Headers of the images of camera 1.
    Cam1Header,
    /// Images of camera 2.
    Cam2Frame,
    /// Headers of the images of camera 2.
    Cam2Header,
    /// Pattern events of the projector.
    Pattern,
    /// Phase maps of both cameras.
    PhaseMaps,
    /// Correspondences.
    CorrespondenceMap,
    /// Clouds.
    Cloud,
    /// Headers of the clouds.
    CloudHeader,
    /// Reports of the stages.
    Report,
    /// Marks, and losses of the recorder.
    Log,
    /// Poses of cameras, projector and measurement volume.
    Transforms,
    /// Calibration of camera 1.
    Cam1Calibration,
    /// Calibration of camera 2.
    Cam2Calibration,
    /// Figures of the windows.
    WindowReport,
    /// True pose of the object, at every exposure.
    TruthPose,
    /// Pose of the scanner, at every cloud.
    Pose,
    /// The growing model. It is only shown live, since the clouds can rebuild it.
    Model,
    /// Prior of the next windows, after every cloud.
    Prior,
}

impl Topic {
    /// All topics.
    pub const ALL: [Self; 19] = [
        Self::Cam1Frame,
        Self::Cam1Header,
        Self::Cam2Frame,
        Self::Cam2Header,
        Self::Pattern,
        Self::PhaseMaps,
        Self::CorrespondenceMap,
        Self::Cloud,
        Self::CloudHeader,
        Self::Report,
        Self::Log,
        Self::Transforms,
        Self::Cam1Calibration,
        Self::Cam2Calibration,
        Self::WindowReport,
        Self::TruthPose,
        Self::Pose,
        Self::Model,
        Self::Prior,
    ];

    /// Name of the topic in the file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cam1Frame => "/cam1/frame",
            Self::Cam1Header => "/cam1/header",
            Self::Cam2Frame => "/cam2/frame",
            Self::Cam2Header => "/cam2/header",
            Self::Pattern => "/projector/pattern",
            Self::PhaseMaps => "/phase/maps",
            Self::CorrespondenceMap => "/correspondence/map",
            Self::Cloud => "/cloud",
            Self::CloudHeader => "/cloud/header",
            Self::Report => "/report/stage",
            Self::Log => "/log",
            Self::Transforms => "/tf",
            Self::Cam1Calibration => "/cam1/calibration",
            Self::Cam2Calibration => "/cam2/calibration",
            Self::WindowReport => "/report/window",
            Self::TruthPose => "/truth/pose",
            Self::Pose => "/tracking/pose",
            Self::Model => "/tracking/model",
            Self::Prior => "/tracking/prior",
        }
    }

    /// The topic of a name; `None` for an unknown name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// MCAP channel of the topic. It is the same in every recording, so that messages survive the loss of the channel record.
    pub(super) fn channel_id(self) -> u16 {
        self as u16 + 1
    }

    /// The topic with the headers of this topic, if it has headers.
    #[must_use]
    pub fn header(self) -> Option<Self> {
        match self {
            Self::Cam1Frame => Some(Self::Cam1Header),
            Self::Cam2Frame => Some(Self::Cam2Header),
            Self::Cloud => Some(Self::CloudHeader),
            _ => None,
        }
    }

    /// Whether the topic only serves viewers.
    pub(super) fn is_for_viewers(self) -> bool {
        matches!(self, Self::Transforms | Self::Cam1Calibration | Self::Cam2Calibration | Self::Model)
    }

    /// Whether the topic has the headers of another topic.
    pub(super) fn is_header(self) -> bool {
        matches!(self, Self::Cam1Header | Self::Cam2Header | Self::CloudHeader)
    }

    /// Schema of the messages.
    #[must_use]
    pub fn schema(self) -> Option<Schema> {
        let own = |name: &str| Some(Schema::new(format!("fringeflow.{name}"), "protobuf", DESCRIPTOR));
        match self {
            Self::Cam1Frame | Self::Cam2Frame => RawImage::get_schema(),
            Self::Cam1Header | Self::Cam2Header => own("FrameHeader"),
            Self::Pattern => own("PatternEvent"),
            Self::PhaseMaps => own("PhaseMaps"),
            Self::CorrespondenceMap => own("CorrespondenceMap"),
            Self::Cloud | Self::Model => PointCloud::get_schema(),
            Self::CloudHeader => own("CloudHeader"),
            Self::Report => own("StageReport"),
            Self::WindowReport => own("WindowReport"),
            Self::Pose => own("PoseReport"),
            Self::Prior => own("Prior"),
            Self::Log => Log::get_schema(),
            Self::Transforms => FrameTransforms::get_schema(),
            Self::TruthPose => FrameTransform::get_schema(),
            Self::Cam1Calibration | Self::Cam2Calibration => CameraCalibration::get_schema(),
        }
    }
}
