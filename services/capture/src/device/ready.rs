//! A camera made ready to stream, from its name in the configuration on; and both looked at before anything starts: are
//! they there, and do they take what is wanted?

use std::path::{Path, PathBuf};

use fringeflow_config::V4l2Camera;

use crate::ioctl::{CallError, Device};

use super::find::{self, FindError};
use super::prepare::{PrepareError, Prepared, Wanted, prepare};

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

/// Finds both cameras, sets them as configured, reads that back, and lets them go. Where it is not known what is wanted of
/// them, they are only found.
pub fn check_cameras(cameras: &[V4l2Camera; 2], wanted: Option<&Wanted>) -> [Result<ReadyCamera, CameraError>; 2] {
    let check = |camera: &V4l2Camera, path: PathBuf| match wanted {
        Some(wanted) => open_at(&path, camera, wanted).map(|(_, prepared)| ReadyCamera { path, notes: prepared.notes }),
        None => Ok(ReadyCamera { path, notes: vec!["not set, because the size of its images is unknown".to_owned()] }),
    };
    let [cam1, cam2] = cameras;
    match [find::find(&cam1.device), find::find(&cam2.device)] {
        [Ok(path1), Ok(path2)] if path1 == path2 => {
            let same = CameraError::Same { path: path2 };
            [check(cam1, path1), Err(same)]
        }
        [path1, path2] => [
            path1.map_err(CameraError::Find).and_then(|path| check(cam1, path)),
            path2.map_err(CameraError::Find).and_then(|path| check(cam2, path)),
        ],
    }
}

/// Finds a camera, opens it, and sets it as configured.
///
/// # Errors
/// It is not there, or does not take its settings.
pub(crate) fn open(camera: &V4l2Camera, wanted: &Wanted) -> Result<(PathBuf, Device, Prepared), CameraError> {
    let path = find::find(&camera.device)?;
    let (device, prepared) = open_at(&path, camera, wanted)?;
    Ok((path, device, prepared))
}

fn open_at(path: &Path, camera: &V4l2Camera, wanted: &Wanted) -> Result<(Device, Prepared), CameraError> {
    let device = find::open_node(path).map_err(FindError::Unopened)?;
    match prepare(&device, camera, wanted) {
        Ok(prepared) => Ok((device, prepared)),
        Err(source) => Err(CameraError::Prepare { path: path.to_owned(), source }),
    }
}
