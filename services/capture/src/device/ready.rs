//! Opens a camera by its name in the configuration and prepares it for streaming. Also checks the cameras before a
//! run: whether they are connected and take their settings.

use std::path::{Path, PathBuf};

use fringeflow_config::{StampMoment, V4l2Camera};

use crate::ioctl::{BufferKind, CallError, Device};

use super::capability::Capability;
use super::find::{FindError, find_device, open_node};
use super::prepare::{PrepareError, Prepared, prepare};
use super::stamp_source;
use super::wanted::Wanted;

/// A camera that is connected and takes its settings. It is closed again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadyCamera {
    /// Its current node.
    pub path: PathBuf,
    /// What was read back, as text.
    pub notes: Vec<String>,
}

/// Why a camera is not ready.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// The camera was not found.
    #[error(transparent)]
    Find(#[from] FindError),
    /// The camera does not take its settings.
    #[error("{}: {source}", path.display())]
    Prepare {
        /// Its node.
        path: PathBuf,
        /// The reason.
        #[source]
        source: PrepareError,
    },
    /// The driver refuses to stream.
    #[error("{}: {source}", path.display())]
    Stream {
        /// Its node.
        path: PathBuf,
        /// The refused call.
        #[source]
        source: CallError,
    },
    /// Both names mean the same device.
    #[error("{} is already camera 1; name another device", path.display())]
    Same {
        /// The node of both.
        path: PathBuf,
    },
}

impl CameraError {
    /// Whether the configuration must change. Otherwise it may help to wait for the device.
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

/// Finds both cameras, sets them as configured, reads the settings back, and closes them. Without `wanted` the cameras
/// are only found and opened.
pub fn check_cameras(cameras: &[V4l2Camera; 2], wanted: Option<&Wanted>) -> [Result<ReadyCamera, CameraError>; 2] {
    let check = |camera, path| check_at(camera, path, wanted);
    let [cam1, cam2] = cameras;
    match [find_device(&cam1.device), find_device(&cam2.device)] {
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

/// Checks the device that gives the images of both cameras, as [`check_cameras`] does.
///
/// # Errors
/// The device is not connected, or does not take its settings.
pub fn check_stereo_camera(camera: &V4l2Camera, wanted: Option<&Wanted>) -> Result<ReadyCamera, CameraError> {
    check_at(camera, find_device(&camera.device)?, wanted)
}

fn check_at(camera: &V4l2Camera, path: PathBuf, wanted: Option<&Wanted>) -> Result<ReadyCamera, CameraError> {
    let Some(wanted) = wanted else {
        open_node(&path).map_err(FindError::Unopened)?;
        return Ok(ReadyCamera { path, notes: vec!["not set, because the size of its images is unknown".to_owned()] });
    };
    let (device, prepared) = open_at(&path, camera, wanted)?;
    let stamps = stamps_text(&device, camera.stamp, prepared.kind);
    Ok(ReadyCamera { path, notes: prepared.notes.into_iter().chain([stamps]).collect() })
}

/// Describes the time stamps of a device, and how the configuration takes them.
fn stamps_text(device: &Device, moment: StampMoment, kind: BufferKind) -> String {
    let declared = match Capability::read(device) {
        Ok(capability) => stamp_source::describe(device, &capability, kind),
        Err(error) => format!("time stamps unknown ({error})"),
    };
    match moment {
        StampMoment::Driver => declared,
        StampMoment::Start => declared + ", configured as the start of the exposure",
        StampMoment::End => declared + ", configured as the end of the image",
    }
}

/// Finds a camera, opens it, and sets it as configured.
///
/// # Errors
/// The camera is not connected, or does not take its settings.
pub(crate) fn open(camera: &V4l2Camera, wanted: &Wanted) -> Result<(PathBuf, Device, Prepared), CameraError> {
    let path = find_device(&camera.device)?;
    let (device, prepared) = open_at(&path, camera, wanted)?;
    Ok((path, device, prepared))
}

fn open_at(path: &Path, camera: &V4l2Camera, wanted: &Wanted) -> Result<(Device, Prepared), CameraError> {
    let (device, capability) = open_node(path).map_err(FindError::Unopened)?;
    match prepare(&device, &capability, camera, wanted) {
        Ok(prepared) => Ok((device, prepared)),
        Err(source) => Err(CameraError::Prepare { path: path.to_owned(), source }),
    }
}
