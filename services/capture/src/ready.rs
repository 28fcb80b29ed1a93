//! A camera made ready to stream, from its name in the configuration on; and both looked at before anything starts: are
//! they there, and do they take what is wanted?

use std::path::PathBuf;

use fringeflow::config::V4l2Camera;

use crate::find::{self, FindError};
use crate::ioctl::{CallError, Device};
use crate::prepare::{PrepareError, Prepared, Wanted, prepare};

/// A camera that is there and takes its settings; it was let go again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadyCamera {
    /// Its node at this moment.
    pub path: PathBuf,
    /// What was read back.
    pub notes: Vec<String>,
}

/// Why a camera is not ready.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// It is not found.
    #[error(transparent)]
    Find(#[from] FindError),
    /// It does not take its settings.
    #[error("{}: {source}", path.display())]
    Prepare {
        /// Its node.
        path: PathBuf,
        /// What is wrong.
        #[source]
        source: PrepareError,
    },
    /// Its driver refuses to stream.
    #[error("{}: {source}", path.display())]
    Stream {
        /// Its node.
        path: PathBuf,
        /// The call.
        #[source]
        source: CallError,
    },
    /// It is the other camera.
    #[error("{} is camera 1 already; name another device", path.display())]
    Same {
        /// The node of both.
        path: PathBuf,
    },
}

impl CameraError {
    /// Whether the configuration must change; else it may help to wait for the device.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Find(error) => error.is_lasting(),
            Self::Prepare { source, .. } => source.is_lasting(),
            Self::Stream { .. } => false,
            Self::Same { .. } => true,
        }
    }
}

/// Finds both cameras, sets them as configured, reads that back, and lets them go.
pub fn check_cameras(cameras: &[V4l2Camera; 2], wanted: &Wanted) -> [Result<ReadyCamera, CameraError>; 2] {
    let check = |camera| open(camera, wanted).map(|(path, _, prepared)| ReadyCamera { path, notes: prepared.notes });
    let [cam1, cam2] = cameras.each_ref().map(check);
    let cam2 = match (&cam1, cam2) {
        (Ok(cam1), Ok(cam2)) if cam1.path == cam2.path => Err(CameraError::Same { path: cam2.path }),
        (_, cam2) => cam2,
    };
    [cam1, cam2]
}

/// Finds a camera, opens it, and sets it as configured.
///
/// # Errors
/// It is not there, or does not take its settings.
pub(crate) fn open(camera: &V4l2Camera, wanted: &Wanted) -> Result<(PathBuf, Device, Prepared), CameraError> {
    let (path, device) = find::open(&camera.device)?;
    match prepare(&device, camera, wanted) {
        Ok(prepared) => Ok((path, device, prepared)),
        Err(source) => Err(CameraError::Prepare { path, source }),
    }
}
