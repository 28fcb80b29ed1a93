//! All channels: names, types and capacities.

use std::fmt;
use std::sync::Arc;

use fringeflow_message::{
    Block, CloudHeader, CorrespondenceHeader, FrameHeader, MODEL_POINT_BYTES, MapsHeader, ModelHeader, PatternEvent,
    PoseReport, PriorHeader, ScanState, StageReport, WindowReport,
};

use super::attached::Attached;
use super::{Header, Node, Payload, TransportError, publisher, subscriber};

/// Defines channels. The functions that open their ports stand in statics: so the code of iceoryx2 behind them is compiled
/// once, here, and not again in each crate that opens a port.
macro_rules! channels {
    ($(#[doc = $doc:literal] $name:ident: $id:ident, $header:ty, $payload:ty;)*) => { $(
        #[doc = $doc]
        pub const $name: Channel<$header, $payload> = {
            static PORTS: Ports<$header, $payload> = Ports::new();
            Channel { id: ChannelId::$id, ports: &PORTS }
        };
    )* };
}

channels! {
    /// Images of camera 1.
    CAM1_FRAME: Cam1Frame, FrameHeader, [u8];
    /// Images of camera 2.
    CAM2_FRAME: Cam2Frame, FrameHeader, [u8];
    /// Patterns shown by the projector.
    PROJECTOR_PATTERN: ProjectorPattern, (), PatternEvent;
    /// Phase maps of both cameras.
    PHASE_MAPS: PhaseMaps, MapsHeader, [Block];
    /// Correspondences of all pixels of camera 1.
    CORRESPONDENCE_MAP: CorrespondenceMap, CorrespondenceHeader, [Block];
    /// Point clouds.
    CLOUD: Cloud, CloudHeader, [u8];
    /// Reports of all stages.
    REPORT_STAGE: ReportStage, (), StageReport;
    /// Figures of the windows.
    REPORT_WINDOW: ReportWindow, (), WindowReport;
    /// Poses of the scanner.
    TRACKING_POSE: TrackingPose, (), PoseReport;
    /// The growing model, thinned.
    TRACKING_MODEL: TrackingModel, ModelHeader, [u8];
    /// Depth priors for the next windows.
    TRACKING_PRIOR: TrackingPrior, PriorHeader, [u8];
    /// The commanded state of the instance; a new subscriber gets the last one.
    SCAN_STATE: ScanState, (), ScanState;
}

/// A publish–subscribe channel.
///
/// | channel | iceoryx2 service, and its event service | payload | user header |
/// |---|---|---|---|
/// | `Cam1Frame`, `Cam2Frame` | `cam1/frame`, `cam2/frame` | slice of `u8` | `fringeflow.FrameHeader.1` |
/// | `ProjectorPattern` | `projector/pattern` | `fringeflow.PatternEvent.1` | none |
/// | `PhaseMaps` | `phase/maps` | slice of `fringeflow.Block.1` | `fringeflow.MapsHeader.7` |
/// | `CorrespondenceMap` | `correspondence/map` | slice of `fringeflow.Block.1` | `fringeflow.CorrespondenceHeader.7` |
/// | `Cloud` | `cloud` | slice of `u8` | `fringeflow.CloudHeader.5` |
/// | `ReportStage` | `report/stage` | `fringeflow.StageReport.6` | none |
/// | `ReportWindow` | `report/window` | `fringeflow.WindowReport.6` | none |
/// | `TrackingPose` | `tracking/pose` | `fringeflow.PoseReport.2` | none |
/// | `TrackingModel` | `tracking/model` | slice of `u8` | `fringeflow.ModelHeader.1` |
/// | `TrackingPrior` | `tracking/prior` | slice of `u8` | `fringeflow.PriorHeader.2` |
/// | `ScanState` | `control/state` | `fringeflow.ScanState.1` | none |
///
/// There is also the request–response service `control`, see [`super::ControlServer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelId {
    /// Images of camera 1.
    Cam1Frame,
    /// Images of camera 2.
    Cam2Frame,
    /// Patterns shown by the projector.
    ProjectorPattern,
    /// Phase maps of both cameras.
    PhaseMaps,
    /// Correspondences of all pixels of camera 1.
    CorrespondenceMap,
    /// Point clouds.
    Cloud,
    /// Reports of all stages.
    ReportStage,
    /// Figures of the windows.
    ReportWindow,
    /// Poses of the scanner.
    TrackingPose,
    /// The growing model, thinned.
    TrackingModel,
    /// Depth priors for the next windows.
    TrackingPrior,
    /// The commanded state of the instance.
    ScanState,
}

/// A channel together with the types of its messages: user header `H` and payload `P`.
pub struct Channel<H: Header, P: Payload + ?Sized> {
    id: ChannelId,
    pub(super) ports: &'static Ports<H, P>,
}

/// The functions that open the ports of a channel.
pub(super) struct Ports<H: Header, P: Payload + ?Sized> {
    pub(super) publisher: OpenPublisher<H, P>,
    pub(super) subscriber: OpenSubscriber<H, P>,
}

type OpenPublisher<H, P> =
    fn(&Node, Channel<H, P>, &ChannelLimits) -> Result<Attached<publisher::Port<H, P>>, TransportError>;
type OpenSubscriber<H, P> =
    fn(&Node, Channel<H, P>, &ChannelLimits) -> Result<Arc<Attached<subscriber::Port<H, P>>>, TransportError>;

