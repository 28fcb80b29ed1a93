//! The capture service: one V4L2 camera in, images in shared memory out.
//!
//! Each camera has a process of its own: a driver that hangs holds up that camera alone, and its death costs no image of the
//! other. An image is copied once, out of the driver's buffer into the memory that the phase service reads.

mod camera;
mod capture;
mod device;
mod ioctl;
mod notes;
mod numbering;
mod queue;
mod stamp;

pub use device::{
    CameraError, Control, ControlError, ControlKind, ControlProblem, FindError, FormatError, ListedControl, Listing,
    MenuItem, OfferedFormat, OfferedSize, OpenError, PrepareError, RateError, ReadyCamera, TimingsError, VideoSignal,
    Wanted, cameras, check_cameras, describe, rates_text,
};
pub use ioctl::CallError;

use fringeflow_dataset::CameraId;
use fringeflow_runtime::{Host, ServiceArgs, ServiceError};

use capture::Capture;

/// Runs the service of a camera until it is to end.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs, id: CameraId) -> Result<(), ServiceError> {
    let name = match id {
        CameraId::Cam1 => "camera1",
        CameraId::Cam2 => "camera2",
    };
    let mut host = Host::open(arguments, name)?;
    let mut capture = Capture::open(&host, id)?;
    loop {
        // Asked before the driver is, so that what it has filled by then is not left.
        let is_last = host.stop.is_requested();
        capture.turn(&mut host, is_last)?;
        if is_last {
            break;
        }
        if host.beat_is_due() {
            capture.report(&mut host);
        }
        host.tend(|_, now_ns| capture.ensure_connected(now_ns));
    }
    capture.report(&mut host);
    Ok(())
}
