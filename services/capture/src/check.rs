//! Both cameras of a configuration looked at before anything starts: are they there, and do they take what is wanted?

use std::path::PathBuf;

use fringeflow::config::V4l2Camera;
use fringeflow::pixels::SourceFormat;

use crate::find::{self, FindError};
use crate::prepare::{PrepareError, prepare};

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
            Self::Same { .. } => true,
        }
    }
}

/// Finds both cameras, sets them as configured, reads that back, and lets them go. Where the size of their images is not
/// known, they are only found.
#[must_use]
pub fn check_cameras(
    cameras: &[V4l2Camera; 2],
    format: SourceFormat,
    size_px: Option<[usize; 2]>,
    rate_hz: f64,
) -> [Result<ReadyCamera, CameraError>; 2] {
    let check = |camera| check(camera, format, size_px, rate_hz);
    let [cam1, cam2] = cameras.each_ref().map(check);
    let cam2 = match (&cam1, cam2) {
        (Ok(cam1), Ok(cam2)) if cam1.path == cam2.path => Err(CameraError::Same { path: cam2.path }),
        (_, cam2) => cam2,
    };
    [cam1, cam2]
}

fn check(
    camera: &V4l2Camera,
    format: SourceFormat,
    size_px: Option<[usize; 2]>,
    rate_hz: f64,
) -> Result<ReadyCamera, CameraError> {
    let (path, device) = find::open(&camera.device)?;
    let Some(size_px) = size_px else {
        let notes = vec!["there; not set, since the size of its images is not known".to_owned()];
        return Ok(ReadyCamera { path, notes });
    };
    match prepare(&device, camera, format, size_px, rate_hz) {
        Ok(prepared) => Ok(ReadyCamera { path, notes: prepared.notes }),
        Err(source) => Err(CameraError::Prepare { path, source }),
    }
}
