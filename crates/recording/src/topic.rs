//! The topics of a recording and their schemas.

use foxglove::messages::{CameraCalibration, FrameTransform, FrameTransforms, Log, PointCloud, RawImage};
use foxglove::{Encode, Schema};

use crate::schema::DESCRIPTOR;

/// Encoding of all messages.
const ENCODING: &str = "protobuf";

/// Defines [`Topic`] from a table: name in the file and content of each topic.
macro_rules! topics {
    ($($Topic:ident = $name:literal, $content:literal;)*) => {
        /// A topic of a recording.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Topic {
            $(#[doc = $content] $Topic,)*
        }

        impl Topic {
            /// All topics.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$Topic),*];

            /// Name of the topic in the file.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Topic => $name,)*
                }
            }
        }
    };
}

// The order determines the MCAP channels, so new topics must be added at the end.
topics! {
    Cam1Frame = "/cam1/frame", "Images of camera 1.";
    Cam1Header = "/cam1/header", "Headers of the images of camera 1.";
    Cam2Frame = "/cam2/frame", "Images of camera 2.";
    Cam2Header = "/cam2/header", "Headers of the images of camera 2.";
    Pattern = "/projector/pattern", "Pattern events of the projector.";
    PhaseMaps = "/phase/maps", "Phase maps of both cameras.";
    CorrespondenceMap = "/correspondence/map", "Correspondences.";
    Cloud = "/cloud", "Clouds.";
    CloudHeader = "/cloud/header", "Headers of the clouds.";
    Report = "/report/stage", "Reports of the stages.";
    Log = "/log", "Marks, and losses of the recorder.";
    Transforms = "/tf", "Poses of cameras, projector and measurement volume.";
    Cam1Calibration = "/cam1/calibration", "Calibration of camera 1.";
    Cam2Calibration = "/cam2/calibration", "Calibration of camera 2.";
    WindowReport = "/report/window", "Quality of each window.";
    TruthPose = "/truth/pose", "True pose of the object, at every exposure.";
    Pose = "/tracking/pose", "Pose of the scanner, at every cloud.";
    Model = "/tracking/model", "The growing model. It is only shown live, because it can be rebuilt from the clouds.";
    Prior = "/tracking/prior", "Prior of the next windows, after every cloud.";
}

impl Topic {
    /// Returns the topic with this name; `None` for an unknown name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// Returns the topic of a channel; `None` if another program uses the name for other messages. A channel without a
    /// schema is taken by its name.
    pub(super) fn of_channel(name: &str, schema: &str, encoding: &str) -> Option<Self> {
        let has_schema = |topic: &Self| schema.is_empty() || topic.schema().is_some_and(|own| own.name == schema);
        Self::from_name(name).filter(|topic| encoding == ENCODING && has_schema(topic))
    }

    /// MCAP channel of the topic. It is the same in every recording, so that messages can be read even if the channel
    /// record is lost.
    pub(super) fn channel_id(self) -> u16 {
        self as u16 + 1
    }

    /// Returns the topic with the headers of this topic, if it has headers.
    #[must_use]
    pub fn header(self) -> Option<Self> {
        match self {
            Self::Cam1Frame => Some(Self::Cam1Header),
            Self::Cam2Frame => Some(Self::Cam2Header),
            Self::Cloud => Some(Self::CloudHeader),
            _ => None,
        }
    }

    /// Whether the topic is only for viewers.
    pub(super) fn is_for_viewers(self) -> bool {
        matches!(self, Self::Transforms | Self::Cam1Calibration | Self::Cam2Calibration | Self::Model)
    }

    /// Whether the topic contains the headers of another topic.
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
