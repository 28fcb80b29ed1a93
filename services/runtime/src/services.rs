//! The services of an instance, and their order.

use fringeflow_config::{CameraSource, ProjectorDriver, ScannerConfiguration};
use fringeflow_message::Stage;

/// A process of an instance that its supervisor starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServiceKind {
    /// The virtual projector.
    VirtualProjector,
    /// The virtual cameras.
    VirtualCameras,
    /// Camera 1, a V4L2 device.
    Camera1,
    /// Camera 2, a V4L2 device.
    Camera2,
    /// Both cameras, one V4L2 device.
    StereoCamera,
    /// From images to phase maps.
    Phase,
    /// From phase maps to correspondences.
    Correspondence,
    /// From correspondences to clouds.
    Cloud,
    /// From clouds to poses and a model.
    Tracking,
    /// From all channels to a recording.
    Recorder,
    /// Metrics, dashboard, live view.
    Monitor,
}

impl ServiceKind {
    /// All services, in the order of the pipeline.
    pub const ALL: [Self; 11] = [
        Self::VirtualProjector,
        Self::VirtualCameras,
        Self::Camera1,
        Self::Camera2,
        Self::StereoCamera,
        Self::Phase,
        Self::Correspondence,
        Self::Cloud,
        Self::Tracking,
        Self::Recorder,
        Self::Monitor,
    ];

    /// Returns the name, as an argument of `fringeflow service`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::VirtualProjector => "virtual-projector",
            Self::VirtualCameras => "virtual-cameras",
            Self::Camera1 => "camera1",
            Self::Camera2 => "camera2",
            Self::StereoCamera => "stereo-camera",
            Self::Phase => "phase",
            Self::Correspondence => "correspondence",
            Self::Cloud => "cloud",
            Self::Tracking => "tracking",
            Self::Recorder => "recorder",
            Self::Monitor => "monitor",
        }
    }

    /// Returns whether the service uses the segment table.
    #[must_use]
    pub fn reads_segment_table(self) -> bool {
        matches!(self, Self::Correspondence | Self::Cloud)
    }

    /// Returns the stages whose accounts the service keeps, in the order of the pipeline.
    #[must_use]
    pub fn stages(self) -> &'static [Stage] {
        match self {
            Self::VirtualProjector => &[Stage::Projector],
            Self::VirtualCameras | Self::StereoCamera => &[Stage::Camera1, Stage::Camera2],
            Self::Camera1 => &[Stage::Camera1],
            Self::Camera2 => &[Stage::Camera2],
            Self::Phase => &[Stage::Pattern, Stage::Pairing, Stage::Windowing, Stage::Phase],
            Self::Correspondence => &[Stage::Correspondence],
            Self::Cloud => &[Stage::Cloud],
            Self::Tracking => &[Stage::Tracking],
            Self::Recorder => &[Stage::Recorder],
            Self::Monitor => &[],
        }
    }
}

/// Returns the services of a live instance in the order of the pipeline, in which they stop too.
#[must_use]
pub fn live_services(configuration: &ScannerConfiguration) -> Vec<ServiceKind> {
    let projector = (configuration.projector == ProjectorDriver::Virtual).then_some(ServiceKind::VirtualProjector);
    let cameras: &[ServiceKind] = match configuration.cameras {
        CameraSource::Virtual => &[ServiceKind::VirtualCameras],
        CameraSource::V4l2(_) => &[ServiceKind::Camera1, ServiceKind::Camera2],
        CameraSource::V4l2Stereo(_) => &[ServiceKind::StereoCamera],
        CameraSource::External => &[],
    };
    let monitor = configuration.monitor.is_enabled.then_some(ServiceKind::Monitor);
    let scan = projector.into_iter().chain(cameras.iter().copied()).chain(measurement_services(configuration));
    scan.chain([ServiceKind::Recorder]).chain(monitor).collect()
}

/// Returns the services from images to clouds, and to poses if the tracking is enabled, in the order of the pipeline.
pub fn measurement_services(configuration: &ScannerConfiguration) -> impl Iterator<Item = ServiceKind> {
    let tracking = configuration.measurement.tracking.is_enabled.then_some(ServiceKind::Tracking);
    [ServiceKind::Phase, ServiceKind::Correspondence, ServiceKind::Cloud].into_iter().chain(tracking)
}
