//! The cameras whose images one device gives.

use fringeflow_dataset::CameraId;

/// The cameras whose images one device gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CapturedCameras {
    /// One camera.
    One(CameraId),
    /// Both cameras: each image of the device holds a view of each.
    Both,
}

impl CapturedCameras {
    /// Returns the name of the service.
    pub(crate) fn service(self) -> &'static str {
        match self {
            Self::One(CameraId::Cam1) => "camera1",
            Self::One(CameraId::Cam2) => "camera2",
            Self::Both => "stereo-camera",
        }
    }

    /// Returns the only camera, or camera 1.
    pub(crate) fn first(self) -> CameraId {
        match self {
            Self::One(id) => id,
            Self::Both => CameraId::Cam1,
        }
    }

    /// Returns camera 2 if the device gives both.
    pub(crate) fn second(self) -> Option<CameraId> {
        (self == Self::Both).then_some(CameraId::Cam2)
    }
}