/// Sizes of the messages of an instance. All its processes must use the same sizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChannelSizes {
    /// Bytes of the larger camera's image.
    pub frame_bytes: usize,
    /// Images of a window.
    pub window: usize,
    /// Blocks of the phase maps.
    pub map_blocks: usize,
    /// Blocks of the correspondences.
    pub correspondence_blocks: usize,
    /// Bytes of the largest cloud.
    pub cloud_bytes: usize,
    /// Maximum number of points of the published model; 0 without a model.
    pub model_points: usize,
    /// Bytes of the largest prior; 0 without priors.
    pub prior_bytes: usize,
}

/// Capacity of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelLimits {
    /// Maximum number of publishers. A killed publisher can be replaced at once, because its successor removes it
    /// first.
    pub publishers: usize,
    /// Maximum number of subscribers.
    pub subscribers: usize,
    /// Messages that wait for a subscriber. A further message drops the oldest.
    pub buffer: usize,
    /// Messages that a subscriber may hold at once.
    pub borrowed: usize,
    /// Messages that a new subscriber receives.
    pub history: usize,
    /// Bytes of the user header.
    pub header_bytes: usize,
    /// Bytes of a payload element.
    pub element_bytes: usize,
    /// Maximum number of elements of a payload.
    pub elements: usize,
}

impl ChannelId {
    /// All channels.
    pub const ALL: [Self; 12] = [
        Self::Cam1Frame,
        Self::Cam2Frame,
        Self::ProjectorPattern,
        Self::PhaseMaps,
        Self::CorrespondenceMap,
        Self::Cloud,
        Self::ReportStage,
        Self::ReportWindow,
        Self::TrackingPose,
        Self::TrackingModel,
        Self::TrackingPrior,
        Self::ScanState,
    ];

    /// Name of the service, and of the event service that signals its messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cam1Frame => "cam1/frame",
            Self::Cam2Frame => "cam2/frame",
            Self::ProjectorPattern => "projector/pattern",
            Self::PhaseMaps => "phase/maps",
            Self::CorrespondenceMap => "correspondence/map",
            Self::Cloud => "cloud",
            Self::ReportStage => "report/stage",
            Self::ReportWindow => "report/window",
            Self::TrackingPose => "tracking/pose",
            Self::TrackingModel => "tracking/model",
            Self::TrackingPrior => "tracking/prior",
            Self::ScanState => "control/state",
        }
    }

    /// Capacity of the channel.
    #[must_use]
    pub fn limits(self, sizes: &ChannelSizes) -> ChannelLimits {
        type Limits = ChannelLimits;
        // The phase service holds a window, the current run of images, and images that wait for their partner.
        let borrowed = 3 * sizes.window + 4;
        let frame = Limits { borrowed, ..Limits::for_elements::<FrameHeader, u8>(sizes.frame_bytes, 16) };
        match self {
            Self::Cam1Frame | Self::Cam2Frame => frame,
            Self::ProjectorPattern => Limits::for_elements::<(), PatternEvent>(1, 64),
            Self::PhaseMaps => Limits::for_elements::<MapsHeader, Block>(sizes.map_blocks, 2),
            Self::CorrespondenceMap => {
                Limits::for_elements::<CorrespondenceHeader, Block>(sizes.correspondence_blocks, 2)
            }
            Self::Cloud => Limits::for_elements::<CloudHeader, u8>(sizes.cloud_bytes, 2),
            Self::ReportStage => {
                Limits { publishers: 16, subscribers: 8, ..Limits::for_elements::<(), StageReport>(1, 256) }
            }
            Self::ReportWindow => Limits::for_elements::<(), WindowReport>(1, 64),
            // A status query gets the last pose even while no clouds arrive.
            Self::TrackingPose => {
                Limits { subscribers: 8, history: 1, ..Limits::for_elements::<(), PoseReport>(1, 64) }
            }
            // A late subscriber gets the current model before the next update.
            Self::TrackingModel => {
                let bytes = sizes.model_points.max(1) * MODEL_POINT_BYTES;
                Limits { history: 1, ..Limits::for_elements::<ModelHeader, u8>(bytes, 2) }
            }
            // A restarted service receives the last prior.
            Self::TrackingPrior => {
                Limits { history: 1, ..Limits::for_elements::<PriorHeader, u8>(sizes.prior_bytes.max(1), 16) }
            }
            Self::ScanState => Limits { subscribers: 16, history: 1, ..Limits::for_elements::<(), ScanState>(1, 64) },
        }
    }
}

impl ChannelLimits {
    /// Limits of one publisher, and four subscribers that hold one message while they receive the next.
    fn for_elements<H, E>(elements: usize, buffer: usize) -> Self {
        Self {
            publishers: 1,
            subscribers: 4,
            buffer,
            borrowed: 2,
            history: 0,
            header_bytes: size_of::<H>(),
            element_bytes: size_of::<E>(),
            elements,
        }
    }
}

impl<H: Header, P: Payload + ?Sized> Ports<H, P> {
    const fn new() -> Self {
        Self { publisher: publisher::Port::open, subscriber: subscriber::Port::open }
    }
}

impl<H: Header, P: Payload + ?Sized> Channel<H, P> {
    /// Identifier of the channel.
    #[must_use]
    pub fn id(self) -> ChannelId {
        self.id
    }

    /// Name of the service.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.id.name()
    }
}

impl<H: Header, P: Payload + ?Sized> Clone for Channel<H, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<H: Header, P: Payload + ?Sized> Copy for Channel<H, P> {}

impl<H: Header, P: Payload + ?Sized> fmt::Debug for Channel<H, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Channel").field(&self.id).finish()
    }
}
