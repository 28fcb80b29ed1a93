//! Which services an instance has, and in which order.

use fringeflow::config::{CameraSource, ProjectorDriver, ScannerConfiguration};
use fringeflow::message::Stage;

/// A service that the supervisor can start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServiceKind {
    /// The virtual projector.
    VirtualProjector,
    /// The virtual cameras.
    VirtualCameras,
    /// Images to phase maps.
    Phase,
    /// Phase maps to correspondences.
    Correspondence,
    /// Correspondences to clouds.
    Cloud,
    /// Everything to a recording.
    Recorder,
}

impl ServiceKind {
    /// Its name as an argument of `fringeflow service`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::VirtualProjector => "virtual-projector",
            Self::VirtualCameras => "virtual-cameras",
            Self::Phase => "phase",
            Self::Correspondence => "correspondence",
            Self::Cloud => "cloud",
            Self::Recorder => "recorder",
        }
    }

    /// The stages whose accounts it keeps, in the order of the pipeline.
    #[must_use]
    pub fn stages(self) -> &'static [Stage] {
        match self {
            Self::VirtualProjector => &[Stage::Projector],
            Self::VirtualCameras => &[Stage::Camera1, Stage::Camera2],
            Self::Phase => &[Stage::Pattern, Stage::Pairing, Stage::Windowing, Stage::Phase],
            Self::Correspondence => &[Stage::Correspondence],
            Self::Cloud => &[Stage::Cloud],
            Self::Recorder => &[Stage::Recorder],
        }
    }
}

/// The services of a live instance in the order of the pipeline, which is that in which they stop.
#[must_use]
pub fn live_services(configuration: &ScannerConfiguration) -> Vec<ServiceKind> {
    let projector = (configuration.projector == ProjectorDriver::Virtual).then_some(ServiceKind::VirtualProjector);
    let cameras = (configuration.cameras == CameraSource::Virtual).then_some(ServiceKind::VirtualCameras);
    projector.into_iter().chain(cameras).chain(WORKERS).chain([ServiceKind::Recorder]).collect()
}

/// The services that make clouds of images, in the order of the pipeline.
pub const WORKERS: [ServiceKind; 3] = [ServiceKind::Phase, ServiceKind::Correspondence, ServiceKind::Cloud];
